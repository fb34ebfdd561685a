"""Live engines driven by messages: what a connection, or a file of actions, speaks with."""
