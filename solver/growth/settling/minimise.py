"""Three ways down an energy, each as a generator that yields after every step, so that a caller may stop in between.

All keep one promise: the energy never rises (Armijo's rule on every accepted step).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np
from numba import njit

from ...arrays import Floats

__all__ = ["Energy", "Point", "conjugate_gradients", "descend", "lbfgs", "longest", "quasi_newton"]


_ARMIJO, _SHORTEST = 1e-4, 1e-9
#: Least curvature along a step that is learnt, over the model's, and the step below which the model is forgotten.
_DAMPED, _SHORT = 0.2, 1e-2
#: Steps in a row that change no digit of the energy, after which none will.
_IDLE = 10
#: Steps with one inverse before it is asked whether it still helps, and the drop of the gradient that says so.
_BURST, _HELPS = 20, 0.3


class Energy(Protocol):
    """What is minimised: value and gradient (n, 3), and an approximate inverse of the second derivative."""

    def __call__(self, x: Floats) -> tuple[float, Floats]:
        """Return energy and gradient."""

    def allowed(self, x: Floats, way: Floats, wanted: float) -> float:
        """Return how much of a way, at most `wanted`, may be gone from x in one step."""

    @property
    def cut(self) -> bool:
        """Whether the last step that was asked for was not allowed whole."""

    def refactor(self, x: Floats) -> Iterator[None]:
        """Take the inverse at x for `precondition`; yields after pieces of the work."""

    @property
    def ready(self) -> bool:
        """Whether there is an inverse."""

    def precondition(self, v: Floats) -> Floats:
        """Return the approximate inverse applied to v."""


class Point(NamedTuple):
    """A point on the way: position, energy, largest force on a vertex; stuck: no step lowers the energy.

    left: how far Newton's own step from the point before led, which is what was left to the least of the energy there;
    infinite where the step was another one, as it must be where the energy bends down.
    """

    x: Floats
    energy: float
    gradient: float
    stuck: bool = False
    left: float = np.inf


def longest(vectors: Floats) -> float:
    """Return the length of the longest of vectors (n, 3), which stays where all are turned: a component would not."""
    return float(np.sqrt(np.einsum("ij,ij->i", vectors, vectors).max()))


def descend(
    energy: Energy, x: Floats, f: float, d: Floats, slope: float, t: float = 1.0
) -> tuple[float, float, Floats]:
    """Return (step, energy, gradient) of the first step from t down that lowers the energy; step 0 if none does.

    A step that fails is followed by the least of the cubic through both ends, within a tenth and a half of it.
    """
    t = energy.allowed(x, d, t)
    while t > _SHORTEST:
        value, gradient = energy(x + t * d)
        if value <= f + _ARMIJO * t * slope:
            return t, value, gradient
        t *= min(max(_least(f, slope * t, value, float(np.vdot(gradient, d)) * t), 0.1), 0.5)
    return 0.0, f, d


def _least(f: float, slope: float, value: float, then: float) -> float:
    """Return where the cubic with values f, value and slopes slope, then at 0 and 1 is least; 0.5 if it has no bend."""
    bend = slope + then - 3 * (value - f)
    root = bend * bend - slope * then
    if not (np.isfinite(root) and root >= 0):
        return 0.5
    below = then - slope + 2 * np.sqrt(root)
    return float(1 - (then + np.sqrt(root) - bend) / below) if below else 0.5


@njit(cache=True, fastmath={"reassoc", "contract"})
def _dot(a: Floats, b: Floats) -> float:
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit(cache=True, fastmath={"reassoc", "contract"})
def _inward(q: Floats, s: Floats, y: Floats, products: Floats, shares: Floats, last: int, count: int) -> None:
    """Take the pairs' parts out of q (m,), newest first; s, y (length, m) are rings that end at `last`."""
    for k in range(count):
        at = (last - k) % len(s)
        shares[at] = _dot(s[at], q) / products[at]
        row = y[at]
        for i in range(len(q)):
            q[i] -= shares[at] * row[i]


@njit(cache=True, fastmath={"reassoc", "contract"})
def _outward(z: Floats, s: Floats, y: Floats, products: Floats, shares: Floats, last: int, count: int) -> None:
    """Put the pairs' parts into z (m,), oldest first."""
    for k in range(count - 1, -1, -1):
        at = (last - k) % len(s)
        share = shares[at] - _dot(y[at], z) / products[at]
        row = s[at]
        for i in range(len(z)):
            z[i] += share * row[i]


