"""Contact of rods with bodies and with each other."""
