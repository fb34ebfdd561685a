"""Shapes of the paper's gallery (Fig. 2) as parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

__all__ = ["PRESETS"]

_TOP = (0.0, 0.0, 1.0)


def _ring(radius: float, z: float, count: int = 32, share: float = 1.0) -> list[tuple[float, float, float]]:
    turns = 2 * np.pi * share * np.arange(count) / count
    return [(round(radius * np.cos(t), 6), round(radius * np.sin(t), 6), z) for t in turns]


#: Every preset runs to growth time 1.
PRESETS: Mapping[str, Mapping[str, Any]] = {
    # (a) hot spots on a sphere
    "sphere-spot": {
        "tools": ({"kind": "spot", "at": _TOP, "radius": 0.5, "stretch": (4.0, 4.0)},),
    },
    "sphere-anisotropic": {
        "tools": ({"kind": "spot", "at": _TOP, "radius": 0.6, "stretch": (5.0, 1.3)},),
    },
    "sphere-twisted": {
        "tools": ({"kind": "spot", "at": _TOP, "radius": 0.6, "stretch": (5.0, 1.3), "turning": 180.0},),
    },
    "sphere-branching": {
        "tools": ({"kind": "spot", "at": _TOP, "radius": 0.5, "stretch": (6.0, 6.0), "splits": (0.5,)},),
    },
    # (b) hot curve about the tip of a stem
    "mushroom": {
        "shape": "tube",
        "aspect": 2.0,
        "attached": ({"where": {"kind": "band", "along": "z", "low": 0.6, "high": 0.0}},),
        "tools": (
            {
                "kind": "curve",
                "points": _ring(1.0, 2.0),
                "closed": True,
                "radius": 0.5,
                "stretch": (1.0, 4.0),
                "normalised": 1.0,
            },
        ),
    },
    # (c) hot surfaces
    "pumpkin": {
        "thickness": 0.1,
        "pressure": 0.05,
        "tools": (
            {"kind": "surface", "where": {"kind": "meridians", "count": 8, "width": 0.3}, "stretch": (1.35, 1.35)},
        ),
    },
    "leaf": {
        "thickness": 0.008,
        "shape": "half_disc",
        "curved": False,
        "attached": ({"where": {"kind": "ball", "centre": (0.0, 0.0, 0.0), "radius": 0.2}},),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "radius", "low": 0.7, "high": 1.0},
                "stretch": (2.2, 1.0),
            },
        ),
    },
    # (e) table cloth: tangential growth from nothing at the top to all at the hem
    "cloth": {
        "shape": "tube",
        "aspect": 1.5,
        "thickness": 0.02,
        "attached": ({"where": {"kind": "band", "along": "z", "low": 1.3, "high": 1.5}},),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "z", "low": 1.4, "high": 0.0},
                "stretch": (4.0, 1.0),
            },
        ),
    },
    # (f) expansion texture on a disc
    "cabbage": {
        "shape": "disc",
        "thickness": 0.02,
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "radius", "low": 0.3, "high": 1.0},
                "stretch": (2.0, 1.2),
            },
        ),
    },
    # (d) cloth with extra matter in patches, on a bed
    "bed": {
        "shape": "square",
        "thickness": 0.008,
        "solids": ({"kind": "plane", "point": (0.0, 0.0, -0.01)},),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "noise", "size": 0.25},
                "frame": (1.0, 0.3, 0.0),
                "stretch": (1.35, 1.0),
            },
        ),
    },
}
