"""Whether the surfaces that a run writes pass through themselves, counted in the files by code of its own.

    python -m benchmarks.dehydration.precision.written

Each run is made by `wizen solve` and written by `wizen export` as OBJ: the finite elements' own surface, and the
lattice's. Every pair of triangles without a common corner whose boxes meet is looked at, edge against triangle (Moller
and Trumbore 1997); nothing of `solver/geometry` takes part (record dehydration-written).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from benchmarks.figures import ROOT, Sheet

#: te, gamma, quality: a thick skin that folds deeply, a stiff one, and one on coarse elements.
_CASES = ((0.04, 10, "default"), (0.04, 30, "default"), (0.03, 30, "preview"))
_STAGES = (0.2, 0.3)
#: What is written: the field that is asked for, and on which lattice.
_SURFACES = {"finite elements": ("mesh_position", 64), "64 x 128": ("position", 64), "128 x 256": ("position", 128)}
_HEAD = ("te", "gamma", "quality", "surface", "s", "triangles", "crossing pairs")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    sheet = Sheet("dehydration-written", _HEAD, "dehydration")
    for (te, gamma, quality), (surface, (field, n)) in product(_CASES, _SURFACES.items()):
        with tempfile.TemporaryDirectory() as folder:
            asked = ("--set", f"te={te}", "--set", f"gamma={gamma}", "--quality", quality)
            for s, file in zip(_STAGES, _files(Path(folder), asked, field, n), strict=True):
                points, triangles = _read(file)
                pairs = sum(1 for _ in crossing(points, triangles))
                sheet.add(
                    (f"{te:g}", gamma, quality, surface, f"{s:g}", len(triangles), pairs),
                    te=te, gamma=gamma, quality=quality, surface=surface, s=s, triangles=len(triangles), pairs=pairs,
                )  # fmt: skip
    sheet.keep()


def _files(folder: Path, asked: tuple[str, ...], field: str, n: int) -> Iterator[Path]:
    """Solve once and yield an OBJ of each stage."""
    run = folder / "run.h5"
    stages = ",".join(f"{s:g}" for s in _STAGES)
    _wizen("solve", "dehydration", *asked, "--stages", stages, "--fields", field, "--resolution", str(n), "--out", run)
    for s in _STAGES:
        file = folder / f"{s:g}.obj"
        _wizen("export", run, "--stage", f"{s:g}", "--out", file)
        yield file


def _wizen(*words: str | Path) -> None:
    command = [sys.executable, "-m", "service.cli", *map(str, words)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)


def _read(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return points (v, 3) and triangles (f, 3) of an OBJ; faces of more corners are cut into a fan."""
    points, triangles = [], []
    for line in file.read_text().splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            points.append([float(text) for text in rest[:3]])
        elif word == "f":
            a, *others = (int(text.split("/")[0]) - 1 for text in rest)
            triangles += [(a, b, c) for b, c in pairwise(others)]
    return np.array(points), np.array(triangles)


def crossing(points: np.ndarray, triangles: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield pairs of triangles that pass through each other."""
    corners = points[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(low[:, 0])
    first = low[order, 0]
    for rank, one in enumerate(order):
        others = order[rank + 1 : np.searchsorted(first, high[one, 0], side="right")]
        others = others[((low[others] <= high[one]) & (high[others] >= low[one])).all(axis=1)]
        others = others[~(triangles[others][:, :, None] == triangles[one]).any(axis=(1, 2))]
        if not len(others):
            continue
        both = corners[others], np.broadcast_to(corners[one], (len(others), 3, 3))
        for other in others[_pierces(*both) | _pierces(*both[::-1])]:
            yield int(one), int(other)


def _pierces(edges: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (m,) whether an edge of a triangle (m, 3, 3) passes through the other one."""
    found = np.zeros(len(edges), bool)
    e1, e2 = faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]
    for k in range(3):
        origin, along = edges[:, k], edges[:, (k + 1) % 3] - edges[:, k]
        h = np.cross(along, e2)
        volume = (e1 * h).sum(axis=1)
        inverse = np.divide(1.0, volume, out=np.zeros_like(volume), where=abs(volume) > 1e-14)
        o = origin - faces[:, 0]
        g = np.cross(o, e1)
        u, v, t = ((o * h).sum(1) * inverse, (along * g).sum(1) * inverse, (e2 * g).sum(1) * inverse)
        found |= (inverse != 0) & (u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < 1)
    return found


if __name__ == "__main__":
    main()
