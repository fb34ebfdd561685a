"""Whether cracks are of the material or of the mesh: python -m benchmarks.wood.objectivity; reads wood-fracture.

What the crack grew by and the energy that this took, over the mean of the seeds on the first mesh. What is off is
counted from the nearest seed on. Nothing is run. All meshes begin with the same cut, or they are not compared.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.figures import Sheet, load

__all__ = ["beyond", "meshes"]

_HEAD = ("test", "rods", "vertices", "area over the first mesh's", "energy over it", "seeds are off by",
         "area off beyond seeds", "within 10 %")  # fmt: skip
_ALLOWED = 0.1
#: Cuts [m] that are the same.
_SAME = 1e-6


def beyond(value: float, seeds: Sequence[float]) -> float:
    """Return how far a value is from the span of the seeds, over their mean [1]."""
    return float(max(min(seeds) - value, value - max(seeds), 0.0) / np.mean(seeds))


def _took(runs: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float]]:
    """Return the areas [m2] that cracked and the energies [J] that this took."""
    return [run["area"] for run in runs], [run["area"] * run["by_area"] for run in runs]


def meshes(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each test and mesh of the runs; a test's first mesh is the one with the most seeds."""
    found = []
    for test in dict.fromkeys(run["test"] for run in runs):
        grouped: dict[tuple[int, int], list[Mapping[str, Any]]] = {}
        for run in runs:
            if run["test"] == test:
                grouped.setdefault((run["rods"], run["vertices"]), []).append(run)
        first = max(grouped.values(), key=len)
        if np.ptp([run["cut"] for mine in grouped.values() for run in mine]) > _SAME:
            raise ValueError(f"{test}: meshes begin with different cuts")
        areas, works = _took(first)
        for (rods, vertices), own in grouped.items():
            area, work = (float(np.mean(taken)) for taken in _took(own))
            found.append({
                "test": test, "rods": rods, "vertices": vertices, "seeds": len(own), "first": own is first,
                "area": area / float(np.mean(areas)), "energy": work / float(np.mean(works)),
                "spread": float(np.ptp(areas) / np.mean(areas) / 2),
                "missed": max(beyond(area, areas), beyond(work, works)),
            })  # fmt: skip
    return found


def main() -> None:
    """Print a row for each mesh and keep all."""
    record = load("wood-fracture")
    sheet = Sheet("wood-objectivity", _HEAD, "wood")
    for row in meshes(record["runs"]):
        verdict = "" if row["first"] else ("yes" if row["missed"] <= _ALLOWED else "no")
        sheet.add(
            (row["test"], row["rods"], row["vertices"], f"{row['area']:.3f}", f"{row['energy']:.3f}",
             f"{100 * row['spread']:.0f} %" if row["first"] else "",
             "" if row["first"] else f"{100 * row['missed']:.0f} %", verdict),
            **row,
        )  # fmt: skip
    sheet.keep(of={key: record[key] for key in ("commit", "version", "date")})


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    main()
