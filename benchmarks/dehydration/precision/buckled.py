"""After buckling: descriptors of each quality against the finest, averaged over seeds.

Past s = 0.15 two runs of one fruit differ point by point, whatever the mesh; what converges are the statistics. So the
error is that of a descriptor's mean over seeds, and beside it stands how much single seeds spread.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

from solver.contract import Quality

from .record import Record, Row, worker

STAGES = (0.10, 0.15, 0.20, 0.30)
DESCRIPTORS = ("roughness", "dominant_degree")
QUALITIES = ("preview", "default", "fine")


def run(te: float, gamma: float, mirrors: str, quality: Quality, seed: int) -> Row:
    """Dry one fruit, or the part between mirror planes; return descriptors, convergence and CPU seconds per stage."""
    from solver.contract import Context, Need
    from solver.dehydration import SOLVER

    params = SOLVER.parse({"te": te, "gamma": gamma, "seed": seed, "mirrors": mirrors})
    ready = time.process_time()
    at: list[float] = []

    def observe(fraction: float, message: str) -> None:
        if message.endswith("settled"):
            at.append(time.process_time() - ready)

    need = Need(
        stages=STAGES,
        quality=quality,
        fields=(*DESCRIPTORS, "buckle_count", "penetration", "least_jacobian"),
    )
    result = SOLVER.solve(params, need, Context(observe))
    steps = int(result["iterations"][-1])
    elements = int(result.attrs["elements"])
    columns: Row = {str(name): result[name].values.tolist() for name in result.data_vars if name != "seconds"}
    columns["penetration"] = [depth / te for depth in columns["penetration"]]
    return {
        **columns,
        "cpu": at,
        "elements": elements,
        "steps": steps,
        "us_per_element_step": at[-1] / elements / steps * 1e6,
    }


def kind(row: Row) -> tuple[float, float, str]:
    """Return what fruit a row is about: te, gamma, mirrors."""
    return row["te"], row["gamma"], row["mirrors"]


def measure(record: Record, plan: Sequence[tuple[float, float, str, str, int]]) -> None:
    """Run what the record lacks of `plan`: (te, gamma, mirrors, quality, number of seeds)."""
    from solver.dehydration import SOLVER

    for te, gamma, mirrors, quality, seeds in plan:
        for seed in range(seeds):
            asked: Row = {"te": te, "gamma": gamma, "mirrors": mirrors, "quality": quality, "seed": seed}
            key = {"version": SOLVER.version, **asked}
            row = record.row("buckled", key, partial(worker, "buckled:run", limit=7200.0, **asked))
            shown = row.get("failed") or " ".join(f"{value:.4f}" for value in row["roughness"])
            print(
                f"te {te:g} gamma {gamma:g} {mirrors or 'whole':5} {quality:8} seed {seed}: {shown}  "
                f"{row['cpu_process']:.0f} CPU s",
                flush=True,
            )


def summary(rows: Sequence[Row], version: str) -> list[Row]:
    """Return mean, spread over seeds and error against the finest quality run, by fruit, quality and stage."""
    good = [row for row in rows if row["version"] == version and "failed" not in row]
    found: list[Row] = []
    for te, gamma, mirrors in sorted({kind(row) for row in good}, key=lambda k: (-k[0], *k[1:])):
        same = [row for row in good if kind(row) == (te, gamma, mirrors)]
        groups = {q: [row for row in same if row["quality"] == q] for q in QUALITIES}
        groups = {quality: group for quality, group in groups.items() if group}
        reference = list(groups)[-1]
        for quality, group in groups.items():
            for stage, s in enumerate(STAGES):
                line: Row = {"te": te, "gamma": gamma, "mirrors": mirrors, "quality": quality}
                line |= {"seeds": len(group), "stage": s}
                line["reference"] = reference
                line["cpu"] = statistics.mean(row["cpu"][stage] for row in group)
                for name in DESCRIPTORS:
                    line[name] = _compare(groups[reference], group, name, stage)
                found.append(line)
    return found


def _compare(reference: Sequence[Row], group: Sequence[Row], name: str, stage: int) -> dict[str, Any]:
    values = [row[name][stage] for row in group]
    truth = statistics.mean(row[name][stage] for row in reference)
    mean = statistics.mean(values)
    return {
        "mean": mean,
        "half_range": (max(values) - min(values)) / 2,
        "error": mean / truth - 1,
        "half_range_relative": (max(values) - min(values)) / 2 / truth,
    }
