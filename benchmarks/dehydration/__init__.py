"""Benchmarks of drying fruits."""
