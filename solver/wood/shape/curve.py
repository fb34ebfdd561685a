"""An axis through given points in space, and the sections square to it.

A cubic spline through the points by the length of their chords, its ends not-a-knot: so a circle by points is a circle
to the fourth order up to its ends. It is measured by its arc length, and goes straight on beyond its ends. Sections do
not spin about it: their axes are carried along by double reflection (Wang, Juettler, Zheng and Liu 2008), from one that
lies as near to y as the start allows, or to z where the axis begins along y.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

__all__ = ["Curve"]

#: Pieces of a segment between two points, by which arc length and frames are known.
_PIECES = 128
#: Places by which it is looked for whether the axis meets itself, and where on it a body is.
_PLACES = 513
#: Gauss' points and weights on 0 to 1.
_AT, _WEIGHT = (values / 2 for values in np.polynomial.legendre.leggauss(5))
_AT = _AT + 0.5


class Curve:
    """The spline, by its arc length s [m]."""

    def __init__(self, points: Sequence[Sequence[float]]) -> None:
        """Take points (n, 3) [m] in order, at least two, no two neighbours the same."""
        self._points = np.array(points, float)
        step = np.linalg.norm(np.diff(self._points, axis=0), axis=1)
        self._u = np.concatenate([[0.0], np.cumsum(step)])
        self._m = _slopes(self._points, step)
        fine = np.concatenate([np.linspace(a, b, _PIECES, endpoint=False) for a, b in pairwise(self._u)])
        self._fine = np.append(fine, self._u[-1])
        part = np.diff(self._fine)
        speed = np.linalg.norm(self._way(self._fine[:-1, None] + part[:, None] * _AT), axis=-1)
        self._s = np.concatenate([[0.0], np.cumsum(part * (speed @ _WEIGHT))])
        self.length = float(self._s[-1])
        self._frame = self._carried()

    def _local(self, u: np.ndarray) -> tuple[np.ndarray, ...]:
        n = np.clip(np.searchsorted(self._u, u, side="right") - 1, 0, len(self._u) - 2)
        h = self._u[n + 1] - self._u[n]
        return n, h, (u - self._u[n]) / h

    def _place(self, u: np.ndarray) -> np.ndarray:
        n, h, v = self._local(u)
        v, h = v[..., None], h[..., None]
        a, b = self._points[n], self._points[n + 1]
        out = (1 + 2 * v) * (1 - v) ** 2 * a + v * v * (3 - 2 * v) * b
        found: np.ndarray = out + h * v * (1 - v) * ((1 - v) * self._m[n] - v * self._m[n + 1])
        return found

    def _way(self, u: np.ndarray) -> np.ndarray:
        n, h, v = self._local(u)
        v, h = v[..., None], h[..., None]
        chord = (self._points[n + 1] - self._points[n]) / h
        found: np.ndarray = (
            6 * v * (1 - v) * chord + (1 - v) * (1 - 3 * v) * self._m[n] + v * (3 * v - 2) * self._m[n + 1]
        )
        return found

    def _at(self, s: np.ndarray) -> np.ndarray:
        """Return the parameters (...) at arc lengths within the curve, by Newton from the straight line between two."""
        s = np.clip(s, 0.0, self.length)
        u: np.ndarray = np.interp(s, self._s, self._fine)
        n = np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, len(self._s) - 2)
        for _ in range(3):
            way = u - self._fine[n]
            speed = np.linalg.norm(self._way(self._fine[n][..., None] + way[..., None] * _AT), axis=-1)
            u = u - (self._s[n] + way * (speed @ _WEIGHT) - s) / np.linalg.norm(self._way(u), axis=-1)
        return u

    def _carried(self) -> np.ndarray:
        x, t = self._place(self._fine), _unit(self._way(self._fine))
        first = np.array([0.0, 1.0, 0.0]) if abs(t[0, 1]) < 0.9 else np.array([0.0, 0.0, 1.0])
        found = [_unit(first - (first @ t[0]) * t[0])]
        for n in range(len(x) - 1):
            found.append(_reflected(x[n], t[n], found[-1], x[n + 1], t[n + 1]))
        return np.array(found)

    def frame(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return place [m], tangent and both axes of the section (..., 3) at arc lengths s (...) [m]."""
        u = self._at(s)
        place, tangent = self._place(u), _unit(self._way(u))
        n = np.clip(np.searchsorted(self._fine, u, side="right") - 1, 0, len(self._fine) - 2)
        near = self._fine[n]
        first = _reflected(self._place(near), _unit(self._way(near)), self._frame[n], place, tangent)
        first = _unit(first - (first * tangent).sum(-1, keepdims=True) * tangent)
        place = place + (s - np.clip(s, 0.0, self.length))[..., None] * tangent
        return place, tangent, first, np.cross(tangent, first)

    def laid(self, straight: np.ndarray) -> np.ndarray:
        """Return points (..., 3) [m] of the straight bundle where the curve takes them."""
        place, _, first, second = self.frame(straight[..., 0])
        found: np.ndarray = place + straight[..., 1, None] * first + straight[..., 2, None] * second
        return found

    def sharpest(self) -> float:
        """Return the largest curvature [1/m]."""
        t, s = _unit(self._way(self._fine)), self._s
        return float((np.linalg.norm(np.diff(t, axis=0), axis=1) / np.diff(s)).max())

    def closest(self, width: float) -> float:
        """Return how near [m] the axis comes to itself, where it has turned back; `width` [m] of the bundle."""
        s = np.linspace(0, self.length, _PLACES)
        x = self._place(self._at(s))
        apart = np.linalg.norm(x[:, None] - x[None], axis=-1)
        far = np.abs(s[:, None] - s[None]) > np.pi / 2 * width
        return float(apart[far].min()) if far.any() else np.inf

    def nearest(self, point: Sequence[float]) -> float:
        """Return the arc length [m] of the place that is nearest to a point (3,) [m]."""
        s = np.linspace(0, self.length, _PLACES)
        return float(s[np.linalg.norm(self._place(self._at(s)) - np.array(point), axis=-1).argmin()])


