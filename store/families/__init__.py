"""Several tables of one solver, its families of shapes: which of them answers a question."""
