"""What may be asked of steps: not too many, and that nothing is past the wood between two, and meets nothing of it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...contract import InvalidInput
from ..choosing import swept, turned
from ..model.bodies.building import sides
from ..params import Grip, WoodParams

__all__ = ["few_enough", "slow_enough"]

#: Steps of the longest run: a single rod takes an hour for them.
_MOST = 1e10


def few_enough(dt: float, last: float, asked: float | None = None) -> None:
    """Refuse what would never come to its last stage, at `last` [s], in steps of dt [s]; asked: the step asked for.

    Raises:
        InvalidInput: see above.

    """
    if last > _MOST * dt:
        if asked == dt:
            raise InvalidInput(
                f"steps of {dt:.2g} s are too many up to the last stage, at {last:g} s.",
                advice=f"Leave step out, give {last / _MOST:.2g} or more, or ask for earlier stages.",
            )
        raise InvalidInput(
            f"no steps longer than {dt:.2g} s are stable, and the last stage is at {last:g} s.",
            advice="Ask for earlier stages, or give heavier bodies, a lower contact_stiffness, or thicker rods.",
        )


def slow_enough(params: WoodParams, dt: float, edge: float) -> None:
    """Refuse bodies that go farther in a step of dt [s] than they and a rod are wide, grips farther than an edge [m].

    Raises:
        InvalidInput: see above.

    """
    rod = 2 * params.wide / params.rods**0.5
    found = []
    for n, body in enumerate(params.bodies):
        way = max((swept(body, a, b) / (b.time - a.time) for a, b in pairwise(body.path)), default=0.0)
        found.append((f"bodies.{n}", way * dt, float(sides(body).min()) + rod))
    for n, grip in enumerate(params.grips):
        way = max((turned(a, b, _arm(grip, params)) / (b.time - a.time) for a, b in pairwise(grip.path)), default=0.0)
        found.append((f"grips.{n}", way * dt, edge))
    for name, way, most in found:
        if way > most:
            raise InvalidInput(
                f"{name} moves by {way:.2g} m in a step of {dt:.2g} s, past what is {most:.2g} m wide between two.",
                advice=f"Let its path take {np.ceil(way / most):.0f} times as long or more, or give a shorter step.",
            )


def _arm(grip: Grip, params: WoodParams) -> float:
    """Return how far [m] from its pivot what a grip holds of the straight bundle may be, about."""
    wide = 2 * params.wide
    low = np.clip(grip.low, [0, -wide, -wide], [params.length, wide, wide])
    high = np.clip(grip.high, [0, -wide, -wide], [params.length, wide, wide])
    pivot = (low + high) / 2 if grip.pivot is None else np.array(grip.pivot)
    return float(np.linalg.norm(np.maximum(np.abs(low - pivot), np.abs(high - pivot))))
