"""What a look-up keeps between the samples of a table.

    python -m benchmarks.dehydration.starter [--store STORE] [--name plum2] [--held-out STORE]

Without a store: the table that comes with wizen, each sample predicted from the others, and how neighbours correlate
(record dehydration-left-out). With `--held-out`, a store with runs between the samples, these are predicted (record
dehydration-held-out), and those that differ in their seed alone are compared with each other: so far is one run from
another. Records of another table than the default have its name at their end, and say which version of the solver
made the table.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.figures import Sheet
from solver import registry
from store import starter
from store.blending import methods
from store.lookup import ShapeTable
from store.store import Store
from sweeps.refining import score as scores

_HEAD = ("", "s", "roughness", "bands [dB]", "slopes W1 [degree]", "patchiness", "correlation", "neighbours correlate")
_NAMES = {
    methods.DEFAULT: f"default, `{methods.DEFAULT}`",
    "thin+LL+env": "`thin+LL+env`",
    "nearest": "`nearest`",
    "idw": "the paper's, `idw`",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, default=starter.ROOT, help="whose table is scored")
    parser.add_argument("--name", default="default", help="name of the table")
    parser.add_argument("--held-out", type=Path, help="a store with runs that the table does not hold")
    asked = parser.parse_args()
    store = Store.open(asked.store)
    table = ShapeTable.open(store, asked.name, surfaces=registry.surface)
    cases, pairs = scores.cases(store, table, asked.held_out)
    report = scores.score(table, cases, pairs, tuple(_NAMES), asked.held_out is not None)
    names = _NAMES | ({"seed": "the same fruit from another seed"} if pairs else {})
    record = "dehydration-held-out" if asked.held_out else "dehydration-left-out"
    record += "" if asked.name == "default" else f"-{asked.name}"
    sheet = Sheet(record, _HEAD, table.info.solver)
    for method, name in names.items():
        for row in (row for row in report.rows if row.method == method):
            m, alike = row.measures, report.correlation.get(row.stage)
            cells = (f"{m.rgh:.3f}", f"{m.dB:.2f}", f"{m.W1:.2f}", f"{m.patch:.3f}", f"{m.corr:.2f}")
            sheet.add(
                (name, f"{row.stage:g}", *cells, "" if alike is None else f"{alike:.2f}"),
                method=method, s=row.stage, neighbours=alike, **m._asdict(),
            )  # fmt: skip
    sheet.keep(cases=report.labels, digest=table.digest, version=table.info.version)


if __name__ == "__main__":
    main()
