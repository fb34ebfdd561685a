"""Whether cracks are of the material or of the mesh: python -m benchmarks.wood.objectivity; reads wood-fracture.

What the crack grew by and the energy that this took, over the mean of the seeds on the first mesh. A saw cut ends
between vertices, so that finer meshes begin with a shorter one; where the crack ends hangs on the way alone. So it is
counted from where the first mesh's cut ends. What is off is counted from the nearest seed on. Nothing is run.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.figures import Sheet, load

from .fracture import WIDE

__all__ = ["beyond", "meshes"]

_HEAD = ("test", "rods", "vertices", "area over the first mesh's", "energy over it", "seeds are off by",
         "area off beyond seeds", "within 10 %")  # fmt: skip
_ALLOWED = 0.1


def beyond(value: float, seeds: Sequence[float]) -> float:
    """Return how far a value is from the span of the seeds, over their mean [1]."""
    return float(max(min(seeds) - value, value - max(seeds), 0.0) / np.mean(seeds))


def _past(run: Mapping[str, Any], cut: float) -> tuple[float, float]:
    """Return the area [m2] that cracked past the cut's length [m], and the energy [J] that it took."""
    area = run["area"] + WIDE * (run["cut"] - cut)
    return area, area * run["by_area"]


def meshes(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each test and mesh of the runs; a test's first mesh is the one with the most seeds."""
    found = []
    for test in dict.fromkeys(run["test"] for run in runs):
        grouped: dict[tuple[int, int], list[Mapping[str, Any]]] = {}
        for run in runs:
            if run["test"] == test:
                grouped.setdefault((run["rods"], run["vertices"]), []).append(run)
        first = max(grouped.values(), key=len)
        cut = first[0]["cut"]
        areas, works = ([_past(run, cut)[n] for run in first] for n in (0, 1))
        for (rods, vertices), own in grouped.items():
            area, work = np.mean([_past(run, cut) for run in own], axis=0).tolist()
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
