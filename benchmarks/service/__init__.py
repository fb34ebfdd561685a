"""Benchmarks of the service and the look-up."""
