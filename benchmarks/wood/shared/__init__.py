"""What several benchmarks of wood need."""
