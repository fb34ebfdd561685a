"""Surfaces as pictures: a software renderer, contact sheets, maps and sections."""
