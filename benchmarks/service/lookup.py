"""Processor time of one look-up on one core: python -m benchmarks.service.lookup.

Rows go by resolution, by what is asked for (in the default method), and by method (positions).

The table is synthetic (30 samples, 5 stages, 96 waves of random smooth displacement), because only its size matters
here; errors against finite-element runs are measured elsewhere.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.figures import keep
from solver import registry
from solver.contract import Need, Params, finish
from solver.dehydration import SOLVER
from solver.fruit import azimuths, colatitudes
from store import tables
from store.blending import methods
from store.ledger.jobs import JobSpec
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import spectra, surface, transforms

BAND = 96
STAGES = (0.1, 0.15, 0.2, 0.25, 0.3)
QUERY = {"te": 0.0317, "gamma": 23.0}
STAGE = 0.17


def smooth(rng: np.random.Generator, stages: int, band: int) -> np.ndarray:
    """Return (stage, n, 2n, 3) random fields whose spectra fall like wrinkles' do, steeply beyond wave 40."""
    k = np.arange(band + 1)
    decay = np.exp(-((np.hypot(k[:, None], k) / 40) ** 2))[..., None] * 1e-3
    shape = (stages, band + 1, band + 1, 3)
    waves = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * decay
    return spectra.synthesize(waves, band).astype(np.float32)


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
        print(f"open and verify: {(time.perf_counter() - start) * 1e3:.1f} ms")
        rows = []
        for n in (32, 64, 96, 128, 256, 512):
            for what, options_ in {
                "position": {"m": 8},
                "displacement": {"m": 8, "fields": ("displacement",)},
                "both": {"m": 8, "fields": ("position", "displacement")},
            }.items():
                ms = median(lambda n=n, o=options_: table.at(QUERY, STAGE, resolution=n, **o), options.seconds)
                rows.append({"resolution": n, "what": what, "ms": round(ms, 4)})
            for method in methods.NAMED:
                ms = median(lambda n=n, o=method: table.at(QUERY, STAGE, resolution=n, m=8, method=o), options.seconds)
                rows.append({"resolution": n, "what": method, "ms": round(ms, 4)})
            shape = table.at(QUERY, STAGE, resolution=n, m=8)
            ms = median(lambda s=shape: surface.normals(s.position), options.seconds)
            rows.append({"resolution": n, "what": "normals", "ms": round(ms, 4)})
        ms = median(lambda: table.at(QUERY, STAGE, m=8, fields=()), options.seconds)
        rows.append({"resolution": 0, "what": "descriptors only", "ms": round(ms, 4)})
    print(f"fft: {transforms.backend()}, one core, medians [ms of processor]")
    for row in rows:
        print(f"{row['resolution']:>5} {row['what']:<17} {row['ms']:9.3f}")
    usual = {row["resolution"]: row["ms"] for row in rows if row["what"] == "position"}
    head = ["lattice", *(f"{n} x {2 * n}" for n in usual)]
    cells = ["ms", *(f"{ms:.2f}" for ms in usual.values())]
    keep("service-lookup", rows, fft=transforms.backend(), table={"head": head, "rows": [cells]})


if __name__ == "__main__":
    main()
