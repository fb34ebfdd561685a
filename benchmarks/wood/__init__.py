"""Benchmarks of bonded rods."""
