"""Steps in time: as long as the error allows, and never shortened by the stages that are asked for.

The main path goes from one new colony to the next, with steps chosen by step doubling. A stage that lies within a step
is reached from the step's start on a copy, so 24 or 96 stages of one run show the same rot.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...contract import Context, Unstable
from .both import Both
from .system import System

__all__ = ["Reached", "march"]

#: The error is measured on every so many steps: a front that runs evenly asks for even steps. In weather, on each.
_EVERY = 8
_SHORTEST = 1e-7


class Reached(NamedTuple):
    """A stage: its state, the main path's steps so far and the largest error of a step over the limit."""

    day: float
    state: Both
    steps: int
    error: float


def march(
    system: System, days: tuple[float, ...], tolerance: float, longest: float, context: Context
) -> Iterator[Reached]:
    """Yield the stages in turn. tolerance: largest relative error of one step; longest: longest step [day].

    Raises:
        Unstable: no step is short enough.
        Cancelled: the observer asked to stop.

    """
    day, state, steps, worst = 0.0, system.start, 0, 0.0
    length, since = longest / 4, _EVERY
    every = _EVERY if system.steady else 1
    last = days[-1]
    tried: _Tried | None = None
    for wanted in days:
        while day < wanted:
            context.check_cancelled()
            rooting = system.next_root(state, day + length)
            dt = min(length, rooting - day)
            if since >= every:
                # two halves, compared with the whole; the halves are kept, also for the next stage within this step
                if tried is None or (tried.day, tried.dt) != (day, dt):
                    tried = _doubled(system, state, day, dt)
                _, _, halves, error = tried
                ratio = error / tolerance
                if ratio > 1 and dt > _SHORTEST:
                    length = dt * max(0.9 * ratio ** (-1 / 3), 0.25)
                    continue
                if ratio > 1:
                    raise Unstable(
                        f"steps of {dt:.1e} days are still too long on day {day:.3f}.",
                        advice="Ask for a slower growth_rate, or a finer quality.",
                    )
                if day + dt > wanted:
                    break
                if dt == length:
                    length = min(dt * float(np.clip(0.9 * max(ratio, 1e-6) ** (-1 / 3), 0.5, 2)), longest)
                    since = 1
                worst = max(worst, ratio)
                state = halves
            else:
                if day + dt > wanted:
                    break
                state = system.advance(state, day, dt)
                since += 1
            steps += 1
            rooted = dt == rooting - day
            day = rooting if rooted else day + dt
            if rooted:
                state = system.root(state)
            context.report(day / last, f"day {day:.2f}")
        shown = system.advance(state, day, wanted - day) if wanted > day else state
        yield Reached(wanted, shown, steps, worst)


class _Tried(NamedTuple):
    """A step from a day, done in two halves, and the error of these."""

    day: float
    dt: float
    halves: Both
    error: float


def _doubled(system: System, state: Both, day: float, dt: float) -> _Tried:
    halves = system.advance(system.advance(state, day, dt / 2), day + dt / 2, dt / 2)
    # of second order: the halves' own error is a third of the difference
    return _Tried(day, dt, halves, system.distance(system.advance(state, day, dt), halves) / 3)
