"""Sparse algebra of all solvers: one nested dissection, multifrontal factors, bands, conjugate gradients, patterns."""
