"""The way back: from a shape, its outline or its numbers to the parameters that come nearest."""
