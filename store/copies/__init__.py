"""Copies of whole stores: kept elsewhere, checked, and brought back."""
