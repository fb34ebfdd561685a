"""Newton's way down an energy, as one body and a heap of them go it: what differs between the two is handed in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Floats
from ...contract import NotConverged
from .solid import Solid

__all__ = ["Found", "Ways", "descended", "scales", "shortened", "skin_areas"]

#: Halvings of a step before giving up; least part of a direction that is tried for the model.
_HALVINGS, _LEAST = 40, 1e-3
#: Strains below this count as none: a body at rest has no forces to measure its residual by.
_NOTHING = 1e-6


class Found(NamedTuple):
    """Points (n, 3) at rest, out-of-balance force over the forces in it, steps, and what `slope` said besides."""

    points: Floats
    residual: float
    steps: int
    said: Any


class Ways(NamedTuple):
    """What is to be at rest, at points x (n, 3).

    energy: of all. slope: its gradient (n, 3), the residual of it, and anything that `direction` is handed. direction:
    Newton's, for x, gradient, what was said, and how accurately. placed: moves x in place to the best height.
    """

    energy: Callable[[Floats], float]
    slope: Callable[[Floats], tuple[Floats, float, Any]]
    direction: Callable[[Floats, Floats, Any, float], Floats]
    placed: Callable[[Floats], None] | None = None


def scales(mu: Floats, volume: Floats, count: int, round_off: float) -> tuple[float, float]:
    """Return the force that counts as none on so many points, and the round-off of the energy."""
    nothing = _NOTHING * float(np.mean(mu)) * float(np.mean(volume)) ** (2 / 3) * count**0.5
    return nothing, round_off * float(np.sum(mu * volume))


def descended(
    start: Floats,
    ways: Ways,
    tolerance: float,
    steps: int,
    slack: float,
    what: tuple[str, str],
    advice: str,
    watch: Callable[[], None] = lambda: None,
    halvings: int = _HALVINGS,
) -> Found:
    """Return the rest that is reached from points `start` (n, 3), none of whose tetrahedra may be inverted.

    slack: differences of energy that decide nothing. what: it and its shape in words. watch: called before each
    step; may raise to stop.

    Raises:
        NotConverged: no step lowers the energy any more, or there were too many.

    """
    x = start.copy()
    if ways.placed is not None:
        ways.placed(x)
    now = ways.energy(x)
    if not np.isfinite(now):
        raise NotConverged(f"the {what[1]} to start from is inverted.", advice="Ask for stages closer together.")
    residual = np.inf
    for step in range(steps):
        watch()
        before = residual
        g, residual, said = ways.slope(x)
        if residual <= tolerance:
            return Found(x, residual, step, said)
        # a rough direction is enough far from the end (Eisenstat and Walker)
        asked = min(0.1, max(0.5 * residual / max(before, residual), 0.3 * tolerance / residual, 1e-6))
        d = ways.direction(x, g, said, asked)
        down, share = float(np.sum(g * d)), 1.0
        for _ in range(halvings):
            then = ways.energy(x + share * d)
            # the last digits of the energy decide nothing: there the step is taken as it is
            if then <= now + 1e-4 * share * down + slack:
                break
            share /= 2
        else:
            break
        x += share * d
        now = then
        if ways.placed is not None:
            # the best height is known, and a body that has left what carries it knows no other way back
            ways.placed(x)
            now = ways.energy(x)
    raise NotConverged(
        f"the {what[0]} stopped at a residual of {residual:.1e}.",
        residual=residual,
        advice=advice,
    )


def shortened(pressed: Callable[[float], float], gain: float, bend: float) -> float:
    """Return how much of a direction lowers a model: contacts' potential at a part, plus gain and bend of the rest.

    Contacts that change to and fro would go on for ever: the model itself must fall.
    """
    part, held = 1.0, pressed(0.0)
    while part > _LEAST and pressed(part) + part * (gain + part * bend) > held:
        part /= 2
    return part


def skin_areas(solid: Solid) -> Floats:
    """Return the area of its skin that each point of a body (p) stands for [r1^2]."""
    found = np.zeros(len(solid.points))
    corners = solid.points[solid.skin[solid.faces]]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    found[solid.skin] = np.bincount(solid.faces.ravel(), np.repeat(areas / 3, 3), len(solid.skin))
    return found
