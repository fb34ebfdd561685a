"""How a section of any outline bears shear along the grain: Saint-Venant's torsion and flexure, by boundary elements.

Fibres do not feel each other's widths here, so that Poisson's ratio is 0. Twisted by theta' the section warps by
theta' w, with w harmonic and dw/dn = z n_y - y n_z on the outline; it resists by G J, J = Ip - the integral of w dw/dn.
Bent by a force along s, fibres' stresses grow along x, by what is in proportion to s: -div grad w = s, dw/dn = 0. What
shear this costs is C, the integral of s w: the shear coefficient is I^2 / (C A), 6/7 of a disk (Cowper 1966, his
Poisson's ratio 0). With w = h - s^3/6, h is harmonic, and by Green's second identity C is an integral over the outline.
"""

from __future__ import annotations

import numpy as np

__all__ = ["sheared"]

#: Elements on an outline, about: with so many J of a square, of a triangle and of a disk is off by 1e-4, of a strip ten
#: times as wide as thick by 2 %.
_ELEMENTS = 240
#: Gauss' points and weights on an element of length 1.
_GAUSS = np.array([-0.7745966692414834, 0.0, 0.7745966692414834]) / 2, np.array([5.0, 8.0, 5.0]) / 18


class _Rim:
    """Straight elements (m,) of the outline of a section."""

    def __init__(self, outline: np.ndarray) -> None:
        way = np.roll(outline, -1, 0) - outline
        long = np.linalg.norm(way, axis=1)
        first, step = [], []
        for corner, side, count in zip(outline, way, np.ceil(_ELEMENTS * long / long.sum()).astype(int), strict=True):
            first.append(corner + side * (np.arange(count) / count)[:, None])
            step.append(np.repeat(side[None] / count, count, 0))
        self.first, self.step = np.concatenate(first), np.concatenate(step)
        self.long = np.linalg.norm(self.step, axis=1)
        self.normal = np.column_stack([self.step[:, 1], -self.step[:, 0]]) / self.long[:, None]
        self.middle = self.first + self.step / 2

    def harmonic(self, slope: np.ndarray) -> np.ndarray:
        """Return harmonic functions (m, k) on the elements whose normal derivatives are slope (m, k)."""
        along = self.step / self.long[:, None]
        to = self.first[None] - self.middle[:, None]
        low, off = (to * along).sum(-1), (to * self.normal).sum(-1)
        high = low + self.long
        # the angle that an element is seen under, and the logarithm of the distance along it, both exactly
        seen = np.arctan2(high, off) - np.arctan2(low, off)
        seen = np.where(np.abs(off) < 1e-12 * self.long, 0.0, (seen + np.pi) % (2 * np.pi) - np.pi)

        def summed(t: np.ndarray) -> np.ndarray:
            far = np.maximum(np.hypot(t, off), 1e-300)
            found: np.ndarray = t * np.log(far) - t + off * np.arctan2(t, np.where(off == 0, 1e-300, off))
            return found

        single = summed(high) - summed(low)
        # a constant is harmonic, too: its mean is asked to be 0
        matrix = seen / (2 * np.pi) - np.eye(len(slope)) / 2 + self.long / self.long.sum()
        return np.asarray(np.linalg.solve(matrix, single @ slope / (2 * np.pi)))

    def summed(self, power: int, way: np.ndarray) -> float:
        """Return the integral of s^power over the section; s is the place along the unit vector way (2,)."""
        points = self.middle[:, None] + _GAUSS[0][None, :, None] * self.step[:, None]
        inner = ((points @ way) ** (power + 1) * _GAUSS[1]).sum(1)
        return float((inner * self.long * (self.normal @ way)).sum()) / (power + 1)


def sheared(outline: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Return J [m4], and C [m6] along the unit vectors ways (k, 2), of a section: (1 + k,).

    outline (m, 2) [m] runs counter-clockwise; its centroid is the origin.
    """
    rim = _Rim(outline)
    y, z = rim.middle.T
    s, across = rim.middle @ ways.T, rim.normal @ ways.T
    slope = np.column_stack([z * rim.normal[:, 0] - y * rim.normal[:, 1], s**2 * across / 2])
    found = rim.harmonic(slope)
    polar = rim.summed(2, np.array([1.0, 0.0])) + rim.summed(2, np.array([0.0, 1.0]))
    twisted = polar - float((found[:, 0] * slope[:, 0] * rim.long).sum())
    h, slope = found[:, 1:], slope[:, 1:]
    bent = (rim.long[:, None] * (h * slope - s**3 / 6 * slope)).sum(0)
    return np.append(twisted, bent - np.array([rim.summed(4, w) for w in ways]) / 6)
