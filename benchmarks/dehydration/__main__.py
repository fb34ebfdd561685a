"""Error over CPU time of the dehydration solver: python -m benchmarks.dehydration [--part a|b|c|skips].

a: the smooth sphere before buckling, ours and other codes (`precision.spheres`; which are missing is said).
b: descriptors after buckling by quality (`precision.buckled`): minutes per run, so runs that the file has are kept.
c: cost against the number of elements (`precision.scaling`).
skips: what each thing that a need leaves out saves, and the error it adds (`precision.skips`).

Everything runs on one thread, one run at a time. a, c and skips run anew each time, since only CPU seconds of one
session compare. Without --part: a and c. A picture is drawn from whatever the records hold.
Each part is a record of its own, with the version of the solver that ran.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from solver.dehydration import SOLVER

from .precision import buckled, scaling, skips, spheres
from .precision.record import Record

#: te, gamma, mirrors, quality, seeds. An eighth has few buckles, so that seeds differ by as much as two of them. Thin
#: skins take long: of them an eighth is solved, and only with --thin.
PLAN = (
    *((0.04, gamma, "xyz", quality, 6) for gamma in (10.0, 30.0, 50.0) for quality in ("preview", "default", "fine")),
    *((0.04, 10.0, "", quality, seeds) for quality, seeds in (("preview", 3), ("default", 2), ("fine", 2))),
    *((0.04, 30.0, "", quality, seeds) for quality, seeds in (("default", 3), ("fine", 2))),
)
THIN = (
    *((0.02, 10.0, "xyz", quality, 2) for quality in ("preview", "default", "fine")),
    (0.01, 10.0, "xyz", "preview", 1),
    (0.01, 10.0, "xyz", "default", 1),
)
#: Meshes of the short form.
SHORT_EDGES = (12, 20, 32)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", action="append", choices=("a", "b", "c", "skips"), help="may be repeated")
    parser.add_argument("--picture", type=Path, help="draw the work-precision diagram here")
    parser.add_argument("--no-peers", action="store_true", help="part a without other codes")
    parser.add_argument("--short", action="store_true", help="theta 0.95 and few meshes; keeps no record")
    parser.add_argument("--thin", action="store_true", help="part b: te = 0.02 and 0.01 as well")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds per run of part a")
    parser.add_argument("--redraw", action="store_true", help="run nothing, only draw")
    options = parser.parse_args()
    parts = () if options.redraw else tuple(options.part or ("a", "c"))
    record = Record(kept=not options.short)
    if "a" in parts:
        thetas = spheres.THETAS[:1] if options.short else spheres.THETAS
        spheres.measure(record, thetas=thetas, peers=not options.no_peers, short=options.short, limit=options.limit)
    if "b" in parts:
        buckled.measure(record, (*PLAN, *(THIN if options.thin else ())))
    if "c" in parts:
        scaling.measure(record, SHORT_EDGES if options.short else scaling.EDGES)
    if "skips" in parts:
        skips.measure(record)
    if options.picture:
        from .precision.picture import draw

        after = buckled.summary(record.rows("buckled"), SOLVER.version)
        draw({"spheres": record.rows("spheres"), "buckled_summary": after}, options.picture)


if __name__ == "__main__":
    main()
