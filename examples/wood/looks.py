"""Draw a stick that snaps and one that tears: python -m examples.wood.looks OUT.png."""

from __future__ import annotations

import sys
import time
import tomllib
from pathlib import Path

from solver.contract import Need
from solver.wood import SOLVER
from sweeps.outputs import triangles
from sweeps.pictures.sheet import sheet

_STICKS, _STAGES = ("brash", "fibrous"), (0.02, 0.04, 0.06)


def main(out: Path) -> None:
    """Solve and draw, a row each."""
    need = Need(stages=_STAGES, quality="preview", fields=("mesh_position", "inside", "body", "broken_bonds"))
    rows = []
    for name in _STICKS:
        begun = time.process_time()
        run = SOLVER.solve(SOLVER.parse(tomllib.loads(Path(__file__).with_name(f"{name}.toml").read_text())), need)
        rows.append(list(triangles(run)))
        bonds = f"{int(run.broken_bonds[-1])} of {run.attrs['bonds']} bonds"
        print(
            f"{name}: {int(run.broken_rods[-1])} breaks, {bonds}, {time.process_time() - begun:.0f} CPU s", flush=True
        )
    above = [f"t = {stage:g} s" for stage in _STAGES]
    out.write_bytes(sheet(rows, title="Snapped and torn", row_labels=list(_STICKS), column_labels=above, pixels=300))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
