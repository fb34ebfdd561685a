"""Whether looked-up shapes jump as a parameter moves: python -m benchmarks.dehydration.claims.jumps.

Of each family in the package, along lines through all of its cells, by each axis at two stages and by the stage: where
a step differs most from those beside it, it is halved towards the larger half until next to nothing is left of it. What
then is left of the way of a point is a jump. Of blends alone, and of shapes as handed over, out of contact (see
`store.surfaces.apart`). Kept after each family; what the record has of a table is not done again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks import figures
from benchmarks.figures import Row, markdown
from solver import registry
from solver.arrays import Floats
from store import starter
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces.measures import lattice_for

__all__ = ["table"]

NAME = "dehydration-jumps"
#: Steps along a line; how many of them are halved, and how often.
_STEPS, _HALVED, _TIMES = 120, 3, 17
#: Stages at which parameters move: to the first folds, and where all folds.
_STAGES = (0.2, 0.3)
#: A line by the stage goes so far, and on to the end.
_EARLY = 0.2

_Shape = Callable[[float], Floats]


def main() -> None:
    """Fill in what the record lacks."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    tables = {
        n: ShapeTable.open(starter.ROOT, n, surfaces=registry.surface) for n in Store.open(starter.ROOT).table_names()
    }
    kept = figures.load(NAME)["runs"] if NAME in figures.names() else []
    about = {
        name: {"family": name, "digest": one.digest, "resolution": lattice_for(one.resolution)}
        for name, one in tables.items()
    }
    runs = {r["family"]: r for r in kept if r["family"] in about and about[r["family"]].items() <= r.items()}
    for name, one in tables.items():
        if name in runs:
            continue
        runs[name] = {**about[name], "lines": list(_lines(one))}
        figures.keep(NAME, [runs[k] for k in tables if k in runs], "dehydration", steps=_STEPS)
        print(name, file=sys.stderr, flush=True)


def _lines(table_: ShapeTable) -> Iterator[Row]:
    """Yield the largest jump along each line, of the blend and as handed over, and the median way of a step."""
    rng = np.random.default_rng(0)
    for axis, (low, high) in table_.axes.items():
        for stage in _STAGES:
            place = {name: float(rng.uniform(*span)) for name, span in table_.axes.items()}
            yield from _line(table_, place, axis, stage, low, high)
    for low, high in ((0.0, _EARLY), (_EARLY, table_.reach[1])):
        place = {name: float(rng.uniform(*span)) for name, span in table_.axes.items()}
        yield from _line(table_, place, "s", high, low, high)


def _line(
    table_: ShapeTable, place: dict[str, float], axis: str, stage: float, low: float, high: float
) -> Iterator[Row]:
    n = lattice_for(table_.resolution)
    for field in ("displacement", "position"):

        def shape(share: float, field: str = field) -> Floats:
            x = low + (high - low) * share
            asked, s = (place, x) if axis == "s" else ({**place, axis: x}, stage)
            found = table_.at(asked, s, resolution=n, fields=(field,), apart=field == "position")
            return np.asarray(found.position if field == "position" else found.displacement, np.float64)

        jump, at, step = _largest(shape)
        said = {"axis": axis, "to": stage, "place": place, "at": low + (high - low) * at}
        yield {**said, "of": "blend" if field == "displacement" else "shape", "jump": jump, "step": step}


def _largest(shape: _Shape) -> tuple[float, float, float]:
    """Return the largest jump [r1] of a point on the way from 0 to 1, where it is, and the median step's way."""
    shares = np.linspace(0, 1, _STEPS + 1)
    points = np.stack([shape(float(share)) for share in shares])
    steps = np.diff(points, axis=0)
    beside = np.concatenate([steps[1:2], (steps[:-2] + steps[2:]) / 2, steps[-2:-1]])
    odd = np.linalg.norm(steps - beside, axis=-1).max(axis=(1, 2))
    found = [_halved(shape, *shares[k : k + 2], *points[k : k + 2]) for k in np.argsort(odd)[: -_HALVED - 1 : -1]]
    return *max(found), float(np.median(np.linalg.norm(steps, axis=-1).max(axis=(1, 2))))


def _halved(shape: _Shape, low: float, high: float, first: Floats, last: Floats) -> tuple[float, float]:
    """Return how far a point comes in the last of the larger halves, and where that is."""
    for _ in range(_TIMES):
        middle = (low + high) / 2
        there = shape(middle)
        if _way(first, there) >= _way(there, last):
            high, last = middle, there
        else:
            low, first = middle, there
    return _way(first, last), float(low)


def _way(one: Floats, other: Floats) -> float:
    return float(np.linalg.norm(other - one, axis=-1).max())


def table(record: Row) -> str:
    """Return the largest jumps by family: of blends, and as handed over to the two stages."""
    rows = []
    for run in record["runs"]:
        lines = run["lines"]
        blend = max(line["jump"] for line in lines if line["of"] == "blend")
        cells = []
        for stage in _STAGES:
            here = [line for line in lines if line["of"] == "shape" and line["to"] == stage]
            cells += [f"{max(line['jump'] for line in here):.0e}", f"{max(line['step'] for line in here):.0e}"]
        rows.append([run["family"], f"{blend:.0e}", *cells])
    steps = f"a step of 1/{record['steps']} of an axis"
    head = ("family", "blends alone", *(f for s in _STAGES for f in (f"as handed over, to s = {s:g}", steps)))
    return markdown(head, rows)


if __name__ == "__main__":
    main()
