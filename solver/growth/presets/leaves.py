"""Leaves, flowers and what curls up as parameters, those of `examples/growth`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["PRESETS"]

#: Of the cabbage leaf, where it is stiff and where it is pale.
_VEINS = (
    ((-1, 0, 0), (0.9, 0, 0)),
    ((-0.7, 0, 0), (0.0, 0.8, 0)),
    ((-0.7, 0, 0), (0.0, -0.8, 0)),
    ((-0.3, 0, 0), (0.6, 0.6, 0)),
    ((-0.3, 0, 0), (0.6, -0.6, 0)),
)

PRESETS: Mapping[str, Mapping[str, Any]] = {
    # Fig. 2 (b): a leaf from a triangle: a curve along the midrib, its intensities from stalk to tip
    "leaf": {
        "shape": "triangle",
        "aspect": 4,
        "thickness": 0.05,
        "seed": 1,
        "tools": (
            {
                "kind": "curve",
                "points": ((-2, 0, 0), (-1.5, 0, 0), (-1.2, 0, 0), (-0.9, 0, 0), (-0.5, 0, 0), (2, 0, 0)),
                "intensities": (-1.2, -1.2, -0.4, 0.6, 1.0, 1.0),
                "radius": 1.5,
                "stretch": (1.0, 3.0),
            },
            {
                "kind": "surface",
                "where": {"kind": "everywhere"},
                "frame": (1, 0, 0),
                "stretch": (1, 1),
                "curl": (0.3, -0.3),
            },
        ),
        "ribs": ({"where": {"kind": "lines", "lines": (((-2, 0, 0), (2, 0, 0)),), "width": 0.12}, "stiffness": 50},),
        "colours": (
            {"colour": (0.1, 0.3, 0.05)},
            {
                "colour": (0.45, 0.6, 0.2),
                "where": {
                    "kind": "lines",
                    "lines": (
                        ((-2, 0, 0), (2, 0, 0)),
                        ((-1.1, 0, 0), (-0.4, 0.5, 0)),
                        ((-1.1, 0, 0), (-0.4, -0.5, 0)),
                        ((-0.6, 0, 0), (0.1, 0.5, 0)),
                        ((-0.6, 0, 0), (0.1, -0.5, 0)),
                        ((-0.1, 0, 0), (0.6, 0.4, 0)),
                        ((-0.1, 0, 0), (0.6, -0.4, 0)),
                        ((0.5, 0, 0), (1.1, 0.3, 0)),
                        ((0.5, 0, 0), (1.1, -0.3, 0)),
                    ),
                    "width": 0.05,
                },
            },
        ),
    },
    # Fig. 2 (c): a flower: the corners of a square grow into petals and curl
    "flower": {
        "shape": "square",
        "thickness": 0.03,
        "seed": 1,
        "solids": ({"kind": "plane", "point": (0, 0, -0.01)},),
        "attached": ({"where": {"kind": "ball", "centre": (0, 0, 0), "radius": 0.2}},),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "ball", "centre": (0.5, 0.5, 0), "radius": 0.55},
                "frame": (1, 1, 0),
                "stretch": (2.6, 2.4),
                "curl": (-2, -2),
            },
            {
                "kind": "surface",
                "where": {"kind": "ball", "centre": (-0.5, 0.5, 0), "radius": 0.55},
                "frame": (-1, 1, 0),
                "stretch": (2.6, 2.4),
                "curl": (-2, -2),
            },
            {
                "kind": "surface",
                "where": {"kind": "ball", "centre": (-0.5, -0.5, 0), "radius": 0.55},
                "frame": (1, 1, 0),
                "stretch": (2.6, 2.4),
                "curl": (-2, -2),
            },
            {
                "kind": "surface",
                "where": {"kind": "ball", "centre": (0.5, -0.5, 0), "radius": 0.55},
                "frame": (-1, 1, 0),
                "stretch": (2.6, 2.4),
                "curl": (-2, -2),
            },
        ),
        "colours": (
            {"colour": (0.7, 0.15, 0.3)},
            {"colour": (0.8, 0.6, 0.05), "where": {"kind": "ball", "centre": (0, 0, 0), "radius": 0.3}},
        ),
    },
    # Fig. 2 (f): a cabbage leaf: reaction and diffusion between stiff veins, a bowl, and a margin that grows more
    "cabbage": {
        "shape": "disc",
        "thickness": 0.025,
        "attached": ({"where": {"kind": "ball", "centre": (-0.95, 0, 0), "radius": 0.2}},),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "radius", "low": 0.2, "high": 0.9},
                "stretch": (0.75, 1.0),
                "curl": (-0.5, -0.5),
            },
            {"kind": "surface", "where": {"kind": "rim", "width": 0.15}, "frame": "around", "stretch": (1.6, 1.0)},
            {
                "kind": "surface",
                "where": {"kind": "reaction", "size": 40, "feed": 0.035, "kill": 0.06},
                "stretch": (1.2, 1.2),
            },
        ),
        "ribs": (
            {
                "where": {
                    "kind": "lines",
                    "lines": _VEINS,
                    "width": 0.08,
                },
                "stiffness": 20,
            },
        ),
        "colours": (
            {"colour": (0.25, 0.45, 0.12)},
            {
                "colour": (0.7, 0.78, 0.45),
                "where": {
                    "kind": "lines",
                    "lines": _VEINS,
                    "width": 0.1,
                },
            },
        ),
    },
    # A calla: a tube narrows to a stalk below and opens above, on one side more
    "calla": {
        "shape": "tube",
        "aspect": 4,
        "thickness": 0.08,
        "attached": ({"where": {"kind": "band", "along": "z", "low": 0.2, "high": 0.0}, "axes": ("z",)},),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "z", "low": 2.8, "high": 0.6},
                "frame": "around",
                "stretch": (0.15, 1.0),
            },
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "z", "low": 2.4, "high": 4.0},
                "frame": "around",
                "stretch": (2.4, 1.1),
                "curl": (0, -0.5),
            },
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "x", "low": 0.0, "high": 1.0},
                "frame": "around",
                "stretch": (1.0, 1.12),
            },
        ),
        "colours": (
            {"colour": (0.85, 0.83, 0.75)},
            {"colour": (0.2, 0.4, 0.08), "where": {"kind": "band", "along": "z", "low": 2.5, "high": 1.0}},
        ),
    },
    # A fern that curls up: a narrow triangle, its rest curvature more and more towards the tip
    "fern": {
        "shape": "triangle",
        "aspect": 12,
        "thickness": 0.12,
        "curved": False,
        "attached": ({"where": {"kind": "band", "along": "x", "low": -5.8, "high": -6.0}},),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "x", "low": -4.5, "high": -4.6},
                "frame": (1, 0, 0),
                "stretch": (1.0, 1.0),
                "curl": (-1.0, 0),
            },
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "x", "low": -2.5, "high": 5.5},
                "frame": (1, 0, 0),
                "stretch": (1.0, 1.0),
                "curl": (-3.3, 0),
            },
        ),
        "colours": ({"colour": (0.18, 0.4, 0.05)},),
    },
    # A leaf of lettuce: a disc that lengthens, a stiff midrib, and a margin that grows on and on and ruffles
    "lettuce": {
        "shape": "disc",
        "thickness": 0.01,
        "attached": ({"where": {"kind": "ball", "centre": (-0.95, 0, 0), "radius": 0.2}},),
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "everywhere"},
                "frame": (1, 0, 0),
                "stretch": (1.35, 0.95),
                "curl": (0.0, 0.5),
            },
            {"kind": "surface", "where": {"kind": "rim", "width": 0.3}, "frame": "around", "stretch": (2.2, 1.1)},
        ),
        "ribs": (
            {"where": {"kind": "ball", "centre": (-0.2, 0, 0), "radius": 0.6}, "stiffness": 40},
            {"where": {"kind": "lines", "lines": (((-1, 0, 0), (0.8, 0, 0)),), "width": 0.15}, "stiffness": 200},
        ),
        "colours": (
            {"colour": (0.13, 0.33, 0.03)},
            {"colour": (0.38, 0.55, 0.1), "where": {"kind": "band", "along": "radius", "low": 0.9, "high": 0.3}},
            {
                "colour": (0.8, 0.84, 0.6),
                "where": {
                    "kind": "lines",
                    "lines": (
                        ((-1, 0, 0), (0.8, 0, 0)),
                        ((-0.6, 0, 0), (-0.1, 0.6, 0)),
                        ((-0.6, 0, 0), (-0.1, -0.6, 0)),
                        ((-0.2, 0, 0), (0.35, 0.6, 0)),
                        ((-0.2, 0, 0), (0.35, -0.6, 0)),
                    ),
                    "width": 0.07,
                },
            },
        ),
    },
}
