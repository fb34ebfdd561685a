"""A growing shell that somebody works on: actions, gestures, and the moments that these go back to."""