def _unit(a: np.ndarray) -> np.ndarray:
    found: np.ndarray = a / np.linalg.norm(a, axis=-1, keepdims=True)
    return found


def _reflected(x: np.ndarray, t: np.ndarray, r: np.ndarray, y: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return the axis r (..., 3) of the section at x with the tangent t, carried to y with the tangent w."""
    v = y - x
    c = np.maximum((v * v).sum(-1, keepdims=True), 1e-300)
    left_r = r - 2 / c * (v * r).sum(-1, keepdims=True) * v
    left_t = t - 2 / c * (v * t).sum(-1, keepdims=True) * v
    v = w - left_t
    c = (v * v).sum(-1, keepdims=True)
    found: np.ndarray = left_r - 2 / np.maximum(c, 1e-300) * (v * left_r).sum(-1, keepdims=True) * v
    return found


def _slopes(points: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return the spline's slopes (n, 3) at its points, steps (n - 1,) [m] apart."""
    count, chord = len(points), np.diff(points, axis=0) / step[:, None]
    if count == 2:
        return np.repeat(chord, 2, 0)
    if count == 3:
        # one parabola through all
        middle = (step[1] * chord[0] + step[0] * chord[1]) / step.sum()
        return np.stack([2 * chord[0] - middle, middle, 2 * chord[1] - middle])
    a, b = np.zeros((count, count)), np.zeros((count, 3))
    for n in range(1, count - 1):
        p, q = 1 / step[n - 1], 1 / step[n]
        a[n, n - 1 : n + 2] = p, 2 * (p + q), q
        b[n] = 3 * (p * chord[n - 1] + q * chord[n])
    for row, (n, m) in ((0, (0, 1)), (count - 1, (count - 2, count - 3))):
        # the third derivative goes on through the points beside the ends
        p, q = 1 / step[n] ** 2, 1 / step[m] ** 2
        a[row, n : n + 2] += p
        a[row, m : m + 2] -= q
        b[row] = 2 * (p * chord[n] - q * chord[m])
    found: np.ndarray = np.linalg.solve(a, b)
    return found
