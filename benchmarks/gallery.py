"""The gallery of Combaz and Neyret 2004, Fig. 2: every file in examples/growth grown, measured and drawn.

python -m benchmarks.gallery [--quality Q] [--out docs/growth-gallery.png] [NAME ...]   prints a table; CPU seconds of
one thread, kernels compiled beforehand.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from pathlib import Path

from solver import registry
from solver.contract import Need, SolverError
from sweeps.outputs import triangles
from sweeps.picture import Panel, sheet

_FOLDER = Path(__file__).parent.parent / "examples" / "growth"
_COLUMNS = 5


def measure(path: Path, quality: str) -> tuple[str, Panel | None]:
    """Return a line of the table and the picture of growth time 1."""
    solver = registry.get("growth")
    params = solver.parse(tomllib.loads(path.read_text(encoding="utf-8")))
    begun = time.process_time()
    try:
        run = solver.solve(params, Need.parse({"stages": [1.0], "quality": quality}))
    except SolverError as error:
        return f"| {path.stem} | {error} |", None
    seconds = time.process_time() - begun
    count, residual, steps = int(run["vertex_count"][0]), float(run["residual"][0]), int(run["iterations"][0])
    panel = triangles(run)[0]
    # each at its own size: a bed is no mushroom
    size = float(abs(panel.position).max())
    shown = Panel(panel.position / size, triangles=panel.triangles, up=panel.up, note=path.stem)
    return f"| {path.stem} | {count} | {residual:.1e} | {steps} | {seconds:.1f} |", shown


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--quality", default="default")
    parser.add_argument("--out", type=Path)
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args()
    paths = [_FOLDER / f"{name}.toml" for name in asked.names] or sorted(_FOLDER.glob("*.toml"))
    solver = registry.get("growth")
    solver.solve(solver.parse({}), Need.parse({"stages": [0.1], "quality": "preview"}))  # compile
    print("| file | vertices | residual | iterations | CPU s |\n|---|---|---|---|---|")
    panels = []
    for path in paths:
        line, panel = measure(path, asked.quality)
        print(line, flush=True)
        panels += [panel] if panel else []
    if asked.out:
        rows = [panels[i : i + _COLUMNS] for i in range(0, len(panels), _COLUMNS)]
        asked.out.write_bytes(sheet(rows, title="Growth: the gallery of Combaz and Neyret 2004, Fig. 2", pixels=260))


if __name__ == "__main__":
    main()
