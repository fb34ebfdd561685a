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

#: How a wedge and an axe are turned [radian].
_END_ON, _UP, _DOWN = (0.0, 1.5708, 0.0), (0.24, 0.0, 0.0), (-0.04, 0.0, 0.0)


def _there(time: float, position: tuple[float, ...], turn: tuple[float, ...] = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    """Return a waypoint."""
    return {"time": time, "position": position, "turn": turn}


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
    # a wedge driven by 6 cm into the end of a log
    "wedge": {
        "rods": 60,
        "vertices": 49,
        "length": 0.16,
        "radius": 0.025,
        "damping": 50.0,
        "mass_scaling": 25.0,
        "grain": {"strength": 0.2},
        "bodies": [
            {
                "shape": "wedge",
                "size": (0.0, 0.07, 0.08),
                "angle": 0.4,
                "path": [_there(0.0, (0.161, 0.0, 0.0), _END_ON), _there(0.04, (0.1, 0.0, 0.0), _END_ON)],
            }
        ],
    },
    # half a kilogram thrown at a stick on two blocks, at 8 m/s
    "hammer": {
        "rods": 60,
        "vertices": 41,
        "length": 0.2,
        "radius": 0.008,
        "clamp": "none",
        "gravity": 9.81,
        "grain": {"strength": 0.2},
        "bodies": [
            {"size": (0.02, 0.06, 0.02), "path": [_there(0.0, (0.03, 0.0, -0.018))]},
            {"size": (0.02, 0.06, 0.02), "path": [_there(0.0, (0.17, 0.0, -0.018))]},
            {
                "size": (0.03, 0.03, 0.08),
                "mass": 0.5,
                "velocity": (0.0, 0.0, -8.0),
                "path": [_there(0.0, (0.1, 0.0, 0.0485), (0.0, 0.2, 0.0))],
            },
        ],
    },
    # swung about a shoulder 40 cm away at a branch that is held at both ends
    "axe": {
        "rods": 60,
        "vertices": 51,
        "length": 0.2,
        "radius": 0.012,
        "clamp": "both",
        "damping": 50.0,
        "grain": {"strength": 0.2},
        "bodies": [
            {
                "shape": "wedge",
                "size": (0.012, 0.06, 0.08),
                "angle": 0.6,
                "pivot": (0.0, -0.4, 0.0),
                "path": [_there(0.0, (0.1, -0.4, -0.01), _UP), _there(0.012, (0.1, -0.4, -0.01), _DOWN)],
            }
        ],
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
    "wedge": (0.01, 0.02, 0.03, 0.04),
    "hammer": (0.001, 0.002, 0.004, 0.006, 0.01),
    "axe": (0.003, 0.006, 0.009, 0.012),
    # the block meets the branchlet at some 12 ms
    "twig": (0.01, 0.02, 0.03, 0.04, 0.05),
    # a hundredth of its length is drawn out within a millisecond
    "pulled": (0.0005, 0.001, 0.0015, 0.002, 0.003),
}
