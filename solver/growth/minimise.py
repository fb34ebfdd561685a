"""Three ways down an energy, each as a generator that yields after every step, so that a caller may stop in between.

All keep one promise: the energy never rises (Armijo's rule on every accepted step).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Energy", "Point", "conjugate_gradients", "lbfgs", "quasi_newton"]

Floats = NDArray[np.float64]

_ARMIJO, _SHORTEST = 1e-4, 1e-9
#: Steps with one factor before it is asked whether it still helps, and the drop of the gradient that says so.
_BURST, _HELPS = 6, 0.1


class Energy(Protocol):
    """What is minimised: value and gradient (n, 3), and an approximate inverse of the second derivative."""

    def __call__(self, x: Floats) -> tuple[float, Floats]:
        """Return energy and gradient."""

    def refactor(self, x: Floats) -> None:
        """Take the tangent at x for `precondition`."""

    def precondition(self, v: Floats) -> Floats:
        """Return the approximate inverse applied to v."""


class Point(NamedTuple):
    """A point on the way: position, energy, largest gradient component; stuck: no step lowers the energy."""

    x: Floats
    energy: float
    gradient: float
    stuck: bool = False


def _descend(
    energy: Energy, x: Floats, f: float, d: Floats, slope: float, t: float = 1.0
) -> tuple[float, float, Floats]:
    """Return (step, energy, gradient) of the first of t, t/2, t/4, ... that lowers the energy; step 0 if none does."""
    while t > _SHORTEST:
        value, gradient = energy(x + t * d)
        if value <= f + _ARMIJO * t * slope:
            return t, value, gradient
        t *= 0.5
    return 0.0, f, d


class _Memory:
    """The last pairs of step and change of gradient (limited-memory BFGS, Nocedal 1980)."""

    def __init__(self, length: int) -> None:
        self._length = length
        self.pairs: list[tuple[Floats, Floats, float]] = []

    def add(self, s: Floats, y: Floats) -> None:
        product = float(np.vdot(s, y))
        if product > 1e-12 * np.linalg.norm(s) * np.linalg.norm(y):
            self.pairs = [*self.pairs, (s, y, 1 / product)][-self._length :]

    def direction(self, gradient: Floats, energy: Energy | None) -> Floats:
        """Return minus the approximate inverse times gradient; around a preconditioner if there is one."""
        q, shares = gradient.copy(), []
        for s, y, r in reversed(self.pairs):
            share = r * np.vdot(s, q)
            shares.append(share)
            q -= share * y
        if energy is not None:
            z = energy.precondition(q)
        elif self.pairs:
            s, y, r = self.pairs[-1]
            z = q / (r * np.vdot(y, y))
        else:
            z = q * (1e-3 / max(np.abs(q).max(), 1e-300))
        for (s, y, r), share in zip(self.pairs, reversed(shares), strict=True):
            z += s * (share - r * np.vdot(y, z))
        return -z


def _bfgs(energy: Energy, x: Floats, length: int, preconditioned: bool) -> Iterator[Point]:
    f, g = energy(x)
    memory = _Memory(length)
    since, fresh, mark = 0, False, np.inf
    while True:
        size = float(np.abs(g).max())
        yield Point(x, f, size)
        if preconditioned and since >= _BURST:
            if size > _HELPS * mark:
                energy.refactor(x)
                memory, fresh = _Memory(length), True
            since, mark = 0, size
        mark = size if mark == np.inf else mark
        d = memory.direction(g, energy if preconditioned else None)
        slope = float(np.vdot(g, d))
        t = 0.0
        if slope < 0:
            t, value, gradient = _descend(energy, x, f, d, slope)
        if t == 0.0:
            if preconditioned and not fresh:
                energy.refactor(x)
                memory, fresh, since, mark = _Memory(length), True, 0, size
                continue
            if memory.pairs:
                memory = _Memory(length)
                continue
            yield Point(x, f, size, stuck=True)
            return
        memory.add(t * d, gradient - g)
        x, f, g = x + t * d, value, gradient
        since, fresh = since + 1, False


def quasi_newton(energy: Energy, x: Floats) -> Iterator[Point]:
    """L-BFGS around a stale factor of the tangent, taken anew when six steps drop the gradient less than tenfold."""
    return _bfgs(energy, x, 6, preconditioned=True)


def lbfgs(energy: Energy, x: Floats) -> Iterator[Point]:
    """Plain L-BFGS with 12 pairs."""
    return _bfgs(energy, x, 12, preconditioned=False)


def conjugate_gradients(energy: Energy, x: Floats) -> Iterator[Point]:
    """Nonlinear conjugate gradients (Polak-Ribiere+), as the paper has them; the first trial step is a secant's."""
    f, g = energy(x)
    d, trial = -g, 1e-2 / max(float(np.abs(g).max()), 1e-300) * 1e-1
    while True:
        size = float(np.abs(g).max())
        yield Point(x, f, size)
        slope = float(np.vdot(g, d))
        if slope >= 0:
            d, slope = -g, -float(np.vdot(g, g))
        if slope == 0:
            yield Point(x, f, size, stuck=True)
            return
        _, ahead = energy(x + trial * d)
        bend = float(np.vdot(ahead, d)) - slope
        t, value, gradient = _descend(
            energy, x, f, d, slope, min(-trial * slope / bend, 10 * trial) if bend > 0 else 2 * trial
        )
        if t == 0.0:
            if np.array_equal(d, -g):
                yield Point(x, f, size, stuck=True)
                return
            d = -g
            continue
        trial, x, f = t, x + t * d, value
        d = -gradient + max(0.0, float(np.vdot(gradient, gradient - g) / np.vdot(g, g))) * d
        g = gradient
