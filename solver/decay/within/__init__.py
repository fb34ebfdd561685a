"""Rot, nutrient and water as fields in the flesh, one medium with the skin above it."""
