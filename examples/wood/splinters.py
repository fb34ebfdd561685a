"""Draw Fig. 4.2's runs: three seeds of one branch under three blocks, a row each, blocks and all.

python -m examples.wood.splinters OUT.png [--slow] [SEED ...]; writes OUT-SEED.glb, animated, beside it. The press of
`splinter.toml` is fast and explicit; with --slow it is the thesis', in three seconds, on scaled masses (`press.toml`).
"""

from __future__ import annotations

import sys
import time
import tomllib
from pathlib import Path

from service.sequences import EXPORTS, Options, prepared, write
from solver.contract import Need, Quality
from solver.wood import SOLVER
from sweeps.outputs import triangles
from sweeps.pictures.sheet import sheet

#: File, stages [s], quality.
_FAST: tuple[str, tuple[float, ...], Quality] = ("splinter.toml", (0.015, 0.03, 0.045, 0.06), "preview")
_SLOW: tuple[str, tuple[float, ...], Quality] = ("press.toml", (0.75, 1.5, 2.25, 3.0), "preview")
_SEEDS = (1, 2, 3)


def main(out: Path, slow: bool, seeds: tuple[int, ...]) -> None:
    """Solve, draw and export."""
    name, stages, quality = _SLOW if slow else _FAST
    values = tomllib.loads(Path(__file__).with_name(name).read_text())
    need = Need(
        stages=stages, quality=quality, fields=("mesh_position", "inside", "body", "broken_rods", "broken_bonds")
    )
    rows, labels = [], []
    for seed in seeds:
        params, begun = SOLVER.parse(values | {"seed": seed}), time.process_time()
        run = SOLVER.solve(params, need)
        cpu = time.process_time() - begun
        rows.append(list(triangles(run)))
        labels.append(f"seed {seed}")
        broken = int(run.broken_rods[-1]), int(run.broken_bonds[-1])
        counts = f"{broken[0]} breaks of {run.attrs['rods']} rods, {broken[1]} of {run.attrs['bonds']} bonds"
        print(f"seed {seed}: {counts}, {cpu:.0f} CPU s", flush=True)
        options = Options()
        out.with_name(f"{out.stem}-{seed}.glb").write_bytes(
            write(prepared(run, options), EXPORTS["animation"], options)
        )
    above = [f"t = {stage:g} s" if slow else f"t = {1000 * stage:g} ms" for stage in stages]
    out.write_bytes(sheet(rows, title="Splinters", row_labels=labels, column_labels=above, pixels=300))


if __name__ == "__main__":
    words = [word for word in sys.argv[2:] if word != "--slow"]
    main(Path(sys.argv[1]), "--slow" in sys.argv, tuple(int(seed) for seed in words) or _SEEDS)
