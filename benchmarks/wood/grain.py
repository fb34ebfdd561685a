"""Sticks whose grain slopes, against an orthotropic beam: python -m benchmarks.wood.grain.

Sticks are sawn out of wood that winds about a pith 1 m away, so that all fibres have one slope, and run out of it. A
dead load bends them; what the linear equations of rest make of it is held against Timoshenko's beam with the modulus
of oblique fibres, 1 / E_x = c^4 / E_L + s^4 / E_T + s^2 c^2 / G (Lekhnitskii; rods do not shrink across when they are
drawn out, so that Poisson's ratio is 0), and against Hankinson's formula with the exponent 2.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from scipy.sparse.linalg import spsolve

from benchmarks.figures import Sheet
from solver.wood import SOLVER, WoodParams
from solver.wood.fibres.hewing import hewn
from solver.wood.forces.hessian import Stiffness
from solver.wood.model.bundle import lay

_E, _T, _G, _LENGTH, _RADIUS = 10e9, 0.5e9, 0.7e9, 0.3, 0.01
_AREA, _SECOND, _KAPPA = np.pi * _RADIUS**2, np.pi * _RADIUS**4 / 4, 0.9
_PLAIN: dict[str, Any] = {"fracture": "none", "length": _LENGTH, "radius": _RADIUS}


def oblique(slope: float) -> float:
    """Return the modulus [Pa] along an axis from which fibres lean by `slope` [radian]."""
    c, s = np.cos(slope) ** 2, np.sin(slope) ** 2
    return float(1 / (c * c / _E + s * s / _T + s * c / _G))


def hankinson(slope: float) -> float:
    """Return the modulus [Pa] by Hankinson's formula with the exponent 2."""
    return float(_E * _T / (_E * np.sin(slope) ** 2 + _T * np.cos(slope) ** 2))


def expected(modulus: float) -> float:
    """Return the tip's deflection [m/N] of Timoshenko's beam."""
    return float(_LENGTH**3 / (3 * modulus * _SECOND) + _LENGTH / (_KAPPA * _G * _AREA))


def sag(params: WoodParams, vertices: int) -> float:
    """Return the deflection [m/N] of the tip under a small dead load on it, by the linear equations of rest."""
    wood = hewn(lay(params, vertices), params)
    m, free = wood.motion, wood.motion.held == 0
    # that rods resist twist, too, and are bent at rest is left out: it is theirs alone, and small beside the bundle's
    k = Stiffness(m.x, wood.rods, wood.bonds, free).matrix(m.x, wood.rods, wood.bonds).tocsc()
    moved = spsolve(k, m.load[free].ravel()).reshape(-1, 3)[:, 2]
    load = m.load[free, 2]
    return float(load @ moved / load.sum() ** 2)


def slopes(degrees: list[float], meshes: list[tuple[int, int]]) -> None:
    """Print a row for every mesh, slope and plane, and keep all."""
    sheet = Sheet(
        "wood-grain",
        ("slope", "in", "rods", "vertices", "stiffness over straight grain's", "oblique fibres", "over it",
         "Hankinson", "CPU s"),
        "wood",
    )  # fmt: skip
    for count, vertices in meshes:
        straight = 0.0
        for degree in [0.0, *degrees]:
            for plane, pith in (("the plane of bending", (1.0, 0.0)), ("the other", (0.0, 1.0)))[: 1 + (degree > 0)]:
                begun = time.process_time()
                slope = np.radians(degree)
                grain = {"strength": 0.0, "spiral": float(np.tan(slope)), "pith": pith}
                params = SOLVER.parse({**_PLAIN, "rods": count, "tip_load": (0.0, 0.0, -1.0), "grain": grain})
                assert isinstance(params, WoodParams)
                found = sag(params, vertices)
                straight = straight or found
                ratio = straight / found
                beam, other = (expected(_E) / expected(of(slope)) for of in (oblique, hankinson))
                took = time.process_time() - begun
                sheet.add(
                    (f"{degree:g}", plane if degree else "", count, vertices, f"{ratio:.3f}", f"{beam:.3f}",
                     f"{ratio / beam:.3f}", f"{other:.3f}", f"{took:.0f}"),
                    degrees=degree, pith=pith, rods=count, vertices=vertices, sag=found, ratio=ratio, beam=beam,
                    over_straight_beam=expected(_E) / found, hankinson=other, cpu_s=took,
                )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--degrees", type=float, nargs="+", default=[5, 10])
    parser.add_argument("--meshes", nargs="+", default=["40x31", "40x61", "40x121", "160x61"], help="rods x vertices")
    words = parser.parse_args()
    slopes(words.degrees, [(int(a), int(b)) for a, b in (m.split("x") for m in words.meshes)])
