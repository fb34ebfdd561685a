"""Generations of tables: collected from results, written, read and judged."""
