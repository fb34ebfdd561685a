"""Processor time of one look-up on one core: python -m benchmarks.service.lookup.

Rows go by resolution, by what is asked for (in the default method), and by method (positions).

The table is synthetic (30 samples, 5 stages, 96 waves of random smooth displacement that does not fold), because only
its size matters here; errors against finite-element runs are measured elsewhere. Its rows ask for one place again and
again; then come places at random, as a sweep asks for them, and all tables that come with wizen in turn at three levels
of detail, as a scene does: what is kept between questions is measured with them. Then shapes that fold, of the default
table that comes with wizen at random places: what putting them apart takes hangs on how they fold.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from itertools import pairwise, product
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from benchmarks.figures import keep
from solver import registry
from solver.contract import Need, Params, finish
from solver.dehydration import SOLVER
from solver.fruit import azimuths, colatitudes
from store import starter, tables
from store.blending import methods
from store.ledger.jobs import JobSpec
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import drawn, spectra, transforms
from store.surfaces.apart import compiled

BAND = 96
STAGES = (0.1, 0.15, 0.2, 0.25, 0.3)
QUERY = {"te": 0.0317, "gamma": 23.0}
STAGE = 0.17
#: Size of the longest waves [r1]: none of their sums faces inwards.
_HEIGHT = 3e-5
#: Stages at which a shape that folds is asked for, and places of each.
_FOLDED, _PLACES = (0.2, 0.25, 0.3), 12
#: Places at random; turns through the tables of the package, and the stage asked for there (displacements: none is put
#: out of contact).
_RANDOM, _TURNS, _TURNED = 500, 6, 0.22
_WANDERING, _IN_TURN = "unfolded, places at random", "displacements, all tables in turn"
#: Tables of the package in which many runs take part in an answer, and stages between stored ones at which they do.
_DENSE, _BETWEEN = ("default", "plum2"), (0.125, 0.175)


def smooth(rng: np.random.Generator, stages: int, band: int) -> np.ndarray:
    """Return (stage, n, 2n, 3) random fields whose spectra fall like wrinkles' do, steeply beyond wave 40."""
    k = np.arange(band + 1)
    decay = np.exp(-((np.hypot(k[:, None], k) / 40) ** 2))[..., None] * _HEIGHT
    shape = (stages, band + 1, band + 1, 3)
    waves = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * decay
    # waves of any m at the poles would fold there
    return (spectra.synthesize(waves, band) * np.sin(colatitudes(band))[:, None, None] ** 2).astype(np.float32)


def put(store: Store, params: Params, need: Need, rng: np.random.Generator) -> None:
    """Put a made-up result into the store: the displacement, and any number of each stage that the need names."""
    band = need.resolution or BAND
    coords = {
        "stage": np.array(need.stages),
        "colatitude": colatitudes(band),
        "azimuth": azimuths(band),
        "component": ["x", "y", "z"],
    }
    moved = smooth(rng, len(need.stages), band)
    data: dict[str, Any] = {"displacement": (("stage", "colatitude", "azimuth", "component"), moved)}
    data |= {name: ("stage", 0.1 * rng.random(len(moved))) for name in need.fields or () if name != "displacement"}
    result = finish(xr.Dataset(data, coords), SOLVER, params, need)
    job = JobSpec.of(SOLVER, params, need)
    store.ledger.want([job])
    store.ledger.done(store.ledger.claim("benchmark", 60.0, [job.key]), store.put(job.key, result), 0.0)


def fill(store: Store) -> None:
    """Put 30 made-up results into the store."""
    rng = np.random.default_rng(0)
    need = SOLVER.settle(Need(fields=("displacement",), stages=STAGES, resolution=BAND))
    for te in np.linspace(0.02, 0.06, 5):
        for gamma in np.linspace(10, 60, 6):
            put(store, SOLVER.parse({"te": te, "gamma": gamma}), need, rng)


def median(call: Callable[[], Any], seconds: float = 1.0) -> float:
    """Return the median processor time [ms] of calls over about `seconds`, after a warm-up."""
    for _ in range(3):
        call()
    times: list[float] = []
    while sum(times) < seconds and len(times) < 1000:
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return statistics.median(times) * 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=1.0, help="per figure")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory() as directory:
        store = Store.open(directory, create=True)
        fill(store)
        start = time.perf_counter()
        built = tables.build(store, SOLVER)
        print(f"build: {built.samples} samples in {time.perf_counter() - start:.2f} s")
        start = time.perf_counter()
        table = ShapeTable.open(store, surfaces=registry.surface)
        # as a service is, which has others to answer
        compiled()
        threadpool_limits(1, user_api="blas")
        print(f"open and verify: {(time.perf_counter() - start) * 1e3:.1f} ms")
        rows = []
        for n in (32, 64, 96, 128, 256, 512):
            for what, options_ in {
                "position": {"m": 8},
                "displacement": {"m": 8, "fields": ("displacement",), "apart": False},
                "both": {"m": 8, "fields": ("position", "displacement")},
            }.items():
                ms = median(lambda n=n, o=options_: table.at(QUERY, STAGE, resolution=n, **o), options.seconds)
                rows.append({"resolution": n, "what": what, "ms": round(ms, 4)})
            for method in methods.NAMED:
                ms = median(lambda n=n, o=method: table.at(QUERY, STAGE, resolution=n, m=8, method=o), options.seconds)
                rows.append({"resolution": n, "what": method, "ms": round(ms, 4)})
            shape = table.at(QUERY, STAGE, resolution=n, m=8)
            ms = median(lambda s=shape: drawn.normals(s.position, s.poles), options.seconds)
            rows.append({"resolution": n, "what": "normals", "ms": round(ms, 4)})
        ms = median(lambda: table.at(QUERY, STAGE, m=8, fields=()), options.seconds)
        rows.append({"resolution": 0, "what": "descriptors only", "ms": round(ms, 4)})
        rows += _wandering(table)
    rows += _in_turn() + [_first_in_cells(name) for name in _DENSE] + _folded()
    print(f"fft: {transforms.backend()}, one core, medians [ms of processor]")
    for row in rows:
        print(f"{row['resolution']:>5} {row['what']:<28} {row['ms']:9.3f}")
    usual = {row["resolution"]: row["ms"] for row in rows if row["what"] == "position"}
    head = ["lattice", *(f"{n} x {2 * n}" for n in usual)]
    cells = []
    shown = {name: name for name in (_WANDERING, _IN_TURN, *map(_first, _DENSE))}
    for what, told in {"position": "unfolded, one place", **shown}.items():
        found = {row["resolution"]: row["ms"] for row in rows if row["what"] == what}
        cells.append([f"{told}, ms", *(f"{found[n]:.2f}" if n in found else "" for n in usual)])
    for s in _FOLDED:
        found = {row["resolution"]: row["ms"] for row in rows if row["what"] == _name(s)}
        cells.append([f"{_name(s)}, ms", *(f"{found[n]:.1f}" if n in found else "" for n in usual)])
    keep("service-lookup", rows, fft=transforms.backend(), table={"head": head, "rows": cells})


