"""What a leaf's energy is on finer and finer meshes.

python -m benchmarks.growth.meshes [--vertices 1000 2500 5000 10000]

Leaves of the gallery at growth time 1 as a run hands them over: energy of stretching and bending over the rest area,
its share above or below the finest mesh's, residual, CPU seconds of one thread. One that ripples has many equilibria:
what differs from mesh to mesh is the mesh's error and which of them was found. So each is grown from two seeds of its
noise.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from pathlib import Path

from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from solver import shell
from solver.contract import Context, SolverError
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.energy import elastic
from solver.growth.settling.stage import residual

_FOLDER = Path(__file__).parents[2] / "examples" / "growth"
_LEAVES, _SEEDS = ("b-leaf", "c-leaf-wide", "c-leaf-fine"), (0, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, nargs="+", default=[1000, 2500, 5000, 10_000])
    asked = parser.parse_args()
    rows = []
    for name in _LEAVES:
        values = tomllib.loads((_FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
        for seed in _SEEDS:
            for vertices in asked.vertices:
                params = GrowthParams.parse({**values, "seed": seed})
                engine, begun = Engine(params, vertices, 1e-3, history=False), time.process_time()
                run = {"leaf": name, "seed": seed, "start": vertices}
                try:
                    state = engine.reach(1.0, Context())
                except SolverError as error:
                    rows.append(run | {"failed": f"{type(error).__name__}: {error}"})
                    continue
                material = shell.Material(params.thickness, params.poisson)
                area = float(shell.areas(state.g).sum())
                energy = float(elastic(state, material, params.bending)) / area
                rows.append(run | {"vertices": len(state.x), "energy": energy, "residual": residual(state, params),
                                   "cpu": time.process_time() - begun})  # fmt: skip
                print(rows[-1], flush=True)
    head = ("leaf, seed", "vertices", "energy over rest area [mu]", "over the finest", "residual", "CPU s")
    sheet = Sheet("growth-meshes", head, "growth")
    for row in rows:
        label = f"{row['leaf']}, {row['seed']}"
        if "failed" in row:
            sheet.add((label, str(row["start"]), row["failed"], "", "", ""), **row)
            continue
        finest = [r for r in rows if (r["leaf"], r["seed"]) == (row["leaf"], row["seed"]) and "energy" in r][-1]
        share = row["energy"] / finest["energy"] - 1
        sheet.add(
            (label, str(row["vertices"]), f"{row['energy']:.4e}", f"{100 * share:+.1f} %", f"{row['residual']:.1e}",
             f"{row['cpu']:.0f}"), **row, off=share)  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    with threadpool_limits(1, user_api="blas"):
        main()
