"""What is relaxed at once and what a job relaxes are one shape: the same start, the same points, the same poles."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import xarray as xr

from solver import registry
from solver.arrays import Floats
from solver.contract import Context, Need, Params, Start
from solver.dehydration import SOLVER
from solver.lattice import azimuths, colatitudes, directions, lattice
from store.lookup import ShapeTable
from store.starter import ROOT
from store.surfaces import spectra
from sweeps.outputs import of_result
from sweeps.relaxing import begun as begun_at
from sweeps.relaxing import lattice_of, looked_up, relaxed

POINT, STAGE = {"te": 0.034, "gamma": 22.0}, 0.2


@pytest.mark.parametrize("resolution", [None, 16])
def test_what_is_relaxed_starts_and_ends_as_in_a_job(resolution: int | None) -> None:
    table = ShapeTable.open(ROOT, surfaces=registry.surface)
    begun: list[Floats] = []
    results: list[xr.Dataset] = []

    def relax(_: Params, position: Floats, stage: float, need: Need, __: Context, steps: int | None) -> xr.Dataset:
        begun.append(position)
        n = need.resolution or 0
        theta, phi = lattice(n)
        # steep at the poles, where the mean of a ring is another place than the end of the waves
        bumps = 1 + 0.1 * np.cos(6 * theta) + 0.02 * np.cos(phi) * np.sin(theta)
        where = (directions(theta, phi) * bumps[..., None])[None].astype(np.float32)
        dims = ("stage", "colatitude", "azimuth", "component")
        numbers = dict.fromkeys(
            (*need.fields, "residual", "moved", "iterations", "seconds", "converged"), ("stage", [1.0])
        )
        made = {**numbers, "position": (dims, where), "displacement": (dims, 0 * where)}
        coords = {"stage": [stage], "colatitude": colatitudes(n), "azimuth": azimuths(n), "component": ["x", "y", "z"]}
        results.append(xr.Dataset(made, coords, {"path": "relaxed"}))
        return results[-1]

    shape = table.at(POINT, STAGE, resolution=resolution)
    found, _ = relaxed(replace(SOLVER, relax=relax), table, shape)
    own = table.at(POINT, STAGE).position
    assert own is not None
    assert begun[0].shape == (lattice_of(table), 2 * lattice_of(table), 3)
    assert np.array_equal(begun[0], begun_at(table, POINT, STAGE, shape.method, lattice_of(table)))
    waves = spectra.truncate(spectra.spectrum(begun[0]), table.resolution)
    assert np.abs(spectra.synthesize(waves, table.resolution) - own).max() < 1e-6
    assert np.array_equal(begun_at(table, POINT, STAGE, shape.method), np.asarray(own, float))
    job = of_result(results[0], shape.parameters, 0)
    assert found.position is not None
    assert found.poles is not None
    assert job.position is not None
    assert job.poles is not None
    assert found.position.shape == (resolution or table.resolution, 2 * (resolution or table.resolution), 3)
    assert found.position.tobytes() == job.position.tobytes()
    assert found.poles.tobytes() == job.poles.tobytes()
    assert found.crossings == job.crossings
    assert found.tier == job.tier == "relaxed"
    assert (found.exact, job.exact) == (False, False)
    assert math.isnan(job.nearest)
    start = Start(table="default", digest=table.digest, method=shape.method)
    said = looked_up(table, start, table.at_parameters(shape.parameters), STAGE, len(found.position))
    assert replace(job, **said).trust() == found.trust()
    assert said["weights"] == found.weights
    # the fresh shape is in balance as it is
    fresh = table.at(POINT, 0.0, resolution=resolution)
    assert relaxed(replace(SOLVER, relax=relax), table, fresh) == (fresh, {})
    assert (fresh.exact, fresh.tier, len(begun)) == (True, "table", 1)
    # the closed form of the waves, of which the rings' means are off by more than they could by rounding
    assert np.allclose(found.poles, [[0, 1.1, 0], [0, -1.1, 0]], atol=1e-4)


@pytest.mark.parametrize(("own", "laid"), [(48, 192), (300, 1024), (1024, 1024)])
def test_what_is_laid_on_the_mesh_is_finer_within_what_a_start_may_be(own: int, laid: int) -> None:
    table = cast("ShapeTable", SimpleNamespace(resolution=own))
    assert lattice_of(table) == laid
    assert Start(table="one", digest="d", method="idw", lattice=lattice_of(table)).lattice == laid


def test_a_start_without_a_lattice_is_written_as_before_there_was_one() -> None:
    """Keys of what was stored then stay."""
    start = Start(table="one", digest="d", method="idw")
    assert Need(start=start).model_dump()["start"] == {"table": "one", "digest": "d", "method": "idw"}
    assert Need.parse({"start": start.model_dump()}).start == start
