"""What each preset costs as it is: python -m benchmarks.wood.presets [PRESET ...]; quality default, its own stages."""

from __future__ import annotations

import sys
import time

from benchmarks.figures import Sheet
from solver.contract import Need, SolverError
from solver.wood import SOLVER

_HEAD = ("preset", "rods", "mode", "masses over real ones", "expected error", "breaks of rods", "of bonds",
         "worst balance", "CPU s", "why")  # fmt: skip
_FIELDS = ("elastic_energy", "broken_rods", "broken_bonds", "rod_position")


def main(names: list[str]) -> None:
    """Print a row for every preset."""
    sheet = Sheet("wood-presets", _HEAD, "wood")
    # compiles, so that the rows do not
    for warm in ({"rods": 9, "vertices": 8}, {"rods": 9, "vertices": 8, "curvature": 4.0}):
        SOLVER.solve(SOLVER.parse({**warm, "mode": "explicit"}, preset="fig-4.2"), Need(stages=(1e-4,), fields=_FIELDS))
    for name in names:
        params, begun = SOLVER.parse({}, preset=name), time.process_time()
        try:
            found = SOLVER.solve(params, Need(stages=SOLVER.preset_stages[name], fields=_FIELDS))
        except SolverError as failed:
            sheet.add((name, *[""] * 8, str(failed)), preset=name, failed=str(failed))
            continue
        cpu, told = time.process_time() - begun, found.attrs
        balance, error = float(found.residual.max()), told.get("expected_error", 0.0)
        sheet.add(
            (name, told["rods"], told["path"], f"{told['mass_scaling']:g}", f"{100 * error:.2g} %" if error else "",
             int(found.broken_rods[-1]), f"{int(found.broken_bonds[-1])} of {told['bonds']}", f"{balance:.1e}",
             f"{cpu:.0f}", told.get("note", "")),
            preset=name, path=told["path"], scaling=told["mass_scaling"], expected_error=error, balance=balance,
            broken_rods=int(found.broken_rods[-1]), broken_bonds=int(found.broken_bonds[-1]), cpu_s=cpu,
            converged=bool(found.converged.values.all()), note=told.get("note", ""),
        )  # fmt: skip
        sheet.keep()


if __name__ == "__main__":
    # fig-4.2 and press are one
    main(sys.argv[1:] or [name for name in SOLVER.presets if name != "press"])
