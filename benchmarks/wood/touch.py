"""What contact of rods costs and keeps apart in the slow press: python -m benchmarks.wood.touch [SEED ...].

Fig. 4.2 at 24 rods of 16 vertices, on masses scaled 10 000 times, with and without `rod_contact`. The overlap is the
largest of any two rods, bonded or not, over the thickness of their contact, at thirty stages; a rod in the axis of
another overlaps it by 1.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import xarray as xr

from benchmarks.figures import Sheet
from solver.contract import Need, SolverError
from solver.wood import SOLVER, WoodParams
from solver.wood.contact.listing import law
from solver.wood.contact.pairs import distances, pairs
from solver.wood.model.bundle import lay
from solver.wood.model.state import Wood

_PRESS = {"rods": 24, "vertices": 31, "mode": "explicit", "mass_scaling": 1e4}
_STAGES = tuple(0.1 * n for n in range(1, 31))
_FIELDS = ("rod_position", "rod_cut", "elastic_energy", "broken_rods", "broken_bonds")


def overlap(found: xr.Dataset, wood: Wood, thick: float) -> float:
    """Return the largest overlap of two rods at any stage, over their thickness [m]."""
    real = wood.rods.k > 0
    number = np.arange(real.sum(), dtype=np.int32)
    rod, least = wood.rod[real], thick
    for ends, cut in zip(found.rod_position.values, found.rod_cut.values, strict=True):
        x = np.ascontiguousarray(ends, float).reshape(-1, 3)
        rods = wood.rods._replace(a=2 * number, b=2 * number + 1, k=wood.rods.k[real], alive=(cut < 0).astype(np.uint8))
        near = pairs(x, rods, rod, thick)
        least = min(least, float(distances(x, rods, near).min(initial=thick)))
    return 1 - least / thick


def main(seeds: tuple[int, ...]) -> None:
    """Print a row for every seed, with and without contact."""
    head = ("seed", "contact of rods", "breaks of rods", "of bonds", "largest overlap", "worst balance", "CPU s")
    sheet = Sheet("wood-touch", head, "wood")
    # compiles, so that the rows do not
    SOLVER.solve(SOLVER.parse({**_PRESS, "rods": 9, "vertices": 6}, preset="fig-4.2"), Need(stages=(1e-3,)))
    for seed in seeds:
        for touching in (False, True):
            params = SOLVER.parse({**_PRESS, "seed": seed, "rod_contact": touching}, preset="fig-4.2")
            assert isinstance(params, WoodParams)
            begun = time.process_time()
            told = {"seed": seed, "contact": touching}
            try:
                found = SOLVER.solve(params, Need(stages=_STAGES, fields=_FIELDS, quality="preview"))
            except SolverError as error:
                sheet.add((seed, "yes" if touching else "no", str(error), *[""] * 4), **told, failed=str(error))
                continue
            cpu = time.process_time() - begun
            wood = lay(params, found.attrs["vertices"])
            most = overlap(found, wood, float(law(wood, params)[0]))
            broken = int(found.broken_rods[-1]), int(found.broken_bonds[-1])
            balance, bonds = float(found.residual.max()), int(found.attrs["bonds"])
            sheet.add(
                (seed, "yes" if touching else "no", broken[0], f"{broken[1]} of {bonds}", f"{most:.2f}",
                 f"{balance:.1e}", f"{cpu:.0f}"),
                **told, broken_rods=broken[0], broken_bonds=broken[1], bonds=bonds, overlap=most, balance=balance,
                cpu=cpu,
            )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    main(tuple(int(word) for word in sys.argv[1:]) or (1, 2, 3))
