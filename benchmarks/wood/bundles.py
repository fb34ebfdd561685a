"""Bundles against Timoshenko's beam, over slenderness, rods, unevenness and quality: python -m benchmarks.wood.bundles.

A bundle is clamped at one end and loaded at the other. Stiffness: the beam's tip deflection over the bundle's, under a
load that bends it by a thousandth of the length over a third. Frequency: the bundle's first over the beam's, by the
linear equations of rest. Torsion: the moment that turns its end, over that of Saint-Venant's bar; and over that of a
bar which is shorter by sqrt(E I / G A) of a rod, over which the clamp, which holds the rods' directions, keeps them
from turning.
"""

from __future__ import annotations

import argparse
import itertools
import time
from typing import Any, get_args

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.sparse.linalg import eigsh, splu

from benchmarks.figures import Sheet
from solver.contract import Need, Quality
from solver.wood import SOLVER, WoodParams
from solver.wood.forces.hessian import Stiffness
from solver.wood.model.bundle import lay
from solver.wood.settings import choose

_E, _G, _RHO, _RADIUS = 10e9, 0.7e9, 600.0, 0.01
_AREA, _SECOND = np.pi * _RADIUS**2, np.pi * _RADIUS**4 / 4
#: Shear coefficient of a round section.
_KAPPA = 0.9
_PLAIN: dict[str, Any] = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}, "radius": _RADIUS}


def beam_sag(length: float, load: float) -> float:
    """Return the tip deflection [m] of the beam under `load` [N]."""
    return load * (length**3 / (3 * _E * _SECOND) + length / (_KAPPA * _G * _AREA))


def beam_frequency(length: float) -> float:
    """Return the beam's first frequency [1/s], clamped and free: where the equations at the free end are singular."""

    def free(w: float) -> float:
        # deflection, turning, its slope, shear angle
        a = np.zeros((4, 4))
        a[0, 1] = a[0, 3] = a[1, 2] = 1
        a[2, 1], a[2, 3] = -_RHO * w**2 / _E, -_KAPPA * _G * _AREA / (_E * _SECOND)
        a[3, 0] = -_RHO * w**2 / (_KAPPA * _G)
        return float(np.linalg.det(expm(a * length)[2:, 2:]))

    slender = 1.8751040687**2 / length**2 * np.sqrt(_E * _SECOND / (_RHO * _AREA))
    return float(brentq(free, 0.7 * slender, 1.02 * slender))


def stiffness(length: float, quality: Quality, **values: Any) -> float:
    """Return the bundle's stiffness over the beam's, by a run."""
    load = 1e-3 * _E * _SECOND / length**2
    params = SOLVER.parse({**_PLAIN, "length": length, "mode": "static", "tip_load": (0, 0, -load), **values})
    found = SOLVER.solve(params, Need(stages=(1.0,), quality=quality, fields=("tip_position",)))
    # without load the rods' centroid is on the axis
    return beam_sag(length, load) / -float(found.tip_position.values[0, 2])


def frequency(length: float, quality: Quality, **values: Any) -> float:
    """Return the bundle's first frequency over the beam's."""
    params = SOLVER.parse({**_PLAIN, "length": length, **values})
    assert isinstance(params, WoodParams)
    wood = lay(params, choose(params, quality).vertices)
    m, free = wood.motion, wood.motion.held == 0
    k = Stiffness(m.x, wood.rods, wood.bonds, free).matrix(m.x, wood.rods, wood.bonds).tocsc()
    root = 1 / np.sqrt(np.repeat(m.mass[free], 3))
    scaled = k.multiply(root[:, None]).multiply(root).tocsc()
    lowest = eigsh(scaled, 2, sigma=0, v0=np.ones(len(root)), return_eigenvectors=False)
    return float(np.sqrt(lowest.min())) / beam_frequency(length)


def layer(rods: int) -> float:
    """Return the length [m] over which a clamp keeps rods from turning where the bundle is sheared."""
    return float(np.sqrt(_E / (4 * np.pi * _G) * _AREA / rods))


def moment(params: WoodParams, vertices: int) -> float:
    """Return the moment [N m] that turns the end of a clamped bundle by 1; its rods' ends may move along."""
    wood = lay(params, vertices)
    m, free = wood.motion, wood.motion.held == 0
    k = Stiffness(m.x, wood.rods, wood.bonds, free).matrix(m.x, wood.rods, wood.bonds).tocsc()
    number = np.full((len(m.x), 3), -1)
    number[free] = np.arange(3 * free.sum()).reshape(-1, 3)
    ends = wood.grid[:, -1]
    turned, moved = number[ends, 1:].ravel(), np.zeros(k.shape[0])
    moved[turned] = np.column_stack([-m.x[ends, 2], m.x[ends, 1]]).ravel()
    rest = np.setdiff1d(np.arange(k.shape[0]), turned)
    moved[rest] = splu(k[rest][:, rest].tocsc()).solve(-(k @ moved)[rest])
    return float(moved @ (k @ moved))


def torsion(length: float, quality: Quality, **values: Any) -> float:
    """Return the bundle's stiffness in torsion over the bar's, G J / L."""
    params = SOLVER.parse({**_PLAIN, "length": length, **values})
    assert isinstance(params, WoodParams)
    return moment(params, choose(params, quality).vertices) * length / (_G * 2 * _SECOND)


def main(slenders: list[float], counts: list[int], seeds: list[int], most: int) -> None:
    """Print a row for each bundle and keep all runs; fine runs and frequencies of no more than `most` rods."""
    qualities = get_args(Quality)
    sheet = Sheet(
        "wood-bundles",
        (
            "L/R",
            "rods",
            "unevenness",
            *(f"stiffness over the beam's: {q}" for q in qualities),
            "first frequency: preview",
            "torsion: default",
            "less the clamp's layer",
        ),
        "wood",
    )
    for slender, rods, unevenness, seed in itertools.product(slenders, counts, (0.0, 0.3), seeds):
        values, length, begun = (
            {"rods": rods, "unevenness": unevenness, "seed": seed},
            slender * _RADIUS,
            time.process_time(),
        )
        asked = [q for q in qualities if rods <= most or q != "fine"]
        found = {q: stiffness(length, q, **values) for q in asked}
        swing = frequency(length, "preview", **values) if rods <= most else None
        twist = torsion(length, "default", **values) if rods <= most else None
        inner = twist * (1 - layer(rods) / length) if twist else None
        cells = [f"{found[q]:.3f}" if q in found else "" for q in qualities]
        sheet.add(
            (f"{slender:g}", rods, unevenness, *cells, *(f"{v:.3f}" if v else "" for v in (swing, twist, inner))),
            slender=slender, seed=seed, rods=rods, unevenness=unevenness, stiffness=found, frequency=swing,
            torsion=twist, torsion_inner=inner,
            cpu_s=time.process_time() - begun,
        )  # fmt: skip
    off = [
        abs(v - 1)
        for run in sheet.runs
        for v in (*run["stiffness"].values(), run["frequency"] or 1.0, run["torsion_inner"] or 1.0)
    ]
    print(f"worst: {100 * max(off):.2f} %")
    sheet.keep(worst=max(off))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slender", type=float, nargs="+", default=[10, 20, 40, 70, 100])
    parser.add_argument("--rods", type=int, nargs="+", default=[20, 50, 100, 200])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--most", type=int, default=50, help="rods up to which fine runs and frequencies are made")
    words = parser.parse_args()
    main(words.slender, words.rods, words.seeds, words.most)
