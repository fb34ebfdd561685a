"""Physics: parameters in, named fields out. Knows nothing of files, HTTP, jobs or tables."""

__version__ = "0.1.0"
