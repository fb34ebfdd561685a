"""How far look-ups are from equilibrium, and what relaxing them costs: python -m benchmarks.dehydration.balance.

Of families in the package, at random points between their samples, and at some of these: from which residual, and how
far, the solver moves what each method looks up until it is in balance, and how its statistics compare with what becomes
of it (record dehydration-score). Fruits keep the bumps and the pattern that runs begin with, which come with the
package. The record is kept after each family, and what it has of this version of the solver is not done again; of
others it keeps what is of the tables of now, until these families are asked for.

With --tier, of fruits of the default family, of that of te = 0.01, of raisins and wolfberries instead: the tier
between table and run, with seconds by the clock and of the processor, on as many threads as there are, after a first
one (record dehydration-relaxed). Four corners of the default family's softer half (gamma 10 and 20) are also run at
preview, which takes a minute and a half: in --store, or nowhere.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import get_num_threads

from benchmarks import figures
from benchmarks.figures import Row, Sheet, markdown
from solver import registry
from solver.contract import Context
from solver.dehydration import SOLVER, DehydrationParams
from solver.geometry.crossings import crossings
from solver.lattice import closed_lattice, lattice
from store import tables
from store.blending import methods
from store.lookup import ShapeTable
from store.starter import ROOT
from store.store import Store
from sweeps.planning.plan import Plan
from sweeps.refining import balance
from sweeps.refining.balance import Distance
from sweeps.relaxing import lattice_of, relaxed
from sweeps.running import executors
from sweeps.running.runner import run_plan

__all__ = ["sphere_volume", "table"]

NAME = "dehydration-score"
_OTHERS = ("nearest", "idw")
#: A run of the table itself, put on the mesh as what is looked up is: what of the distance is the mesh's doing.
_SAMPLE = "sample"
_METHODS = (methods.DEFAULT, *_OTHERS)
#: By measure, what the default is wanted to keep to s = 0.2, and from there to 0.3.
_WANTED = {"moved": (0.15, 0.25), "rgh": (0.02, 0.04), "dB": (1.2, 2.4), "W1": (1.0, 2.0)}
_CALLED = {"moved": "moved", "rgh": "roughness", "dB": "bands [dB]", "W1": "slopes W1 [degree]"}
_RELAXED = (
    *("family", "quality", "te", "gamma", "s", "residual", "steps", "moved", "correlation", "crossing pairs"),
    *("volume over exact, looked up", "relaxed", "seconds", "processor seconds"),
)
#: te, gamma and s of fruits that are relaxed to the end: of the default family, of one at preview, and of quarters.
_FRUITS = (
    *((0.0375, 22.0, 0.2), (0.0375, 22.0, 0.3), (0.0325, 13.0, 0.2), (0.0325, 13.0, 0.3)),
    *((0.03, 10.0, 0.3), (0.04, 50.0, 0.3)),
)
_CORNERS = {"te": [0.04, 0.03], "gamma": [10, 20]}
_AT_PREVIEW = ((0.0345, 14.0, 0.2), (0.0345, 14.0, 0.3), (0.0375, 17.0, 0.2), (0.0375, 17.0, 0.3), (0.03, 10.0, 0.3))
_THIN = "sphere-01"
_QUARTERS = ((0.01, 13.0, 0.2), (0.01, 23.0, 0.3), (0.01, 10.0, 0.3))
_RAISINS = ((0.0093, 7.0, 0.2), (0.011, 8.5, 0.2), (0.011, 8.5, 0.3))
_WOLFBERRIES = ((0.0063, 14.0, 0.2), (0.0058, 8.4, 0.2))
_LATTICE = 64
#: Last stage of the narrower goals.
_EARLY = 0.2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--families", nargs="+", help="without: all of more than one sample")
    parser.add_argument("--stages", nargs="+", type=float, default=[0.1, 0.2, 0.3])
    parser.add_argument("--points", type=int, default=3, help="of each family")
    parser.add_argument("--tier", action="store_true", help="the tier between table and run alone")
    parser.add_argument(
        "--store", type=Path, help="with --tier: keep the runs at preview there, or take those it holds"
    )
    asked = parser.parse_args()
    if asked.tier:
        with tempfile.TemporaryDirectory() as folder:
            _tier(asked.store or Path(folder))
    else:
        _score(asked.families, asked.stages, asked.points)


def _score(names: Sequence[str] | None, stages: Sequence[float], count: int) -> None:
    """Fill in what the record lacks, family by family."""
    package = Store.open(ROOT)
    opened = {name: ShapeTable.open(ROOT, name, surfaces=registry.surface) for name in package.table_names()}
    kept = figures.load(NAME)["runs"] if NAME in figures.names() else []
    about = {
        name: {
            "family": name,
            "digest": one.digest,
            "stages": [*stages],
            "points": count,
            "lattice": lattice_of(one),
        }
        for name, one in opened.items()
        if one.size > 1
    }
    if unknown := set(names or ()) - set(about):
        raise SystemExit(
            f"{', '.join(sorted(unknown))}: no family of more than one sample; there are {', '.join(about)}."
        )
    # of tables that are no more, or have changed, nothing is kept
    runs = {row["family"]: row for row in kept if _is_of(row, about.get(row["family"], {}))}
    for name in names or about:
        if name in runs and runs[name]["version"] == SOLVER.version:
            continue
        begin, made = time.process_time(), {"version": SOLVER.version, **about[name]}
        runs[name] = {**made, "each": list(_measured(opened[name], package, stages, count))}
        figures.keep(NAME, [runs[k] for k in about if k in runs], "dehydration")
        print(f"{name}: {time.process_time() - begin:.0f} s of the processor", file=sys.stderr, flush=True)


def _is_of(row: Row, about: Mapping[str, Any]) -> bool:
    return bool(about) and all(row.get(name) == value for name, value in about.items())


def _measured(table_: ShapeTable, store: Store, stages: Sequence[float], count: int) -> Iterator[Row]:
    """Yield the distance of each method at each point and stage, and that of some samples."""
    points = balance.between(table_, count)
    samples = np.random.default_rng(0).permutation(table_.size)[:count].tolist()
    asked = [(point, method, method) for method in _METHODS for point in points]
    asked += [(table_.sample(i), "nearest", _SAMPLE) for i in samples]
    for stage in stages:
        for point, method, said in asked:
            found = balance.distance(SOLVER, table_, point, stage, method, store)
            failed = {"method": said, "stage": stage, "failed": True}
            yield {"point": point, **(failed if found is None else {**found.to_json(), "method": said})}


def table(record: Row) -> str:
    """Return, by family and stage, the default's figures over those of the others, which goals it misses, and where
    another does better.
    """
    head = ("family", "version", "s", "residual", *_CALLED.values(), "missed", "worse than")
    lines = []
    for run in record["runs"]:
        for stage in run["stages"]:
            found = {said: _mean(run["each"], stage, said) for said in (*_METHODS, _SAMPLE)}
            own = found[methods.DEFAULT]
            cells = [_cell(name, [getattr(one, name) for one in found.values()]) for name in _WANTED]
            residual = f"{own.residual_placed:.2f} to {own.residual:.0e}"
            missed = ", ".join(_short(name) for name in _WANTED if not _is_met(own, name)) or "-"
            worse = "; ".join(filter(None, (_worse(own, found[other], other) for other in _OTHERS))) or "-"
            lines.append([run["family"], run["version"], f"{stage:g}", residual, *cells, missed, worse])
    return markdown(head, lines)


def _mean(each: Sequence[Row], stage: float, method: str) -> Distance:
    rows = [row for row in each if row["stage"] == stage and row["method"] == method and not row.get("failed")]
    return balance.mean([Distance(**{k: v for k, v in row.items() if k != "point"}) for row in rows])


def _cell(name: str, values: Sequence[float]) -> str:
    form = "{:.3f}" if name == "rgh" else "{:.2f}"
    own, *others, sample = (form.format(value) for value in values)
    return f"{own}; {', '.join(others)}; {sample}"


def _short(name: str) -> str:
    return _CALLED[name].split(" [")[0]


def _off(found: Distance, name: str) -> float:
    value = float(getattr(found, name))
    return abs(value - 1) if name == "rgh" else value


def _is_met(own: Distance, name: str) -> bool:
    """Return whether a goal is met; what is as good as it when rounded is."""
    return round(_off(own, name), 3) <= _WANTED[name][own.stage > _EARLY]


def _worse(own: Distance, other: Distance, called: str) -> str:
    """Return which measures are worse than another method's, by more than a tenth of what is wanted."""
    names = [n for n in _WANTED if _off(own, n) > _off(other, n) + 0.1 * _WANTED[n][own.stage > _EARLY]]
    return f"{called}: {', '.join(map(_short, names))}" if names else ""


