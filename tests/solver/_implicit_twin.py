"""A plain twin of the hex27 element: the energy as a formula, its derivative by a complex step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.dehydration.implicit.assembly import assemble

AXIS = np.array([-1.0, 0.0, 1.0])


def lagrange(t):
    """Values of the three parabolas through -1, 0, 1 by Lagrange's formula."""
    return [np.prod([(t - b) / (a - b) for b in AXIS if b != a]) for a in AXIS]


def slopes(t):
    """Their slopes, by differentiating the interpolating polynomials."""
    return [np.polyval(np.polyder(np.polyfit(AXIS, a == AXIS, 2)), t) for a in AXIS]


def rule():
    at, weight = np.polynomial.legendre.leggauss(3)
    return [((a, b, c), u * v * w) for a, u in zip(at, weight, strict=True) for b, v in zip(at, weight, strict=True)
            for c, w in zip(at, weight, strict=True)]  # fmt: skip


def gradients(point):
    """dN/dxi (27, 3)."""
    values, steep = [lagrange(t) for t in point], [slopes(t) for t in point]
    return np.array([
        [steep[0][i] * values[1][j] * values[2][k], values[0][i] * steep[1][j] * values[2][k],
         values[0][i] * values[1][j] * steep[2][k]]
        for i in range(3) for j in range(3) for k in range(3)
    ])  # fmt: skip


@dataclass
class Block:
    """Elements on their own, for sweeping."""

    positions: Any
    connectivity: Any
    mu: Any
    kappa: Any

    def sweep(self, deformed, stretch, rng=None):
        self.deformed = deformed
        swept = assemble(self.positions, self.connectivity, deformed, stretch, self.mu, self.kappa)
        return Swept(swept.energy, swept.force, deformed, swept.pressure)


@dataclass
class Swept:
    energy: float
    force: Any
    deformed: Any
    pressure: Any


def block(rng, count=2, distort=0.06, kappa=50.0):
    """A box of count^3 distorted, curved elements."""
    m = 2 * count + 1
    grid = np.stack(np.meshgrid(*[np.arange(m) / 2.0] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(m**3).reshape(m, m, m)
    cells = [number[2 * i : 2 * i + 3, 2 * j : 2 * j + 3, 2 * k : 2 * k + 3].ravel()
             for i in range(count) for j in range(count) for k in range(count)]  # fmt: skip
    positions = grid + distort * rng.normal(size=grid.shape)
    ones = np.ones(len(cells))
    return Block(positions, np.array(cells), 1.3 * ones, kappa * ones)


def twin_energy(case, deformed, stretch):
    total = 0.0
    for e, nodes in enumerate(case.connectivity):
        fresh, moved = case.positions[nodes], deformed[nodes]
        mass, defect = np.zeros((8, 8)), np.zeros(8, dtype=moved.dtype)
        for (point, weight), d in zip(rule(), stretch[e], strict=True):
            local = gradients(point)
            jacobian = fresh.T @ local
            w = weight * np.linalg.det(jacobian)
            x, y, z = point
            phi = np.array([1, x, y, z, x * y, y * z, x * z, x * y * z])
            elastic = moved.T @ local @ np.linalg.inv(jacobian) @ np.diag(1 / d)
            jd, je = np.prod(d), np.linalg.det(elastic)
            total += w * jd * case.mu[e] / 2 * (je ** (-2 / 3) * np.sum(elastic * elastic) - 3)
            mass += w * jd * np.outer(phi, phi)
            defect += w * jd * (je - 1) * phi
        total += case.kappa[e] / 2 * defect @ np.linalg.solve(mass, defect)
    return total


def twin_force(case, deformed, stretch):
    force = np.zeros(deformed.shape)
    for a in range(len(deformed)):
        for i in range(3):
            moved = deformed.astype(complex)
            moved[a, i] += 1e-30j
            force[a, i] = twin_energy(case, moved, stretch).imag / 1e-30
    return force


def rotation(rng):
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return turn * np.sign(np.linalg.det(turn))
