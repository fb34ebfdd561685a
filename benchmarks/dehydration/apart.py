"""Whether looked-up shapes cross themselves: random questions to all families that come with wizen.

    python -m benchmarks.dehydration.apart [--ask 64:10000 128:1000 256:200] [--pieces FOLDER]

Every family is asked on each lattice, at random points and stages (one of a single sample at random stages, half as
often). What comes is compared with the blend as it was before it was put out of contact; every tenth is counted once
more by `solver.geometry.crossings`, which shares nothing with what put it apart, and its blend as it was before.
Seconds of this process alone. With a folder for pieces, what was asked already is not asked again (record
dehydration-apart).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import Sheet
from solver import registry
from solver.geometry.crossings import crossings
from solver.lattice import closed_lattice
from store.lookup import ShapeTable
from store.starter import ROOT
from store.store import Store

_EDGES = (0.0, 0.1, 0.2, 0.25, 0.3)
_HEAD = (
    *("lattice", "s", "asked", "moved", "crossed before", "cross now"),
    *("moved, rms [r1]", "most [r1]", "ms", "ms without", "slowest [ms]"),
)

Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ask", nargs="+", default=["64:10000", "128:1000", "256:200"], metavar="LATTICE:SHAPES")
    parser.add_argument("--pieces", type=Path, help="where each family's answers are kept while this goes on")
    parser.add_argument("--families", nargs="+", help="only these; others keep their share of the questions")
    asked = parser.parse_args()
    sheet = Sheet("dehydration-apart", _HEAD, "dehydration")
    store = Store.open(ROOT)
    families = [ShapeTable.open(store, name, surfaces=registry.surface) for name in store.table_names()]
    for text in asked.ask:
        n, count = map(int, text.split(":"))
        rows = list(_all(families, n, count, asked.pieces, asked.families))
        for low, high in pairwise(_EDGES):
            _add(sheet, n, f"{low:g} to {high:g}", [row for row in rows if low < row["s"] <= high])
    sheet.keep(digests={table.info.name: table.digest for table in families})


def _all(families: list[ShapeTable], n: int, count: int, pieces: Path | None, only: list[str] | None) -> Iterator[Row]:
    """Yield what became of each question on one lattice, family by family."""
    shares = [2 if table.axes else 1 for table in families]
    for table, share in zip(families, shares, strict=True):
        if only is not None and table.info.name not in only:
            continue
        piece = None if pieces is None else pieces / f"{table.info.name}-{n}-{count}-{table.digest[:16]}.json"
        if piece is not None and piece.is_file():
            yield from json.loads(piece.read_text())
            continue
        rows = _family(table, n, round(count * share / sum(shares)))
        if piece is not None:
            piece.parent.mkdir(parents=True, exist_ok=True)
            piece.write_text(json.dumps(rows))
        yield from rows


def _family(table: ShapeTable, n: int, count: int) -> list[Row]:
    """Return what became of random questions to one family, drawn evenly in the logarithm of its parameters."""
    rng = np.random.default_rng(n)
    stages = rng.uniform(0, table.reach[1], count)
    points = [
        {axis: float(np.exp(rng.uniform(np.log(low), np.log(high)))) for axis, (low, high) in table.axes.items()}
        for _ in stages
    ]
    _ask(table, points[0], 0.99 * table.reach[1], n, True)  # compiles
    found = (
        _ask(table, point, float(s), n, i % 10 == 0) for i, (point, s) in enumerate(zip(points, stages, strict=True))
    )
    return [{"family": table.info.name, "s": float(s), **row} for s, row in zip(stages, found, strict=True)]


def _ask(table: ShapeTable, point: dict[str, float], stage: float, n: int, again: bool) -> Row:
    begin = time.thread_time()
    plain = table.at(point, stage, resolution=n, fields=("displacement",), apart=False).displacement
    between = time.thread_time()
    shape = table.at(point, stage, resolution=n, fields=("position", "displacement"))
    end = time.thread_time()
    assert shape.position is not None
    assert shape.displacement is not None
    assert plain is not None
    moved = np.linalg.norm(shape.displacement.astype(float) - plain, axis=-1)
    found: Row = {"pairs": shape.crossings, "rms": float(np.sqrt((moved**2).mean())), "most": float(moved.max())}
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


def _add(sheet: Sheet, n: int, span: str, rows: list[Row]) -> None:
    moved, crossing = sum(row["most"] > 0 for row in rows), sum(row["pairs"] > 0 for row in rows)
    before = [row["before"] > 0 for row in rows if "before" in row]
    rms = float(np.sqrt(np.mean([row["rms"] ** 2 for row in rows])))
    most = max(row["most"] for row in rows)
    ms, without = (1e3 * float(np.median([row[name] for row in rows])) for name in ("seconds", "without"))
    slowest = max(rows, key=lambda row: row["seconds"])
    said = f"{rms:.4f}", f"{most:.3f}", f"{ms:.1f}", f"{without:.1f}", f"{1e3 * slowest['seconds']:.0f}"
    sheet.add(
        (f"{n} x {2 * n}", span, len(rows), moved, f"{sum(before)} of {len(before)}", crossing, *said),
        lattice=n, s=span, asked=len(rows), moved=moved, before=sum(before), of=len(before), crossing=crossing,
        pairs=sum(row["pairs"] for row in rows), rms=rms, most=most, ms=ms, without=without,
        slowest_ms=1e3 * slowest["seconds"], slowest=slowest["family"],
        families={name: sum(row["family"] == name for row in rows) for name in sorted({row["family"] for row in rows})},
    )  # fmt: skip


if __name__ == "__main__":
    main()
