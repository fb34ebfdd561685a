"""Whole runs of an older checkout and of this one: python -m benchmarks.dehydration.precision.since BEFORE.

gamma 10, four stages to s = 0.3, on all threads, by the clock; each tree in a process of its own, which has run
something small before, and one tree after the other. What they hand over at 64 colatitudes is looked at by the plain
code of `precision.written`: which stages settled, and how many pairs of triangles pass through each other (record
dehydration-since).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

STAGES = (0.1, 0.15, 0.2, 0.3)
#: Quality, te, mirrors; of thinner skins meshes were coarser once.
CASES = (("preview", 0.04, ""), ("default", 0.04, ""), ("preview", 0.02, "xyz"), ("default", 0.02, "xyz"))
_HEAD = (
    *("run", "checkout", "elements", "steps", "seconds", "processor seconds", "over before", "stages settled"),
    *(f"crossing pairs at s = {s:g}" for s in STAGES[2:]),
)


def _work(folder: str, quality: str, te: str, mirrors: str) -> None:
    """Run one case in the tree that is imported from; print what it took, and leave its shapes in the folder."""
    from solver import registry
    from solver.contract import Context, Need

    solver = registry.get("dehydration")
    small = solver.parse({"te": 0.1, "mirrors": "xyz"}, "sphere")
    solver.solve(small, Need(stages=(0.1,), quality="preview"), Context())
    params = solver.parse({"te": float(te), "gamma": 10.0, "mirrors": mirrors}, "sphere")
    clock, processor = time.perf_counter(), time.process_time()
    found = solver.solve(params, Need(stages=STAGES, quality=quality, resolution=64), Context())
    seconds, cpu = time.perf_counter() - clock, time.process_time() - processor
    np.save(Path(folder) / "moved.npy", found["displacement"].values)
    said = {
        "seconds": seconds, "cpu": cpu, "elements": int(found.attrs["elements"]),
        "steps": int(found["iterations"].values[-1]), "converged": found["converged"].values.tolist(),
    }  # fmt: skip
    print(json.dumps(said))


def main() -> None:
    from benchmarks.figures import ROOT, Sheet
    from solver.dehydration import SOLVER, DehydrationParams
    from solver.lattice import lattice

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="a checkout of the project")
    before = parser.parse_args().before.resolve()
    told = ["git", "-C", str(before), "rev-parse", "--short=10", "HEAD"]
    commit = subprocess.run(told, capture_output=True, text=True, check=True).stdout.strip()
    sheet = Sheet("dehydration-since", _HEAD, "dehydration")
    for quality, te, mirrors in CASES:
        name = f"{quality}, te {te:g}, {'eighth' if mirrors else 'whole'}"
        first, fruit = 0.0, SOLVER.parse({"te": te, "gamma": 10.0}, "sphere")
        assert isinstance(fruit, DehydrationParams)
        fresh = fruit.surface(*lattice(64))
        for which, root in ((commit, before), ("this", ROOT)):
            with tempfile.TemporaryDirectory() as folder:
                command = [sys.executable, __file__, "--work", folder, quality, str(te), mirrors]
                there = {**os.environ, "PYTHONPATH": str(root)}
                done = subprocess.run(command, cwd=root, env=there, stdout=subprocess.PIPE, text=True, check=True)
                shapes = fresh + np.load(Path(folder) / "moved.npy")
            said = json.loads(done.stdout.splitlines()[-1])
            pairs = [_pairs(shapes[STAGES.index(s)]) for s in STAGES[2:]]
            first = first or said["seconds"]
            sheet.add(
                (
                    name, which, said["elements"], said["steps"], f"{said['seconds']:.1f}", f"{said['cpu']:.1f}",
                    "" if root == before else f"{said['seconds'] / first:.2f}",
                    f"{sum(said['converged'])} of {len(STAGES)}", *pairs,
                ),
                quality=quality, te=te, mirrors=mirrors, checkout=which, pairs=pairs, **said,
            )  # fmt: skip
    sheet.keep(before=commit)


def _pairs(shape: np.ndarray) -> int:
    """Return how many pairs of triangles of a shape (n, 2n, 3), cut as files cut it, pass through each other."""
    from benchmarks.dehydration.precision.written import crossing
    from solver.lattice import closed_lattice

    points = shape.reshape(-1, 3).astype(float)
    triangles = closed_lattice(len(shape))
    # without the fans about the poles, which older results do not hold
    return sum(1 for _ in crossing(points, triangles[(triangles < len(points)).all(axis=1)]))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--work"]:
        sys.path.pop(0)  # this folder
        _work(*sys.argv[2:])
    else:
        main()
