"""Fibres that deviate: their paths, the wood that they fill, and what is hewn out of it."""
