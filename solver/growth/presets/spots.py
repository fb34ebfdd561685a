"""Spots on a sphere, a mushroom and a pumpkin as parameters, those of `examples/growth`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["PRESETS"]

PRESETS: Mapping[str, Mapping[str, Any]] = {
    # Fig. 2 (a): a sphere with an isotropic hot spot
    "sphere-spot": {
        "shape": "sphere",
        "thickness": 0.05,
        "tools": ({"kind": "spot", "at": (0, 0, 1), "radius": 0.45, "stretch": (8, 8)},),
        "colours": ({"colour": (0.55, 0.2, 0.05), "grown": 12},),
    },
    # Fig. 2 (a): a hot spot that grows more in one direction: a ridge
    "sphere-anisotropic": {
        "shape": "sphere",
        "thickness": 0.05,
        "tools": ({"kind": "spot", "at": (0, 0, 1), "radius": 0.6, "stretch": (6, 1.8), "frame": (0, 1, 0)},),
        "colours": ({"colour": (0.55, 0.2, 0.05), "grown": 12},),
    },
    # Fig. 2 (a): a hot spot whose frame turns
    "sphere-twisted": {
        "shape": "sphere",
        "thickness": 0.05,
        "tools": ({"kind": "spot", "at": (0, 0, 1), "radius": 0.7, "stretch": (6, 1.0), "turning": 120},),
        "colours": ({"colour": (0.55, 0.2, 0.05), "grown": 12},),
    },
    # Fig. 2 (a): a hot spot that splits
    "sphere-branching": {
        "shape": "sphere",
        "thickness": 0.05,
        "tools": (
            {
                "kind": "spot",
                "at": (0, 0, 1),
                "radius": 0.45,
                "stretch": (10, 10),
                "activation": ((0.0, 2.0),),
                "splits": (0.35,),
                "spread": 0.75,
                "shrink": 0.65,
            },
        ),
        "colours": ({"colour": (0.55, 0.2, 0.05), "grown": 12},),
    },
    # Fig. 2 (b): a mushroom: the tip of a stem grows, and a curve around it outwards, normalised: an even cap
    "mushroom": {
        "shape": "stem",
        "aspect": 3.5,
        "thickness": 0.15,
        "attached": ({"where": {"kind": "band", "along": "z", "low": 1.0, "high": 0.0}},),
        "tools": (
            {
                "kind": "curve",
                "apex": {"at": (0, 0, 4.5), "radius": 3},
                "closed": True,
                "radius": 1.7,
                "stretch": (1.0, 1.5),
                "normalised": 0.4,
            },
            {
                "kind": "surface",
                "where": {"kind": "band", "along": "z", "low": 2.5, "high": 3.6},
                "stretch": (2.4, 2.4),
            },
        ),
        "colours": (
            {"colour": (0.8, 0.72, 0.55)},
            {"colour": (0.62, 0.03, 0.02), "where": {"kind": "band", "along": "z", "low": 3.35, "high": 3.45}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (0.0, 0.0, 4.5), "radius": 0.24}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (0.67, 0.14, 4.23), "radius": 0.24}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (-0.09, 0.71, 4.2), "radius": 0.24}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (-0.64, 0.03, 4.26), "radius": 0.24}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (-0.08, -0.71, 4.2), "radius": 0.24}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (0.59, 0.74, 3.82), "radius": 0.24}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (-0.71, 0.65, 3.77), "radius": 0.24}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (-0.68, -0.64, 3.86), "radius": 0.24}},
            {"colour": (0.85, 0.8, 0.7), "where": {"kind": "ball", "centre": (0.61, -0.74, 3.77), "radius": 0.24}},
        ),
    },
    # Fig. 2 (c): a pumpkin: creases on the lines of a sphere, growth between them, a little pressure
    "pumpkin": {
        "shape": "sphere",
        "thickness": 0.08,
        "pressure": 0.03,
        "imperfection": 0.0,
        "tools": (
            {
                "kind": "surface",
                "where": {"kind": "meridians", "count": 10, "width": 0.5},
                "frame": "around",
                "stretch": (1.65, 1.3),
                "curl": (9, 0),
            },
            {"kind": "surface", "where": {"kind": "everywhere"}, "stretch": (1.0, 0.85), "curl": (-5, 0)},
        ),
        "colours": (
            {"colour": (0.7, 0.22, 0.02)},
            {"colour": (0.2, 0.25, 0.05), "where": {"kind": "ball", "centre": (0, 0, 1), "radius": 0.3}},
        ),
    },
}
