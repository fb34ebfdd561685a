"""Hostile parameters, and what runs of them end in."""
