"""Commands of `wizen` that the service adds, and what `wizen serve` prints."""
