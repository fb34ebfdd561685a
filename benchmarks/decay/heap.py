"""Seconds of a frame of a bowl of twenty oranges, and how deep one is in another, by triangles.

    python -m benchmarks.decay.heap [fruits] [day,day ...] [frames] [quality]

Hourly frames, each settled from the last look (four a day); CPU time of one thread, with compiling and laying left out.
Depths are those of the vertices handed over below the nearest triangle of every other fruit.
"""

from __future__ import annotations

import sys
import time
import tomllib
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from solver.arrays import Floats, Ints
from solver.contract import Context, Need
from solver.decay import SOLVER, DecayParams
from solver.decay.heap.run import HeapRun
from solver.decay.names import completed
from solver.decay.settings import choose
from solver.geometry.nearest import nearest

#: Where the fresh weight is.
_SHARES = ("mass", "water_lost", "juice_lost", "respired")
_BOWL = Path(__file__).resolve().parents[2] / "examples" / "decay" / "bowl.toml"


def deepest(points: Floats, faces: Ints) -> float:
    """Return how far a vertex of one surface (b, v, 3) is inside of another at most [r1]; faces (f, 3) of one."""
    low, high = points.min(axis=1), points.max(axis=1)
    worst = 0.0
    for i in range(len(points)):
        for j in range(len(points)):
            near = ((points[i] > low[j]) & (points[i] < high[j])).all(axis=1)
            if i == j or not near.any():
                continue
            some = points[i][near]
            found = nearest(some, points[j], faces)
            corners = points[j][faces[found.face]]
            a, b, c = corners.transpose(1, 0, 2)
            place = np.einsum("vk,vkc->vc", found.shares, corners)
            inside = np.einsum("vc,vc->v", some - place, np.cross(b - a, c - a)) < 0
            worst = max(worst, float(np.max(found.distance * inside)))
    return worst


def main(fruits: int = 20, days: str = "4,10", count: int = 4, quality: Any = "preview") -> None:
    head = ("frames about day", "fruits", "points", "CPU s: median", "worst", "deepest in another", "weight closed to")
    sheet = Sheet("decay-heap", head, "decay")
    values = tomllib.loads(_BOWL.read_text())
    params = SOLVER.parse({**values, "heap": {**values["heap"], "fruits": fruits}}, "orange")
    assert isinstance(params, DecayParams)
    firsts = [float(day) for day in days.split(",")]
    stages = tuple(day + k / 24 for day in firsts for k in range(count + 1))
    fields = ("mesh_position", "triangle", "rot", "mould", "mould_active", *_SHARES)
    need = completed(params, SOLVER.settle(Need(stages=stages, quality=quality, fields=fields), of=(params,)))
    heap = HeapRun(params, need, choose(params, quality))
    faces = heap.kept["triangle"][1]
    size = 10 * choose(params, quality).cells ** 2 + 2
    faces = np.asarray(faces[: 2 * size - 4], np.int64)
    rows, begun = [], time.process_time()
    for row in heap.rows(Context()):
        took = time.process_time() - begun
        points = row["mesh_position"].reshape(fruits, -1, 3).astype(float)
        closed = abs(sum(row[name] for name in _SHARES) - 1)
        rows.append((row["stage"], took, deepest(points, faces), closed))
        begun = time.process_time()
    for day in firsts:
        # the first of each has the way there in it
        here = [row for row in rows if day < row[0] < day + 1]
        seconds = [row[1] for row in here]
        deep, closed = (max(row[k] for row in here) for k in (2, 3))
        told = {"day": day, "fruits": fruits, "points": fruits * size, "quality": quality, "seed": params.seed}
        cells = f"{day:g}", fruits, fruits * size, f"{median(seconds):.2f}", f"{max(seconds):.2f}"
        sheet.add((*cells, f"{deep:.0e} r1", f"{closed:.0e}"), **told, seconds=seconds, deepest=deep, closed=closed)
    sheet.keep()


if __name__ == "__main__":
    with threadpool_limits(1, user_api="blas"):  # as a run has it
        main(*(kind(text) for kind, text in zip((int, str, int, str), sys.argv[1:], strict=False)))
