"""The hostile matrix: python -m benchmarks.dehydration.stress [--quick] [--only WORD].

Each run ends converged, or unconverged and saying so, or in a typed error with the stages that were settled before
it. Anything else is a violation: a hang (the worker is killed), a crash, an untyped exception, a run that is cancelled
late, a value that is not finite, a stored stage with inverted elements. Exit code 1 if there is any.

Two worker processes of one thread each. J: least J / Jd at the integration points over all stored stages. Contact:
deepest penetration of the skin in exocarp thicknesses. All of it is kept as the record dehydration-stress.
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import os
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .judged import Row

THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def show(rows: Sequence[Row]) -> None:
    """Print the matrix, the totals, and every violation."""
    from rich.console import Console
    from rich.table import Table

    def number(value: float | None, form: str) -> str:
        return "" if value is None else format(value, form)

    console = Console(width=None if sys.stdout.isatty() else 160)
    table = Table("what", "n", "last s", "residual", "J", "contact", "outcome", "s")
    for row in rows:
        style = "" if row.good else "bold red"
        cells = (number(row.last, "g"), number(row.residual, ".1e"), number(row.least, ".3f"))
        place, ended = f"{row.group}: {row.what}", (row.outcome, f"{row.seconds:.1f}")
        table.add_row(_plain(place), str(row.n), *cells, number(row.penetration, ".2f"), *ended, style=style)
    console.print(table)
    totals = collections.Counter(row.outcome for row in rows)
    for outcome, count in totals.most_common():
        console.print(f"{count:5d}  {outcome}", markup=False)
    for row in rows:
        if not row.good:
            console.print(f"violation: {row.group}: {row.what}: {row.outcome}: {row.detail}", markup=False)


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the matrix as a table: what the runs of each group ended in."""
    from .judged import GOOD

    head = ["group", "runs", *GOOD, "violations", "least J", "deepest [te]"]
    lines = []
    for group in dict.fromkeys(row.group for row in rows):
        own = [row for row in rows if row.group == group]
        counts = [sum(row.outcome == outcome for row in own) for outcome in GOOD]
        least = [row.least for row in own if row.least is not None]
        deepest = [row.penetration for row in own if row.penetration is not None]
        worst = [f"{min(least):.3f}" if least else "", f"{max(deepest):.2g}" if deepest else ""]
        ended = [str(count or "") for count in (*counts, sum(not row.good for row in own))]
        lines.append([group, str(len(own)), *ended, *worst])
    return {"head": head, "rows": lines}


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)


def main() -> int:
    """Run the matrix; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a few seconds' worth of it")
    parser.add_argument("--only", metavar="WORD", default="", help="cases whose group or name contains this")
    asked = parser.parse_args()
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before numba and BLAS are loaded, here and in the workers
    from .matrix import matrix
    from .workers import run

    begun = time.perf_counter()
    rows = run([case for case in matrix(asked.quick) if asked.only in f"{case.group}: {case.what}"])
    seconds = time.perf_counter() - begun
    show(rows)
    broken = sum(not row.good for row in rows)
    print(f"{len(rows)} runs, {broken} violations, {seconds:.0f} s")
    if not (asked.quick or asked.only):
        from benchmarks.figures import keep

        told = [dataclasses.asdict(row) for row in rows]
        keep("dehydration-stress", told, "dehydration", seconds=seconds, table=summary(rows))
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
