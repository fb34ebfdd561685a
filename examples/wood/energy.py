"""Plot Fig. 4.1: the energies of a bent, free, unbreakable bundle over time, and what is missing of their sum.

python -m examples.wood.energy OUT.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from solver.contract import Need
from solver.wood import SOLVER


def main(out: Path) -> None:
    """Solve and draw."""
    times = tuple(np.linspace(0, 4e-3, 201))
    need = Need(stages=times, fields=("kinetic_energy", "elastic_energy"))
    run = SOLVER.solve(SOLVER.parse({}, "fig-4.1"), need)
    total = run.kinetic_energy + run.elastic_energy
    drift = np.abs(total / total[0] - 1)
    print(f"{run.attrs['rods']} rods, step {run.attrs['step']:.3g} s: largest error {float(drift.max()):.2g}")
    figure = Figure(figsize=(7, 4.6), dpi=110, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for values, label, colour in (
        (run.elastic_energy, "elastic", "#7a4a21"),
        (run.kinetic_energy, "kinetic", "#2f6f8f"),
        (total, "sum", "#222222"),
    ):
        above.plot(1000 * run.stage, values, color=colour, label=label, linewidth=1.3)
    above.set_ylabel("energy [J]")
    above.legend(frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1, 0.99))
    above.set_title("A bent bundle let go (Fig. 4.1)", loc="left")
    below.semilogy(1000 * run.stage[1:], np.maximum(drift[1:], 1e-9), color="#222222", linewidth=1)
    below.axhline(1e-3, color="#b03030", linewidth=0.8, linestyle=":")
    below.set_ylim(1e-5, 2e-3)
    below.set_ylabel("error")
    below.set_xlabel("time [ms]")
    FigureCanvasAgg(figure).print_png(out)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
