"""HTTP: shapes in milliseconds, from tables that the sweeps built."""
