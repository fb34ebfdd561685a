"""Tools: where they act on a surface, and what they do to its rest state."""