def _tier(root: Path) -> None:
    sheet = Sheet("dehydration-relaxed", _RELAXED, "dehydration")
    package = ShapeTable.open(ROOT, surfaces=registry.surface)
    thin, raisin, wolfberry = (
        ShapeTable.open(ROOT, name, surfaces=registry.surface) for name in (_THIN, "raisin", "wolfberry")
    )
    relaxed(SOLVER, package, package.at({"te": 0.04, "gamma": 10.0}, 0.1, resolution=_LATTICE))  # compiles
    corners = _corners(root)
    # the pattern that a fruit begins with is in the store of its runs, or in the package
    context = Context(library=Store.open(root).find)
    asked = (package, _FRUITS), (corners, _AT_PREVIEW), (thin, _QUARTERS), (raisin, _RAISINS), (wolfberry, _WOLFBERRIES)
    for table, fruits in asked:
        for fruit in fruits:
            _relax(sheet, table, context, *fruit)
    sheet.keep(digest=package.digest)


def _corners(root: Path) -> ShapeTable:
    """Return a family of whole fruits at preview about the default one's softer half."""
    written: dict[str, Any] = tomllib.loads((figures.ROOT / "examples" / "starter.toml").read_text(encoding="utf-8"))
    written["axes"], written["need"]["quality"] = _CORNERS, "preview"
    del written["pattern"]["controls"]
    plan, store = Plan.parse(written, "preview"), Store.open(root, create=True)
    with executors.serial() as executor:
        run_plan(plan, store, executor)
    tables.build(store, SOLVER, "preview", keys=[job.key for job in plan.jobs()])
    return ShapeTable.open(root, "preview", surfaces=registry.surface)


