"""Draw Fig. 4.2's runs: three seeds of one branch under three blocks (`splinter.toml`), a row each.

python -m examples.wood.splinters OUT.png
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

from solver.contract import Need
from solver.wood import SOLVER
from sweeps.outputs import triangles
from sweeps.picture import sheet

_STAGES = (0.01, 0.02, 0.03, 0.04)
_SEEDS = (1, 2, 3)


def main(out: Path) -> None:
    """Solve and draw."""
    values = tomllib.loads(Path(__file__).with_name("splinter.toml").read_text())
    need = Need(stages=_STAGES, quality="preview", fields=("mesh_position", "inside", "broken_rods", "broken_bonds"))
    rows, labels = [], []
    for seed in _SEEDS:
        run = SOLVER.solve(SOLVER.parse(values | {"seed": seed}), need)
        rows.append(triangles(run))
        labels.append(f"seed {seed}")
        broken = int(run.broken_rods[-1]), int(run.broken_bonds[-1])
        print(f"seed {seed}: {broken[0]} breaks of {run.attrs['rods']} rods, {broken[1]} of {run.attrs['bonds']} bonds")
    stages = [f"t = {1000 * stage:g} ms" for stage in _STAGES]
    out.write_bytes(sheet(rows, title="Splinters", row_labels=labels, column_labels=stages, pixels=300))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
