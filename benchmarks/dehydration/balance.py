"""How far look-ups are from equilibrium, and what relaxing them costs: python -m benchmarks.dehydration.balance.

Of families in the package, at random points between their samples: from which residual, and how far, 600 steps of the
solver move what each method looks up, and how its statistics compare with what becomes of it (record
dehydration-score). Of whole fruits of the default family: the tier between table and run, with seconds by the clock and
of the processor, on as many threads as there are, after a first one (record dehydration-relaxed).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np
from numba import get_num_threads

from benchmarks.figures import Sheet
from solver import registry
from solver.geometry.crossings import crossings
from solver.lattice import closed_lattice
from store.blending import methods
from store.lookup import ShapeTable
from store.starter import ROOT
from sweeps.refining import balance
from sweeps.relaxing import relaxed

_METHODS = {methods.DEFAULT: "default", "nearest": "nearest", "idw": "the paper's, `idw`"}
_SCORE = (
    *("family", "method", "s", "residual, looked up", "after 600 steps", "moved", "roughness"),
    *("bands [dB]", "slopes W1 [degree]", "correlation"),
)
_RELAXED = (
    *("te", "gamma", "s", "residual", "steps", "moved", "correlation", "crossing pairs"),
    *("volume over exact, looked up", "relaxed", "seconds", "processor seconds"),
)
#: te, gamma and s of fruits that are relaxed to the end.
_FRUITS = (
    *((0.0375, 22.0, 0.2), (0.0375, 22.0, 0.3), (0.0325, 13.0, 0.2), (0.0325, 13.0, 0.3)),
    *((0.03, 10.0, 0.3), (0.04, 50.0, 0.3)),
)
_LATTICE = 64


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--families", nargs="+", default=["default", "stone-radius", "prolate", "plum2"])
    parser.add_argument("--stages", nargs="+", type=float, default=[0.1, 0.2, 0.3])
    parser.add_argument("--points", type=int, default=3, help="of each family")
    parser.add_argument("--tier", action="store_true", help="the tier between table and run alone")
    asked = parser.parse_args()
    _tier()
    if not asked.tier:
        _score(asked.families, asked.stages, asked.points)


def _score(families: Sequence[str], stages: Sequence[float], count: int) -> None:
    solver, sheet = registry.get("dehydration"), Sheet("dehydration-score", _SCORE, "dehydration")
    digests = {}
    for name in families:
        table = ShapeTable.open(ROOT, name, surfaces=registry.surface)
        digests[name], points = table.digest, balance.between(table, count)
        for stage in stages:
            for method, said in _METHODS.items():
                rows = [row for p in points if (row := balance.distance(solver, table, p, stage, method)) is not None]
                m = balance.mean(rows)
                residuals = f"{m.residual_placed:.2f}", f"{m.residual:.1e}"
                alike = f"{m.rgh:.3f}", f"{m.dB:.2f}", f"{m.W1:.2f}", f"{m.corr:.2f}"
                sheet.add(
                    (name, said, f"{stage:g}", *residuals, f"{m.moved:.2f}", *alike),
                    family=name, points=points, failed=count - len(rows), each=[row.to_json() for row in rows],
                )  # fmt: skip
    sheet.keep(digests=digests, steps=balance.STEPS)


def _tier() -> None:
    table, solver = ShapeTable.open(ROOT, surfaces=registry.surface), registry.get("dehydration")
    sheet = Sheet("dehydration-relaxed", _RELAXED, "dehydration")
    relaxed(solver, table, table.at({"te": 0.04, "gamma": 10.0}, 0.1, resolution=_LATTICE))  # compiles
    for te, gamma, s in _FRUITS:
        shape = table.at({"te": te, "gamma": gamma}, s, resolution=_LATTICE)
        clock, begin = time.perf_counter(), time.process_time()
        found, said = relaxed(solver, table, shape)
        seconds, cpu = time.perf_counter() - clock, time.process_time() - begin
        ends = [np.concatenate([one.position.reshape(-1, 3), one.poles]).astype(float) for one in (shape, found)]  # type: ignore[union-attr,list-item]
        pairs = crossings(ends[1], closed_lattice(_LATTICE)).count
        radii = [np.linalg.norm(one[:-2], axis=1) for one in ends]
        alike = float(np.corrcoef(radii)[0, 1])
        volumes = [_volume(one) / _exact(table, te, s) for one in ends]
        sheet.add(
            (
                *(f"{te:g}", f"{gamma:g}", f"{s:g}", f"{said['residual']:.1e}", f"{said['iterations']:.0f}"),
                *(f"{said['moved']:.2f}", f"{alike:.2f}", pairs, *(f"{v:.3f}" for v in volumes)),
                *(f"{seconds:.2f}", f"{cpu:.2f}"),
            ),
            te=te, gamma=gamma, s=s, **said, corr=alike, pairs=pairs, volumes=volumes, cpu=cpu, clock=seconds,
            threads=get_num_threads(), converged=found.converged,
        )  # fmt: skip
    sheet.keep(digest=table.digest)


def _volume(points: np.ndarray) -> float:
    """Return the volume within a closed lattice of points (n 2n + 2, 3)."""
    a, b, c = (points[closed_lattice(_LATTICE)[:, k]] for k in range(3))
    return abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6


def _exact(table: ShapeTable, te: float, s: float) -> float:
    """Return the volume of an incompressible sphere at s: only its flesh shrinks, neither skin nor stone."""
    stone = float(table.fixed["rs1"]) ** 3
    return 4 / 3 * np.pi * ((1 - s) ** 3 * (1 - stone) + stone + (1 + te) ** 3 - 1)


if __name__ == "__main__":
    main()
