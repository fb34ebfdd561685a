"""Generations of tables: written from results, read, checked and compared."""
