"""Drying kinetics: from hours in the sun or in an air dryer to the shrinkage s of the flesh."""

from .clock import CLOCK, LATEST
from .conditions import Drying

__all__ = ["CLOCK", "LATEST", "Drying"]
