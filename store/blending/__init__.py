"""From a question to weights of samples, and from weights to a surface."""