def _wandering(table: ShapeTable) -> list[dict[str, Any]]:
    """Return rows of the means over places and stages at random, after as many to fill what is kept."""
    rng, rows = np.random.default_rng(0), []
    for n in (32, 64, 128):
        times = []
        for _ in range(2 * _RANDOM):
            point = {name: float(rng.uniform(*span)) for name, span in table.axes.items()}
            times.append(_once(table, point, float(rng.uniform(STAGES[0], STAGES[-1])), resolution=n))
        rows.append(_row(n, _WANDERING, times[_RANDOM:]))
    return rows


def _in_turn() -> list[dict[str, Any]]:
    """Return rows of the means over the tables of the package, each asked at three resolutions in turn."""
    store, rng, times = Store.open(starter.ROOT), np.random.default_rng(0), defaultdict(list)
    opened = [ShapeTable.open(store, name, surfaces=registry.surface) for name in store.table_names()]
    for turn in range(_TURNS):
        for n in (32, 64, 128):
            for table in opened:
                point = {name: float(rng.uniform(*span)) for name, span in table.axes.items()}
                stage = min(_TURNED, max(table.stages))
                ms = _once(table, point, stage, resolution=n, fields=("displacement",), apart=False)
                if turn > 1:
                    times[n].append(ms)
    return [_row(n, _IN_TURN, found) for n, found in times.items()]


def _first(name: str) -> str:
    return f"displacements, first in a cell of {name}"


def _first_in_cells(name: str) -> dict[str, Any]:
    """Return a row of the median over the middles of a table's cells, each asked once, after one at another stage."""
    table = ShapeTable.open(Store.open(starter.ROOT), name, surfaces=registry.surface)
    ticks = {axis: sorted({table.sample(i)[axis] for i in range(table.size)}) for axis in table.axes}
    middles = {axis: [(a + b) / 2 for a, b in pairwise(values)] for axis, values in ticks.items()}
    points = [dict(zip(middles, values, strict=True)) for values in product(*middles.values())]
    options: dict[str, Any] = {"resolution": 64, "fields": ("displacement",), "apart": False}
    table.at(points[0], table.stages[0], **options)
    times = [_once(table, point, stage, **options) for stage in _BETWEEN for point in points]
    runs = [len(table.at(point, stage, **options).weights) for stage in _BETWEEN for point in points]
    ms, worst = round(statistics.median(times), 3), round(max(times), 3)
    return {"resolution": 64, "what": _first(name), "ms": ms, "worst": worst, "times": len(times), "runs": runs}


def _once(table: ShapeTable, point: dict[str, float], stage: float, **options: Any) -> float:
    """Return the processor time [ms] of one look-up."""
    start = time.process_time()
    table.at(point, stage, **options)
    return 1e3 * (time.process_time() - start)


def _row(n: int, what: str, times: list[float]) -> dict[str, Any]:
    mean, late = statistics.fmean(times), float(np.quantile(times, 0.99))
    return {"resolution": n, "what": what, "ms": round(mean, 4), "p99": round(late, 4), "times": len(times)}


def _name(s: float) -> str:
    return f"in the package, s = {s:g}"


def _folded() -> list[dict[str, Any]]:
    """Return rows of the medians over places in the package's table, each asked for once after a warm-up."""
    table, rng = ShapeTable.open(starter.ROOT, surfaces=registry.surface), np.random.default_rng(1)
    points = [{name: float(rng.uniform(*span)) for name, span in table.axes.items()} for _ in range(_PLACES)]
    rows = []
    for s in _FOLDED:
        for n in (64, 128, 256):
            for point in points:  # as a slider that goes to and fro: what is kept is there
                table.at(point, s, resolution=n)
            times, crossing = [], 0
            for point in points:
                start = time.process_time()
                crossing += table.at(point, s, resolution=n).crossings or 0
                times.append(1e3 * (time.process_time() - start))
            row = {"ms": round(statistics.median(times), 3), "worst": round(max(times), 3), "crossing": crossing}
            rows.append({"resolution": n, "what": _name(s), **row})
    return rows


if __name__ == "__main__":
    main()
