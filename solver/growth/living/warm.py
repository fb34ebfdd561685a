"""What a first step loads: compiled kernels, which take half a second."""

from __future__ import annotations

from functools import cache

from ..engine import Engine
from ..params import GrowthParams

__all__ = ["warm"]

_SHEET = {
    "shape": "disc",
    "thickness": 0.05,
    "remesh": 1.2,
    "step": 0.2,
    "tools": [{"kind": "stroke", "points": [(0.5, 0.0, 0.0)], "times": [0.0], "radius": 0.5, "stretch": (1.5, 1.5)}],
}


@cache
def warm() -> None:
    """Grow a small sheet for some steps, once in a process."""
    engine = Engine(GrowthParams.parse(_SHEET), 60, history=False)
    engine.advance(60.0, until=0.6)
