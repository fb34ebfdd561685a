"""Benchmarks of rot and mould."""
