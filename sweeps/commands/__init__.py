"""The commands of `wizen` below HTTP."""
