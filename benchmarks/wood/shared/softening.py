"""End-notched flexure by beam theory with an interface that softens: what a process zone does to the load curve.

Two beams of height h and width b, one on the other, bent alike. With the moment M and the shear force V of both, N the
axial force in one and s the slip of the faces: s' = 6 M / (E b h^2) - 8 N / (E b h), N' = -b t(s), where t, the shear
stress, grows with s to the strength and falls evenly to 0 where its area is the toughness. Where linear fracture
mechanics has a crack's tip, this has a zone of some (E G h)^(1/2) / strength, by which the load falls short of its.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp

__all__ = ["Flexure"]

#: Slips of the crack's tip at which loads are found: to the strength, and over the largest beyond it.
_ELASTIC, _SOFT, _LAST = 12, 60, 3.0


@dataclass(frozen=True)
class Flexure:
    """A beam of two halves h high, b wide, on supports 2 S apart [m]; moduli, strength [Pa]; toughness [J/m2].

    more [m]: by how much longer than it is a crack counts; the interface before the strength is as stiff as it says.
    """

    high: float
    wide: float
    half: float
    along: float
    shear: float
    strength: float
    toughness: float
    more: float

    def curve(self, crack: float) -> tuple[np.ndarray, np.ndarray]:
        """Return deflections [m] and forces [N] from 0 on, of a crack from one support [m]. They may turn back."""
        h, b, s = self.high, self.wide, self.half
        last = 2 * self.toughness / self.strength
        stiff = self.along * h / (8 * self.more**2)
        first = self.strength / stiff

        def stress(slip: np.ndarray) -> np.ndarray:
            soft = np.maximum(self.strength * (last - np.abs(slip)) / (last - first), 0.0)
            found: np.ndarray = np.sign(slip) * np.minimum(stiff * np.abs(slip), soft)
            return found

        def moment(x: np.ndarray) -> np.ndarray:
            found: np.ndarray = np.minimum(x, 2 * s - x) / 2
            return found

        def slopes(x: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
            slip = (6 * p[0] * moment(x) / h - 8 * y[1]) / (self.along * b * h)
            return np.stack([slip, -b * stress(y[0])])

        def ends(left: np.ndarray, right: np.ndarray, _: np.ndarray) -> np.ndarray:
            return np.array([left[0] + tip, left[1], right[1]])

        # rounded, or places that differ by their last digit would be apart
        x = np.unique(np.round(np.concatenate([np.linspace(crack, 2 * s, 161), np.linspace(crack, s, 121)]), 9))
        y, p = np.zeros((2, len(x))), np.ones(1)
        fine, tip, found = np.linspace(0, 2 * s, 4001), 0.0, [(0.0, 0.0)]
        for tip in (*np.linspace(0, first, _ELASTIC)[1:], *np.geomspace(first, _LAST * last, _SOFT)[1:]):
            done = solve_bvp(slopes, ends, x, y, p=p, tol=1e-3, max_nodes=20_000)
            if not done.success:
                raise RuntimeError(f"no state with a slip of {tip:.3g} m: {done.message}")
            x, y, p = done.x, done.y, np.asarray(done.p)
            force = np.where(fine < crack, 0.0, np.interp(fine, x, y[1]))
            bent = (p[0] * moment(fine) - force * h) / (self.along * b * h**3 / 6)
            sag = np.trapezoid(bent * moment(fine), fine) + 3 * p[0] * s / (10 * self.shear * b * h)
            found.append((float(sag), float(p[0])))
        d, q = np.array(found).T
        return d, q
