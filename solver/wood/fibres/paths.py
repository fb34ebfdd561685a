"""Where fibres go that are not straight: they wind about the pith (spiral grain) and flow round knots.

A fibre is named by its place y, z in a section far from knots, with the spiral's turn at mid length taken off. At every
distance from the pith it stays in its own shell, as fibres of a growing stem do. Round a knot it goes as a streamline
goes round a post (Goodman and Bodig 1978, the flow-grain analogy; Phillips et al. 1981): with x along and w around, P
the girth of the shell, which makes the flow periodic, a the knot's radius there and s how much longer it is than wide,

    w0 = w - (pi a^2 / P) sin(2 pi w / P) / (cosh(2 pi x / s P) - cos(2 pi w / P)).

P to infinity gives the flow round one cylinder. A knot is a cone from the pith to where its radius is given, so that
a / P is the same in all shells within. Fibres that part round a knot leave a hole of its shape; the widest knot, half
as wide as it is far from the pith, is 1 % less wide than a, as the flow sees the post again round the stem.
"""

from __future__ import annotations

import numpy as np

from ..params import Knot, WoodParams

__all__ = ["crowded", "named", "placed"]

#: Halvings of the interval in which a streamline is looked for: to round-off.
_HALVINGS = 54
#: Fibres are squeezed to half where they pass a post; before and behind it they spread without end.
_WIDEST = 2.0


def _shell(points: np.ndarray, pith: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distance [m] and angle [radian] about the pith of points (..., 3)."""
    y, z = points[..., 1] - pith[0], points[..., 2] - pith[1]
    return np.hypot(y, z), np.arctan2(z, y)


def _wound(points: np.ndarray, params: WoodParams, sign: float) -> np.ndarray:
    """Return points (..., 3) turned about the pith by the spiral, +1, or back, -1."""
    rate, pith = params.grain.spiral, np.array(params.grain.pith)
    if rate == 0:
        return points
    turn = sign * rate * (points[..., 0] - params.length / 2)
    y, z = points[..., 1] - pith[0], points[..., 2] - pith[1]
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([points[..., 0], pith[0] + c * y - s * z, pith[1] + s * y + c * z], -1)


class _Post:
    """A knot as fibres meet it, in the frame in which they do not wind."""

    def __init__(self, knot: Knot, params: WoodParams) -> None:
        self._pith = np.array(params.grain.pith)
        out, angle = _shell(_wound(np.array(knot.at), params, -1.0), self._pith)
        self._out, self._angle = float(out), float(angle)
        self._x, self._radius, self._long = knot.at[0], knot.radius, knot.elongation

    def _local(self, points: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return distance from the pith, cosh along, angle beyond the knot (-pi to pi), and 2 (pi a / P)^2."""
        away, angle = _shell(points, self._pith)
        beyond = (angle - self._angle + np.pi) % (2 * np.pi) - np.pi
        safe = np.maximum(away, 1e-300)
        wide = 0.5 * (self._radius * np.minimum(away / self._out, 1.0) / safe) ** 2
        along = np.minimum(np.abs(points[..., 0] - self._x) / (self._long * safe), 300.0)
        return away, np.cosh(along), beyond, wide

    def _back(self, away: np.ndarray, angle: np.ndarray, points: np.ndarray) -> np.ndarray:
        turn = angle + self._angle
        y, z = self._pith[0] + away * np.cos(turn), self._pith[1] + away * np.sin(turn)
        return np.stack([points[..., 0], y, z], -1)

    def round(self, points: np.ndarray) -> np.ndarray:
        """Return where fibres named by points (..., 3) pass."""
        away, along, wanted, wide = self._local(points)
        low, high, goal = np.zeros(wanted.shape), np.full(wanted.shape, np.pi), np.abs(wanted)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            less = _stream(middle, along, wide) < goal
            low, high = np.where(less, middle, low), np.where(less, high, middle)
        return self._back(away, np.copysign((low + high) / 2, wanted), points)

    def name(self, points: np.ndarray) -> np.ndarray:
        """Return the fibres that pass at points (..., 3); a knot's own wood belongs to the fibre that parts there."""
        away, along, angle, wide = self._local(points)
        found = np.maximum(_stream(np.abs(angle), along, wide), 0.0)
        return self._back(away, np.copysign(found, angle), points)

    def crowding(self, points: np.ndarray) -> np.ndarray:
        """Return how much of its width (...) a fibre has where it passes at points (..., 3)."""
        _, along, angle, wide = self._local(points)
        c, gap = np.cos(angle), np.maximum(along - np.cos(angle), 1e-12)
        slope = 1 - wide * (along * c - 1) / gap**2
        found: np.ndarray = 1 / np.maximum(slope, 1 / _WIDEST)
        return found


def _stream(angle: np.ndarray, along: np.ndarray, wide: np.ndarray) -> np.ndarray:
    """Return the stream function (...), as an angle far away, at angles (...) of 0 to pi beyond the knot."""
    found: np.ndarray = angle - wide * np.sin(angle) / np.maximum(along - np.cos(angle), 1e-12)
    return found


def placed(points: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return where fibres named by points (..., 3) [m] pass in the straight bundle; x stays."""
    for knot in params.grain.knots:
        points = _Post(knot, params).round(points)
    return _wound(points, params, 1.0)


def named(points: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return the names of the fibres that pass at points (..., 3) [m] of the straight bundle: `placed`, undone."""
    points = _wound(points, params, -1.0)
    for knot in reversed(params.grain.knots):
        points = _Post(knot, params).name(points)
    return points


def crowded(points: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return the section (...) of fibres named by points (..., 3) over that far from knots."""
    found = np.ones(points.shape[:-1])
    for knot in params.grain.knots:
        post = _Post(knot, params)
        points = post.round(points)
        found *= post.crowding(points)
    return found
