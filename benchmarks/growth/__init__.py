"""Benchmarks of shells that grow."""
