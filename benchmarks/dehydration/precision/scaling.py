"""Cost against the number of elements: the march from its start over 0.02 of shrinkage, nothing settled.

Layers stay, elements per edge grow. A finer mesh has a shorter critical step, so the number of steps grows with n; cost
of one step and of the whole march are fitted apart.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .record import Record, Row, worker

EDGES = (12, 16, 20, 24, 32, 40)
SPAN = 0.02


def run(edges: Sequence[int], span: float) -> list[Row]:
    """March once per mesh, in one process; return steps, elements and CPU seconds."""
    from solver.contract import Context
    from solver.dehydration.params import DehydrationParams
    from solver.dehydration.path import Path
    from solver.dehydration.settings import choose

    fruit = DehydrationParams()
    usual = choose(fruit, "default")
    rows: list[Row] = []
    for n in (8, *edges):  # the first loads compiled code
        paced = {name: getattr(usual, name) * usual.n / n for name in ("pace", "damping")}
        settings = replace(usual, n=n, settle_steps=0, **paced)
        begun = time.process_time()
        path = Path(fruit, settings, Context())
        made = time.process_time()
        end = settings.start + span
        steps = path.stage(end, end).steps
        cpu = time.process_time() - made
        rows.append({"n": n, "elements": path.elements, "steps": steps, "cpu": cpu, "cpu_setup": made - begun})
    return rows[1:]


def together(edges: Sequence[int], span: float) -> Row:
    """Return the rows and the fitted slopes."""
    rows = run(edges, span)
    elements = [row["elements"] for row in rows]
    for row in rows:
        row["us_per_element_step"] = row["cpu"] / row["elements"] / row["steps"] * 1e6
    per_step = [row["cpu"] / row["steps"] for row in rows]
    return {
        "meshes": rows,
        "slope_of_a_step": _slope(elements, per_step),
        "slope_of_the_march": _slope(elements, [row["cpu"] for row in rows]),
    }


def measure(record: Record, edges: Sequence[int] = EDGES) -> None:
    """Run it anew and record it."""
    found = worker("scaling:together", edges=list(edges), span=SPAN)
    if "failed" in found:
        print(f"scaling: {found['failed']}")
        return
    record.parts["scaling"] = found["meshes"]
    record.save("scaling", **{name: value for name, value in found.items() if name != "meshes"})
    for row in found["meshes"]:
        print(
            f"n {row['n']:3d} {row['elements']:7d} elements {row['steps']:6d} steps {row['cpu']:7.2f} CPU s "
            f"{row['us_per_element_step']:.4f} us per element-step"
        )
    print(f"cost ~ elements^{found['slope_of_a_step']:.2f} a step, ^{found['slope_of_the_march']:.2f} for the march")


def _slope(x: Sequence[float], y: Sequence[float]) -> float:
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
