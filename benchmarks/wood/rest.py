"""What it would save to let fragments sleep: how much of a run's work goes into fragments that are at rest.

`python -m benchmarks.wood.rest [SLOWEST]`. A fragment is what edges, whole hinges and bonds join. It is at rest at a
stage if no vertex has been faster than SLOWEST [m/s] at this stage and the one before. Nearly all work is the bonds'
and the edges', so that their number at rest, over all, bounds what a run without them could save.
"""

from __future__ import annotations

import sys
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from benchmarks.figures import Sheet
from solver.contract import Context
from solver.wood import SOLVER, WoodParams
from solver.wood.model.bundle import lay
from solver.wood.model.state import Wood
from solver.wood.settings import choose
from solver.wood.stepping.marching import explicit
from solver.wood.stepping.stability import longest_step

__all__ = ["fragments", "resting"]

_STAGES = 40


def fragments(wood: Wood) -> np.ndarray:
    """Return the fragment (v,) that each vertex belongs to, numbered from 0."""
    rods, bonds = wood.rods, wood.bonds
    alive, on = rods.alive == 1, bonds.on == 1
    # a bond to a stub, and a hinge, join edges: their vertices are joined by the edges that are alive
    one = np.concatenate([rods.a[alive], bonds.i[on]])
    other = np.concatenate([rods.b[alive], rods.a[bonds.j[on]]])
    count = len(wood.motion.x)
    graph = sp.coo_matrix((np.ones(len(one)), (one, other)), shape=(count, count))
    found: np.ndarray = sp.csgraph.connected_components(graph, directed=False)[1]
    return found


def resting(values: dict[str, Any], until: float, slowest: float) -> dict[str, Any]:
    """Return what became of a scene: fragments at the end, those at rest, and shares of the bonds and edges."""
    params = SOLVER.parse(values)
    assert isinstance(params, WoodParams)
    settings = choose(params, "preview")
    wood, before, shares = lay(params, settings.vertices), np.zeros(0), []
    begun = time.process_time()
    times = tuple(until * n / _STAGES for n in range(1, _STAGES + 1))
    dt = settings.courant * longest_step(wood)
    for reached in explicit(wood, params, times, dt, 0.05, Context()):
        now = reached.state.wood
        of = fragments(now)
        speed = np.sqrt((now.motion.v**2).sum(1))
        # vertices that have split since were as fast as what they split from, which has a smaller number
        was = np.concatenate([before, np.zeros(len(speed) - len(before))]) if len(before) else speed + np.inf
        top = np.zeros(of.max() + 1)
        np.maximum.at(top, of, np.maximum(speed, was))
        still = top[of] < slowest
        work = np.concatenate([of[now.bonds.i[now.bonds.on == 1]], of[now.rods.a[now.rods.alive == 1]]])
        shares.append(float(still[work].mean()))
        loose = 1 - float(np.bincount(work).max() / len(work))
        before = speed
    parts = np.unique(of)
    asleep = len(np.unique(of[still]))
    return {
        "rods": len(wood.grid),
        "seed": params.seed,
        "until": until,
        "broken_rods": reached.state.rods,
        "broken_bonds": reached.state.bonds,
        "fragments": len(parts),
        "at_rest": asleep,
        "work_outside_the_largest": loose,
        "work_at_rest": shares[-1],
        "work_at_rest_mean": float(np.mean(shares)),
        "cpu": time.process_time() - begun,
    }


def main(slowest: float) -> None:
    file = Path(__file__).parents[2] / "examples" / "wood" / "splinter.toml"
    press = tomllib.loads(file.read_text()) | {"rods": 30, "vertices": 24, "seed": 1}
    floor = {"size": (1.0, 1.0, 0.02), "path": [{"time": 0, "position": (0.075, 0, -0.03)}], "friction": 0.6}
    on_floor = press | {"bodies": [*press["bodies"], floor], "damping": 200.0}
    head = ("scene", "breaks of rods, bonds", "fragments", "at rest", "work outside the largest", "work at rest")
    sheet = Sheet("wood-rest", (*head, "on the mean", "CPU s"), "wood")
    for name, values, until in (
        ("three blocks", press, 0.06),
        ("three blocks above a floor, damped four times as much", on_floor, 0.12),
    ):
        run = resting(values, until, slowest)
        shares = (run[share] for share in ("work_outside_the_largest", "work_at_rest", "work_at_rest_mean"))
        sheet.add(
            (f"{name}, {run['rods']} rods, {until:g} s", f"{run['broken_rods']}, {run['broken_bonds']}",
             run["fragments"], run["at_rest"], *(f"{100 * share:.1f} %" for share in shares), f"{run['cpu']:.0f}"),
            scene=name, **run,
        )  # fmt: skip
    sheet.keep(slowest=slowest)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 0.01)
