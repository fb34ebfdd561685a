"""The thesis' experiments and a few others, as parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["PRESETS", "STAGES"]


def _block(x: float, z: float, down: float = 0.0, until: float = 3.0) -> dict[str, Any]:
    """Return a cylinder across the bundle, 1 cm thick, that moves `down` [m] until a time [s]."""
    path = [{"time": 0.0, "position": (x, 0.0, z)}]
    if down:
        path.append({"time": until, "position": (x, 0.0, z - down)})
    return {"shape": "cylinder", "axis": "y", "size": (0.01, 0.06, 0.0), "path": path, "friction": 0.3}


_FIG_42: dict[str, Any] = {
    # the thesis does not say how many; 200 take twice as long
    "rods": 100,
    "clamp": "none",
    "bodies": [_block(0.02, -0.015), _block(0.13, -0.015), _block(0.075, 0.015, 0.03)],
    "gravity": 9.81,
    "damping": 50.0,
    "mode": "auto",
}

PRESETS: Mapping[str, Mapping[str, Any]] = {
    # one round fibre under its end load, at rest: the elastica's case
    "cantilever": {
        "rods": 1,
        "vertices": 40,
        "radius": 0.002,
        "tip_load": (0.0, 0.0, -5.0),
        "mode": "static",
        "fracture": "none",
        "grain": {"stiffness": 0.0, "strength": 0.0},
    },
    # bent at the start, free, unbreakable: Fig. 4.1's energy
    "fig-4.1": {"rods": 50, "clamp": "none", "bend": 0.0133, "fracture": "none"},
    # three blocks press slowly on a branch of 15 cm, by either name: Fig. 4.2 (real masses: set mode explicit; hours)
    "fig-4.2": _FIG_42,
    "press": _FIG_42,
    # a bent branchlet, held at one end, hit near the other
    "twig": {
        "rods": 19,
        "vertices": 24,
        "length": 0.12,
        "radius": 0.003,
        "curvature": 4.0,
        "damping": 50.0,
        "bodies": [_block(0.10, 0.05, 0.10, 0.05)],
    },
    # drawn out by both ends until it parts
    "pulled": {
        "rods": 50,
        "vertices": 24,
        "length": 0.1,
        "radius": 0.005,
        "clamp": "both",
        "pull": (1.0, 0.0, 0.0),
        "grain": {"stiffness": 0.05, "strength": 0.15},
    },
}

#: When there is something to see [s]; equilibria have their full loads at 1 s.
STAGES: Mapping[str, tuple[float, ...]] = {
    "cantilever": (0.25, 0.5, 1.0),
    "fig-4.1": (0.001, 0.002, 0.003, 0.004),
    "fig-4.2": (0.75, 1.5, 2.25, 3.0),
    "press": (0.75, 1.5, 2.25, 3.0),
    # the block meets the branchlet at some 12 ms
    "twig": (0.01, 0.02, 0.03, 0.04, 0.05),
    # a hundredth of its length is drawn out within a millisecond
    "pulled": (0.0005, 0.001, 0.0015, 0.002, 0.003),
}
