"""One file per format that a shape can be asked for in."""
