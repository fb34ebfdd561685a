"""Benchmarks of scenes."""
