"""Shapes back to their parameters: python -m benchmarks.service.matching [--runs FOLDER].

Shapes between the samples of the table in the package, at random parameters, each written as an OBJ that is turned,
mirrored, moved and scaled, and read back as a user would; with r1 known, and without. Then shapes of other families,
and, where a folder holds results of other seeds (`wizen solve ... --out FILE.h5`, with position), each of their stages:
what no look-up has made.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from benchmarks.figures import Sheet
from service.matching import answer, targets
from service.shapes.live import LiveTables
from solver.lattice import closed_lattice
from store import starter

HEAD = ["shapes", "r1 is known", "asked", "gamma within 10 %", "te within 10 %", "s within .01", "all three"]
HEAD += ["median error of gamma, te, s", "unique", "distance, median and most"]
#: Other families: table, axes and their ranges; the stage from 0.05 to 0.3.
FAMILIES = {
    "stone-radius": ("rs1", "te"),
    "prolate": ("r4", "te"),
    "sphere-02": ("gamma",),
    "raisin": ("te", "gamma"),
}


class Case(NamedTuple):
    """A shape: its points and poles, and what the truth is."""

    points: np.ndarray
    truth: dict[str, float]
    table: str
    seed: int


def between(tables: LiveTables, count: int, random: np.random.Generator) -> Iterator[Case]:
    """Yield shapes between the samples of the default table."""
    for i in range(count):
        truth = {"te": random.uniform(0.03, 0.04), "gamma": 10 * 5 ** random.uniform()}
        truth["s"] = random.uniform(0.05, 0.3)
        yield looked_up(tables, "default", truth, int(random.choice([64, 96])), i)


def families(tables: LiveTables, random: np.random.Generator) -> Iterator[Case]:
    """Yield shapes of other families."""
    for i, (name, axes) in enumerate(FAMILIES.items()):
        for k in range(2):
            bounds = tables.get(name).axes
            truth = {axis: random.uniform(*bounds[axis]) for axis in axes} | {"s": random.uniform(0.08, 0.28)}
            yield looked_up(tables, name, truth, 96, 2 * i + k)


def looked_up(tables: LiveTables, name: str, truth: dict[str, float], n: int, seed: int) -> Case:
    """Return a shape of a table, put out of contact, as it is handed over."""
    point = {axis: value for axis, value in truth.items() if axis != "s"}
    found = tables.get(name).at(point, truth["s"], resolution=n)
    assert found.position is not None
    assert found.poles is not None
    return Case(np.concatenate([found.position.reshape(-1, 3), found.poles]).astype(float), truth, name, seed)


def solved(folder: Path) -> Iterator[Case]:
    """Yield two stages of each of the results in a folder, in turns."""
    for number, path in enumerate(sorted(folder.glob("*.h5"))):
        with xr.open_dataset(path, engine="h5netcdf") as run:
            params = json.loads(run.attrs["params"])
            said = {"te": params["exocarp_thickness"], "gamma": params["modulus_ratio"]}
            stages = run.stage.values.tolist()
            for k in (number % len(stages), (number + 1) % len(stages)):
                stage = stages[k]
                x = run.position.values[k].astype(float)
                points = np.concatenate([x.reshape(-1, 3), x[[0, -1]].mean(axis=1)])
                yield Case(points, {**said, "s": stage}, "default", int(params["seed"]))


def written(case: Case, unit: float) -> bytes:
    """Return a shape as an OBJ that somebody else might have made: turned, mirrored, moved, in another unit."""
    random = np.random.default_rng(case.seed)
    turn = Rotation.random(random_state=case.seed)
    points = turn.apply(case.points) * [-1, 1, 1] * unit + random.uniform(-50, 50, 3)
    faces = closed_lattice(int(np.sqrt((len(points) - 2) / 2)))[:, ::-1] + 1
    lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in points] + [f"f {a} {b} {c}" for a, b, c in faces]
    return "\n".join(lines).encode()


def asked(case: Case, tables: LiveTables, known: bool) -> dict[str, Any]:
    """Return what a match came to, beside the truth."""
    unit = 7.5
    start = time.process_time()
    page = answer.match(targets.read(written(case, unit), ".obj", unit if known else None), tables)
    best = page.best
    told = {**best.parameters, "s": best.stage}
    fixed = tables.get(best.table).fixed
    errors = {}
    for name, value in case.truth.items():
        found = told.get(name, fixed.get(name, np.nan))
        errors[name] = found - value if name == "s" else found / value - 1
    return {
        "truth": case.truth,
        "of": case.table,
        "found": told,
        "table": best.table,
        "errors": errors,
        "uncertainty": best.uncertainty,
        "distance": best.distance,
        "unique": page.unique,
        "alternatives": [
            {"table": a.table, **a.parameters, "s": a.stage, "distance": a.distance} for a in page.alternatives
        ],
        "processor_s": time.process_time() - start,
        "r1_known": known,
        "seed": case.seed,
    }


def row(sheet: Sheet, name: str, cases: list[Case], tables: LiveTables, known: bool) -> None:
    """Ask for all cases and add a row."""
    runs = [asked(case, tables, known) for case in cases]
    within: dict[str, list[bool]] = {"gamma": [], "te": [], "s": []}
    for run in runs:
        for axis, values in within.items():
            if axis in run["errors"]:
                values.append(abs(run["errors"][axis]) <= (0.01 if axis == "s" else 0.1))
    good = [all(abs(e) <= (0.01 if a == "s" else 0.1) for a, e in run["errors"].items()) for run in runs]
    median = []
    for axis in within:
        errors = [abs(run["errors"][axis]) for run in runs if axis in run["errors"]]
        if errors:
            value = float(np.nanmedian(errors))
            median.append(f"{value:.4f}" if axis == "s" else f"{100 * value:.1f} %")
    away = [run["distance"] for run in runs]
    cells = [
        name,
        "yes" if known else "no",
        len(runs),
        *(f"{sum(v)} of {len(v)}" if v else "" for v in within.values()),
    ]
    cells += [f"{sum(good)} of {len(good)}", ", ".join(median), f"{sum(run['unique'] for run in runs)} of {len(runs)}"]
    sheet.add([*cells, f"{np.median(away):.2f}, {max(away):.2f}"], what=name, r1_known=known, cases=runs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, help="folder of results of other seeds")
    parser.add_argument("--count", type=int, default=20, help="shapes between the samples")
    given = parser.parse_args()
    tables = LiveTables(starter.ROOT, 60.0)
    random = np.random.default_rng(20)
    sheet = Sheet("service-match", HEAD)
    groups = {"between the samples": list(between(tables, given.count, random))}
    if given.runs is not None:
        groups["eighths solved from other seeds"] = list(solved(given.runs))
    groups["of other families"] = list(families(tables, random))
    for known in (True, False):
        for name, cases in groups.items():
            if known or "families" not in name:
                row(sheet, name, cases, tables, known)
                spent = [case["processor_s"] for run in sheet.runs for case in run["cases"]]
                sheet.keep(processor_s={"median": float(np.median(spent)), "most": max(spent)})
    print(f"{np.median(spent):.1f} s of processor for one, {max(spent):.1f} s for the first")


if __name__ == "__main__":
    main()