def _relax(sheet: Sheet, table: ShapeTable, context: Context, te: float, gamma: float, s: float) -> None:
    """Relax one fruit and add what became of it to the sheet."""
    asked = {"te": te, "gamma": gamma}
    shape = table.at({axis: asked[axis] for axis in table.axes}, s, resolution=_LATTICE)
    clock, begin = time.perf_counter(), time.process_time()
    found, said = relaxed(SOLVER, table, shape, context=context)
    seconds, cpu = time.perf_counter() - clock, time.process_time() - begin
    ends = [np.concatenate([one.position.reshape(-1, 3), one.poles]).astype(float) for one in (shape, found)]  # type: ignore[union-attr]
    pairs = crossings(ends[1], closed_lattice(_LATTICE)).count
    radii = [np.linalg.norm(one[:-2], axis=1) for one in ends]
    alike = float(np.corrcoef(radii)[0, 1])
    exact = _exact(SOLVER.parse(table.at_parameters({axis: asked[axis] for axis in table.axes})), s)
    volumes = [_volume(one) / exact for one in ends]
    sheet.add(
        (
            *(table.info.name, table.info.quality, f"{te:g}", f"{gamma:g}", f"{s:g}", f"{said['residual']:.1e}"),
            *(f"{said['iterations']:.0f}", f"{said['moved']:.2f}", f"{alike:.2f}", pairs),
            *(*(f"{v:.3f}" for v in volumes), f"{seconds:.2f}", f"{cpu:.2f}"),
        ),
        family=table.info.name, quality=table.info.quality, te=te, gamma=gamma, s=s, **said, corr=alike, pairs=pairs,
        volumes=volumes, cpu=cpu, clock=seconds, threads=get_num_threads(), converged=found.converged,
    )  # fmt: skip


def _volume(points: np.ndarray) -> float:
    """Return the volume within a closed lattice of points (n 2n + 2, 3)."""
    a, b, c = (points[closed_lattice(_LATTICE)[:, k]] for k in range(3))
    return abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6


def _exact(fruit: DehydrationParams, s: float) -> float:
    """Return the volume of an incompressible fruit at s, within lattices as what is delivered: only flesh shrinks."""
    theta, phi = lattice(_LATTICE)
    inner = fruit.sarcocarp(theta, phi)
    rays = inner / np.linalg.norm(inner, axis=-1, keepdims=True)
    layers = fruit.stone_distance(rays)[..., None] * rays, inner, fruit.surface(theta, phi)
    stone, flesh, whole = (
        _volume(np.concatenate([layer.reshape(-1, 3), layer[[0, -1]].mean(axis=1)])) for layer in layers
    )
    return stone + (flesh - stone) * (1 - s) ** 3 + whole - flesh


def sphere_volume(stone: float, te: float, s: float) -> float:
    """Return the volume of an incompressible sphere at s: only its flesh shrinks, neither skin nor stone."""
    return 4 / 3 * np.pi * ((1 - s) ** 3 * (1 - stone**3) + stone**3 + (1 + te) ** 3 - 1)


if __name__ == "__main__":
    main()
