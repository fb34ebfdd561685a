"""The order at which roughness converges with the mesh, of the runs of `benchmarks.dehydration.meshes`.

Means over seeds are fitted, all stages of a fruit together, by r(n) = r (1 + c n^-p): r and c for each stage, one p.
Its error is that of fits with one seed left out of all meshes (jackknife).
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.figures import Row, markdown

from ..meshes import STAGES

__all__ = ["Order", "order", "table"]

#: Orders that are tried.
_TRIED = np.arange(0.3, 5.01, 0.01)


class Order(NamedTuple):
    """The observed order, its standard error, and what is left at n without limit, by stage."""

    value: float
    error: float
    limit: tuple[float, ...]


def order(means: Sequence[tuple[int, Sequence[Sequence[float]]]]) -> Order:
    """Return the order of meshes (n, for each seed the values by stage).

    Raises:
        ValueError: there are fewer than three meshes, or one of fewer than two seeds.

    """
    seeds = min(len(runs) for _, runs in means)
    if len(means) < 3 or seeds < 2:
        raise ValueError("an order and its error take three meshes, each of two seeds or more")
    counts = np.array([n for n, _ in means], float)
    values = np.array([runs[:seeds] for _, runs in means])  # (mesh, seed, stage)
    best, limit = _fit(counts, values.mean(axis=1))
    left = [_fit(counts, np.delete(values, k, axis=1).mean(axis=1))[0] for k in range(seeds)]
    error = math.sqrt((seeds - 1) / seeds * sum((one - statistics.mean(left)) ** 2 for one in left))
    return Order(best, error, tuple(limit.tolist()))


def _fit(counts: np.ndarray, values: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the order that leaves least of values (mesh, stage), relative, and the limits by stage."""
    found = []
    for p in _TRIED:
        columns = np.stack([np.ones_like(counts), counts**-p], axis=1)
        solution, *_ = np.linalg.lstsq(columns, values, rcond=None)
        left = (columns @ solution - values) / values.mean(axis=0)
        found.append((float(np.square(left).sum()), float(p), solution[0]))
    _, best, limit = min(found, key=lambda one: one[0])
    return best, limit


def table(record: Row) -> str:
    """Return the meshes of each fruit with several seeds: means over them against the finest mesh's, and the order."""
    rows = [
        row for row in record["runs"] if row["version"] == record["version"] and "roughness" in row and "seed" in row
    ]
    lines = []
    for te, gamma in sorted({(row["te"], row["gamma"]) for row in rows}, key=lambda fruit: (-fruit[0], fruit[1])):
        same = [row for row in rows if (row["te"], row["gamma"]) == (te, gamma)]
        meshes = [(n, [row for row in same if row["n"] == n]) for n in sorted({row["n"] for row in same})]
        meshes = [(n, runs) for n, runs in meshes if len(runs) > 1]
        if len(meshes) < 3:
            continue
        found = order([(n, [run["roughness"] for run in runs]) for n, runs in meshes])
        finest = np.mean([run["roughness"] for run in meshes[-1][1]], axis=0)
        for n, runs in meshes:
            values = np.array([run["roughness"] for run in runs])
            off = values.mean(axis=0) / finest - 1
            lines.append([
                f"{te:g}", f"{gamma:g}", str(n), f"{runs[0]['elements']:,}", str(len(runs)),
                " ".join(f"{value:.4f}".removeprefix("0") for value in values.mean(axis=0)),
                "" if n == meshes[-1][0] else " ".join(f"{100 * one:+.0f}" for one in off) + " %",
                f"{100 * (values.std(axis=0, ddof=1) / values.mean(axis=0)).max():.0f} %",
                f"{statistics.mean(run['cpu'] for run in runs):.0f}", "",
            ])  # fmt: skip
        limit = " ".join(f"{value:.4f}".removeprefix("0") for value in found.limit)
        said = f"{found.value:.1f} +- {found.error:.1f}"
        if not _TRIED[0] < found.value < _TRIED[-1]:
            limit, said = "", "none fits"
        lines.append([f"{te:g}", f"{gamma:g}", "limit", "", "", limit, "", "", "", said])
    at = ", ".join(f"{s:g}" for s in STAGES)
    head = ("te", "gamma", "elements an edge", "elements", "seeds", f"roughness [r1] at s = {at}", "against the finest")
    return markdown((*head, "standard deviation of seeds, at most", "CPU s", "order"), lines)
