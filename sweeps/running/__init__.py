"""Jobs run: claimed, handed to executors, stored, noted, and told of."""
