"""Self-contact of the skin for an explicit march with unit steps."""
