"""Grips on their paths: where they are at a time, and what they put in."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..model.motion import WORK
from ..model.state import State

__all__ = ["steer", "take"]


def steer(state: State, time: float, span: float) -> None:
    """Set the pace of what grips move so that it is on its path `span` [s] after `time` [s].

    Paths are followed from one call to the next, so that a turn of some degrees between two leaves nothing behind. What
    a new pace takes is booked as work.
    """
    pins, m = state.wood.pins, state.wood.motion
    if not len(pins.vertex):
        return
    for g, course in enumerate(state.wood.grips):
        mine = np.flatnonzero(pins.grip == g)
        i, c = pins.vertex[mine], pins.component[mine]
        shift, turn = course.at(time + span)
        there = course.pivot + shift + Rotation.from_rotvec(turn).apply(course.rest - course.pivot)
        pins.pace[mine] = (there[np.searchsorted(course.vertex, i), c] - m.x[i, c]) / span
    before = m.v[pins.vertex, pins.component].copy()
    m.v[pins.vertex, pins.component] = pins.pace
    state.books[WORK] += 0.5 * float(m.mass[pins.vertex] @ (pins.pace**2 - before**2))


def take(state: State, time: float) -> None:
    """Move the impulses that grips put in to `gripped`, with their moments about the pivots at `time` [s]."""
    pins = state.wood.pins
    if not len(pins.vertex):
        return
    for g, course in enumerate(state.wood.grips):
        mine = np.flatnonzero(pins.grip == g)
        i, c = pins.vertex[mine], pins.component[mine]
        impulse = np.zeros((len(mine), 3))
        impulse[np.arange(len(mine)), c] = pins.taken[mine]
        arm = state.wood.motion.x[i] - course.pivot - course.at(time)[0]
        state.gripped[g, :3] += impulse.sum(0)
        state.gripped[g, 3:] += np.cross(arm, impulse).sum(0)
    pins.taken[:] = 0.0