class _Memory:
    """The last pairs of step and change of gradient (limited-memory BFGS, Nocedal 1980)."""

    def __init__(self, length: int, size: int) -> None:
        self._s, self._y = np.empty((length, size)), np.empty((length, size))
        self._products, self._shares = np.empty(length), np.empty(length)
        self._last, self.count = -1, 0

    def clear(self) -> None:
        self.count = 0

    def add(self, s: Floats, y: Floats) -> None:
        s, y = s.ravel(), y.ravel()
        product = _dot(s, y)
        if product > 1e-12 * np.sqrt(_dot(s, s) * _dot(y, y)):
            self._last = (self._last + 1) % len(self._s)
            self._s[self._last], self._y[self._last], self._products[self._last] = s, y, product
            self.count = min(self.count + 1, len(self._s))

    def direction(self, gradient: Floats, energy: Energy | None) -> Floats:
        """Return minus the approximate inverse times gradient; around a preconditioner if there is one."""
        q = gradient.copy()
        ring = (self._s, self._y, self._products, self._shares, self._last, self.count)
        _inward(q.reshape(-1), *ring)
        if energy is not None:
            z = energy.precondition(q)
        elif self.count:
            y = self._y[self._last]
            z = q * (self._products[self._last] / _dot(y, y))
        else:
            z = q * (1e-3 / max(longest(q), 1e-300))
        _outward(z.reshape(-1), *ring)
        return -z


def _bfgs(energy: Energy, x: Floats, length: int, preconditioned: bool) -> Iterator[Point]:
    f, g = energy(x)
    memory = _Memory(length, x.size)
    since, fresh, mark, idle = 0, False, np.inf, 0
    anew = preconditioned and not energy.ready
    while True:
        size = longest(g)
        yield Point(x, f, size)
        if preconditioned and since >= _BURST:
            anew, since, mark = size > _HELPS * mark, 0, size
        if anew:
            for _ in energy.refactor(x):
                yield Point(x, f, size)
            memory.clear()
            anew, fresh, since, mark = False, True, 0, size
        mark = size if mark == np.inf else mark
        d = memory.direction(g, energy if preconditioned else None)
        slope = float(np.vdot(g, d))
        t = 0.0
        if slope < 0:
            t, value, gradient = descend(energy, x, f, d, slope)
        if t == 0.0:
            if preconditioned and not fresh:
                anew = True
                continue
            if memory.count:
                memory.clear()
                continue
            if preconditioned:
                # a fresh inverse points nowhere down, by its rounding or at a kink: steepest descent still may
                yield from _bfgs(energy, x, length, preconditioned=False)
                return
            yield Point(x, f, size, stuck=True)
            return
        if preconditioned:
            # where the energy bends down, what the model has is mixed in (Powell 1978)
            model, found = -t * t * slope, t * (float(np.vdot(d, gradient)) - slope)
            share = 1.0 if found >= _DAMPED * model else (1 - _DAMPED) * model / (model - found)
            memory.add(t * d, share * (gradient - g) - (1 - share) * t * g)
            if t < _SHORT and not energy.cut:
                memory.clear()
        else:
            memory.add(t * d, gradient - g)
        idle = idle + 1 if value == f else 0
        x, f, g = x + t * d, value, gradient
        if idle == _IDLE:
            yield Point(x, f, longest(g), stuck=True)
            return
        since, fresh = since + 1, False


def quasi_newton(energy: Energy, x: Floats) -> Iterator[Point]:
    """L-BFGS with 12 pairs around a stale inverse, taken anew when 20 steps drop the gradient less than threefold."""
    return _bfgs(energy, x, 12, preconditioned=True)


def lbfgs(energy: Energy, x: Floats) -> Iterator[Point]:
    """Plain L-BFGS with 12 pairs."""
    return _bfgs(energy, x, 12, preconditioned=False)


def conjugate_gradients(energy: Energy, x: Floats) -> Iterator[Point]:
    """Nonlinear conjugate gradients (Polak-Ribiere+), as the paper has them; the first trial step is a secant's."""
    f, g = energy(x)
    idle = 0
    d, trial = -g, 1e-2 / max(longest(g), 1e-300) * 1e-1
    while True:
        size = longest(g)
        yield Point(x, f, size)
        slope = float(np.vdot(g, d))
        if slope >= 0:
            d, slope = -g, -float(np.vdot(g, g))
        if slope == 0:
            yield Point(x, f, size, stuck=True)
            return
        trial = energy.allowed(x, d, trial)
        _, ahead = energy(x + trial * d)
        bend = float(np.vdot(ahead, d)) - slope
        t, value, gradient = descend(
            energy, x, f, d, slope, min(-trial * slope / bend, 10 * trial) if bend > 0 else 2 * trial
        )
        if t == 0.0:
            if np.array_equal(d, -g):
                yield Point(x, f, size, stuck=True)
                return
            d = -g
            continue
        idle = idle + 1 if value == f else 0
        trial, x, f = t, x + t * d, value
        if idle == _IDLE:
            yield Point(x, f, longest(gradient), stuck=True)
            return
        d = -gradient + max(0.0, float(np.vdot(gradient, gradient - g) / np.vdot(g, g))) * d
        g = gradient
