"""An unmade bed and a table cloth as parameters, those of `examples/growth`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["PRESETS"]

#: A pattern of checks, 24 by 24.
_CHECKS = tuple(tuple((row % 2 + column % 2) / 2 for column in range(24)) for row in range(24))

PRESETS: Mapping[str, Mapping[str, Any]] = {
    # Fig. 2 (d): an unmade bed: more matter where it is painted, folds across the stroke; weight, mattress and pillow
    "bed": {
        "shape": "square",
        "thickness": 0.004,
        "curved": False,
        "gravity": (0, 0, -0.02),
        "attached": (
            {"where": {"kind": "ball", "centre": (0.3, 0, 0), "radius": 0.1}, "axes": ("x", "y")},
            {"where": {"kind": "ball", "centre": (-0.24, 0, 0), "radius": 0.2}, "axes": ("x", "y")},
        ),
        "solids": (
            {"kind": "box", "centre": (0, 0, -0.18), "size": (0.76, 0.54, 0.24), "edge": 0.03},
            {"kind": "box", "centre": (-0.24, 0, -0.045), "size": (0.2, 0.42, 0.09), "edge": 0.04},
        ),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "ball", "centre": (0.05, 0.05, 0), "radius": 0.4},
                "frame": (1, 0.5, 0),
                "stretch": (1.5, 1.0),
            },
        ),
        "colours": ({"colour": (0.6, 0.65, 0.75)},),
    },
    # Fig. 2 (e): a table cloth: lengthened towards the hem, nothing at the table; it hangs
    "cloth": {
        "shape": "disc",
        "thickness": 0.01,
        "gravity": (0, 0, -0.015),
        "attached": ({"where": {"kind": "ball", "centre": (0, 0, 0), "radius": 0.9}},),
        "tools": (
            {
                "kind": "surface",
                "frame": "around",
                "stretch": (1.5, 1.4),
                "where": {"kind": "band", "along": "radius", "low": 0.5, "high": 1.0},
            },
        ),
        "colours": (
            {"colour": (0.85, 0.82, 0.75)},
            {"colour": (0.55, 0.04, 0.03), "where": {"kind": "texture", "values": _CHECKS}},
        ),
    },
}
