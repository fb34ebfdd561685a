"""What acts on a body from outside: its weight, a floor, neighbours that it leans on, and what keeps it from rolling.

The floor is the plane y = `floor`, a neighbour a rigid ball; both push by one law, without friction: a one-sided
quadratic penalty of how deep a point of the surface is in them. A fruit alone on such a plane would slide and roll away
at a touch, so its core is held by weak springs, sideways only: floor and neighbours carry all the weight.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ...contract import NotConverged

__all__ = ["Loads", "Touch", "below", "drop", "pushes", "touches"]


#: Longest stride in the search for the height at which neighbours carry a body, and how far it is searched [r1].
_STRIDE, _FAR = 0.05, 4.0
#: First stride [r1].
_SMALL = 1e-6


class Loads(NamedTuple):
    """What acts on the points: weight (p) [Pa r1^2]; a floor with the contact's stiffness (p) [Pa r1].

    floor (p): height at which each point meets the floor [r1]: points may stand for what hangs below them.

    tether (p) [Pa r1]: springs that hold points sideways to the places `held` (p, 3). Without a floor: None.
    balls (b, 4) [r1]: centres and radii of the neighbours, which push with the contact's stiffness too.
    """

    weight: Floats
    floor: Floats | None
    contact: Floats
    tether: Floats
    held: Floats
    balls: Floats = np.empty((0, 4))

    @property
    def carries(self) -> bool:
        """Whether there is something to lie on."""
        return self.floor is not None or len(self.balls) > 0


class Touch(NamedTuple):
    """Pairs of a point and a ball: numbers (k) of both, depth in the ball (k), unit way out of it (k, 3)."""

    point: Ints
    ball: Ints
    depth: Floats
    out: Floats


def touches(x: Floats, loads: Loads, margin: float = 0.0) -> Touch:
    """Return which points (p, 3) are in balls, or within a margin [r1] of them: there depths are negative."""
    skin = np.flatnonzero(loads.contact > 0) if len(loads.balls) else np.empty(0, np.int64)
    way = x[skin][:, None] - loads.balls[:, :3]
    far = np.linalg.norm(way, axis=2)
    depth = loads.balls[:, 3] - far
    i, ball = np.nonzero(depth > -margin)
    return Touch(skin[i], ball, depth[i, ball], way[i, ball] / np.maximum(far[i, ball], 1e-300)[:, None])


def below(x: Floats, loads: Loads) -> Floats:
    """Return how far points are below the floor (p) [r1]."""
    return np.zeros(len(x)) if loads.floor is None else np.maximum(loads.floor - x[:, 1], 0.0)


def pushes(x: Floats, loads: Loads) -> Floats:
    """Return the force of each ball on the body (b, 3) [Pa r1^2]."""
    found = np.zeros((len(loads.balls), 3))
    near = touches(x, loads)
    np.add.at(found, near.ball, (loads.contact[near.point] * near.depth)[:, None] * near.out)
    return found


def drop(x: Floats, loads: Loads) -> float:
    """Return how far to lift points so that a rigid body of their shape is carried: then some always touch.

    Raises:
        NotConverged: neither floor nor neighbours would carry it at any height about here.

    """
    if not loads.carries:
        return 0.0
    lift = 0.0 if loads.floor is None else _onto_floor(x, loads)
    if len(loads.balls) == 0:
        return lift
    up = np.array([0.0, 1.0, 0.0])
    if loads.floor is not None and not len(touches(x + lift * up, loads).point):
        return lift
    weight = float(loads.weight.sum())

    def sinks(lift: float) -> bool:
        moved = x + lift * up
        return float(np.sum(loads.contact * below(moved, loads)) + pushes(moved, loads)[:, 1].sum()) < weight

    # of all heights at which the forces are even the nearest is wanted: others lie beyond a neighbour
    down, stride, begun = sinks(lift), _SMALL, lift
    while sinks(lift) == down:
        before, lift = lift, lift + (-stride if down else stride)
        stride = min(2 * stride, _STRIDE)
        if abs(lift - begun) > _FAR:
            raise NotConverged(
                "nothing carries the body: it falls between its neighbours.",
                advice="Bring the neighbours closer, or ask for earlier stages.",
            )
    low, high = min(before, lift), max(before, lift)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if sinks(middle) else (middle, high)
    return (low + high) / 2


def _onto_floor(x: Floats, loads: Loads) -> float:
    """Return the lift at which the floor alone carries the body."""
    assert loads.floor is not None
    weight = float(loads.weight.sum())
    high = float((loads.floor - x[:, 1])[loads.contact > 0].max())
    low = high - weight / float(loads.contact[loads.contact > 0].min())
    for _ in range(60):
        middle = (low + high) / 2
        depth = np.maximum(loads.floor - x[:, 1] - middle, 0.0)
        low, high = (middle, high) if float(np.sum(loads.contact * depth)) > weight else (low, middle)
    return (low + high) / 2
