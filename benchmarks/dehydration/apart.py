"""Shapes between the samples of the table in the package: do they cross themselves, and what does that cost?

    python -m benchmarks.dehydration.apart [--shapes 10000] [--resolution 64]

Random parameters and stages up to the last. Each shape's own count of crossing pairs, on the triangles that files hold;
every tenth shape is counted once more by `solver.geometry.crossings`, which shares nothing with what put it apart, and
its blend as it was before. Seconds of this process alone (record dehydration-apart).
"""

from __future__ import annotations

import argparse
import time
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.figures import Sheet
from solver import registry
from solver.geometry.crossings import crossings
from solver.lattice import closed_lattice
from store.lookup import ShapeTable
from store.starter import ROOT

_EDGES = (0.0, 0.1, 0.2, 0.25, 0.3)
_HEAD = ("s", "asked", "moved", "crossed before", "cross now", "moved, rms [r1]", "most [r1]", "ms", "ms without")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shapes", type=int, default=10_000)
    parser.add_argument("--resolution", type=int, default=64)
    asked = parser.parse_args()
    table = ShapeTable.open(ROOT, surfaces=registry.surface)
    rng = np.random.default_rng(0)
    te, gamma = table.info.axes["te"], np.log(table.info.axes["gamma"])
    stages = rng.uniform(0, table.reach[1], asked.shapes)
    sheet = Sheet("dehydration-apart", _HEAD, table.info.solver)
    _ask(table, {"te": te[0], "gamma": float(np.exp(gamma[0] + 0.1))}, 0.29, asked.resolution, True)  # compiles
    for low, high in pairwise(_EDGES):
        rows = []
        for i, stage in enumerate(stages[(stages > low) & (stages <= high)]):
            point = {"te": float(rng.uniform(*te)), "gamma": float(np.exp(rng.uniform(*gamma)))}
            rows.append(_ask(table, point, float(stage), asked.resolution, i % 10 == 0))
        _add(sheet, f"{low:g} to {high:g}", rows)
    sheet.keep(digest=table.digest, resolution=asked.resolution)


def _ask(table: ShapeTable, point: dict[str, float], stage: float, n: int, again: bool) -> dict[str, Any]:
    begin = time.thread_time()
    plain = table.at(point, stage, resolution=n, fields=("displacement",)).displacement
    between = time.thread_time()
    shape = table.at(point, stage, resolution=n, fields=("position", "displacement"))
    end = time.thread_time()
    assert shape.position is not None
    assert shape.displacement is not None
    assert plain is not None
    moved = np.linalg.norm(shape.displacement.astype(float) - plain, axis=-1)
    found = {"pairs": shape.crossings, "rms": float(np.sqrt((moved**2).mean())), "most": float(moved.max())}
    found |= {"seconds": end - between, "without": between - begin}
    if again:
        faces = closed_lattice(n)
        assert shape.poles is not None
        whole = np.concatenate([shape.position.reshape(-1, 3), shape.poles])
        found["counted"] = crossings(whole, faces).count
        before = whole.astype(float)
        before[:-2] -= (shape.displacement.astype(float) - plain).reshape(-1, 3)
        found["before"] = crossings(before, faces).count
        assert found["counted"] == found["pairs"]
    return found


def _add(sheet: Sheet, span: str, rows: list[dict[str, Any]]) -> None:
    moved, crossing = sum(row["most"] > 0 for row in rows), sum(row["pairs"] > 0 for row in rows)
    before = [row["before"] > 0 for row in rows if "before" in row]
    rms = float(np.sqrt(np.mean([row["rms"] ** 2 for row in rows])))
    most = max(row["most"] for row in rows)
    ms, without = (1e3 * float(np.median([row[name] for row in rows])) for name in ("seconds", "without"))
    said = f"{rms:.4f}", f"{most:.3f}", f"{ms:.1f}", f"{without:.1f}"
    sheet.add(
        (span, len(rows), moved, f"{sum(before)} of {len(before)}", crossing, *said),
        s=span, asked=len(rows), moved=moved, before=sum(before), of=len(before), crossing=crossing,
        pairs=sum(row["pairs"] for row in rows), rms=rms, most=most, ms=ms, without=without,
    )  # fmt: skip


if __name__ == "__main__":
    main()
