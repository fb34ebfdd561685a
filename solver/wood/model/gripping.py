"""What grips hold, where they go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...contract import InvalidGeometry
from ..params import Cut, Grip, WoodParams
from .arrays import Pins

__all__ = ["NOTHING", "Course", "courses", "pins_of", "within"]

#: What is said of a grip that is beside the branch, or between its vertices.
NOTHING = "holds no vertex of a rod."


class Course(NamedTuple):
    """A grip's vertices (n,), ascending, their places at time 0 (n, 3) [m], and its path."""

    vertex: np.ndarray
    rest: np.ndarray
    pivot: np.ndarray  # (3,) at time 0 [m]
    times: np.ndarray  # (w,) [s]
    shifts: np.ndarray  # (w, 3) [m]
    turns: np.ndarray  # (w, 3) rotation vectors [radian]

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return shift and turn (3,) at a time; a grip rests before and after its path."""
        return tuple(  # type: ignore[return-value]
            np.array([np.interp(time, self.times, values[:, c]) for c in range(3)])
            for values in (self.shifts, self.turns)
        )


def within(points: np.ndarray, box: Grip | Cut) -> np.ndarray:
    """Return whether points (..., 3) are in a box."""
    return np.asarray(((points >= np.array(box.low)) & (points <= np.array(box.high))).all(-1))


def courses(params: WoodParams, straight: np.ndarray, x: np.ndarray, free: np.ndarray) -> tuple[Course, ...]:
    """Return the grips on vertices that are at x (v, 3) [m] at time 0, and at `straight` in the straight bundle.

    free (v,): not held by a clamp.

    Raises:
        InvalidGeometry: a grip holds nothing.

    """
    found = []
    for n, grip in enumerate(params.grips):
        vertex = np.flatnonzero(within(straight, grip) & free)
        if not len(vertex):
            raise InvalidGeometry(
                f"grip {n} {NOTHING}",
                advice="Widen its box, or take more vertices or rods.",
            )
        pivot = np.array(grip.pivot) if grip.pivot is not None else x[vertex].mean(0)
        path = grip.path
        found.append(
            Course(
                vertex,
                x[vertex].copy(),
                pivot,
                np.array([p.time for p in path] or [0.0]),
                np.array([p.shift for p in path] or [(0.0, 0.0, 0.0)]),
                np.array([p.turn for p in path] or [(0.0, 0.0, 0.0)]),
            )
        )
    return tuple(found)


def pins_of(params: WoodParams, held_by: tuple[Course, ...]) -> Pins:
    """Return what grips move; what two of them hold belongs to the first.

    Raises:
        InvalidGeometry: nothing is left for one.

    """
    vertex, component, owner, taken = [], [], [], set()
    for g, (grip, course) in enumerate(zip(params.grips, held_by, strict=True)):
        own = 0
        for i in course.vertex:
            for c in ("xyz".index(a) for a in grip.holds):
                if (int(i), c) not in taken:
                    taken.add((int(i), c))
                    vertex.append(i)
                    component.append(c)
                    owner.append(g)
                    own += 1
        if not own:
            raise InvalidGeometry(
                f"grip {g} holds only what others hold.", advice="Move its box apart from theirs, or leave it out."
            )
    zeros = np.zeros(len(vertex))
    return Pins(
        np.array(vertex, np.int32), np.array(component, np.int32), np.array(owner, np.int32), zeros, zeros.copy()
    )
