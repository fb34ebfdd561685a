"""Results with a known answer: displacements are spherical harmonics whose coefficients are known functions."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.special import sph_harm_y

from solver import registry
from solver.contract import Need, finish
from solver.dehydration import SOLVER, DehydrationParams
from solver.fruit import azimuths, colatitudes, directions, lattice
from store import tables
from store.keys import key
from store.ledger.jobs import JobSpec
from store.lookup import ShapeTable
from store.store import Store

ROOT = Path(__file__).resolve().parents[2]
STAGES = (0.1, 0.2, 0.3)
TE, GAMMA = (0.03, 0.04, 0.05), (10.0, 20.0, 30.0)
MODES = ((3, 2), (5, 1), (6, 0))


def displacement(te: float, gamma: float, stage: float, resolution: int) -> np.ndarray:
    """Return u (n, 2n, 3): shrinkage, and three harmonics along the ray with amplitudes linear in te, gamma, |s|."""
    theta, phi = lattice(resolution)
    radial = -0.5 * stage
    for i, (degree, order) in enumerate(MODES):
        radial = radial + amplitude(i, te, gamma, stage) * sph_harm_y(degree, order, theta, phi).real
    return np.asarray(radial)[..., None] * directions(theta, phi)


def amplitude(i: int, te: float, gamma: float, stage: float) -> float:
    return 0.1 * abs(stage) * (1 + i + 5 * te - 0.01 * gamma)


def question(
    te: float = 0.04,
    gamma: float = 10.0,
    stages: Sequence[float] = STAGES,
    resolution: int = 16,
    quality: str = "default",
    region: dict[str, Any] | None = None,
    fields: Sequence[str] = ("displacement", "mean_radius", "roughness"),
    **params: Any,
) -> tuple[DehydrationParams, Need]:
    asked = {"fields": fields, "stages": stages, "resolution": resolution, "quality": quality, "region": region}
    values = SOLVER.parse({"te": te, "gamma": gamma, **params})
    assert isinstance(values, DehydrationParams)
    return values, SOLVER.settle(Need.parse(asked))


def answer(params: DehydrationParams, need: Need, seconds: float = 1.5) -> xr.Dataset:
    te, gamma = params.axis("te"), params.axis("gamma")
    n, stages = need.resolution or 0, np.array(need.stages)
    lattices = ("stage", "colatitude", "azimuth", "component")
    fields = np.stack([displacement(te, gamma, s, n) for s in stages]).astype(need.dtype)
    data: dict[str, Any] = {
        "displacement": (lattices, fields),
        "mean_radius": ("stage", 1 + te - 0.5 * stages),
        "roughness": (
            "stage",
            np.array([np.hypot.reduce([amplitude(i, te, gamma, s) for i in range(3)]) for s in stages]),
        ),
        "buckle_count": ("stage", np.arange(len(stages)) + 2),
        "converged": ("stage", np.ones(len(stages), np.int8)),
        "residual": ("stage", np.full(len(stages), 1e-4)),
        "iterations": ("stage", np.arange(len(stages)) * 100),
        "seconds": ("stage", np.arange(len(stages)) + seconds),
    }
    coords = {"stage": stages, "colatitude": colatitudes(n), "azimuth": azimuths(n), "component": ["x", "y", "z"]}
    return finish(xr.Dataset(data, coords, {"path": "march"}), SOLVER, params, need)


def make(**asked: Any) -> tuple[str, xr.Dataset]:
    params, need = question(**asked)
    return key(SOLVER.name, SOLVER.version, params, need), answer(params, need)


def spec(**asked: Any) -> JobSpec:
    params, need = question(**asked)
    return _spec(params, need)


def _spec(params: DehydrationParams, need: Need) -> JobSpec:
    name = key(SOLVER.name, SOLVER.version, params, need)
    return JobSpec(name, SOLVER.name, SOLVER.version, params.model_dump(mode="json"), need.model_dump(mode="json"))


def fill(store: Store, **grids: Any) -> list[str]:
    """Put a grid of results in the store and note them as done; lists are axes, other values are constant."""
    axes = {name: values for name, values in grids.items() if name in ("te", "gamma", "rs2")}
    rest = {name: value for name, value in grids.items() if name not in axes}
    keys = []
    points = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1).reshape(-1, len(axes))
    for point in points:
        asked = {**dict(zip(axes, map(float, point), strict=True)), **rest}
        params, need = question(**asked)
        job = _spec(params, need)
        store.ledger.want([job])
        store.ledger.done(store.ledger.claim("tester", 60, [job.key]), store.put(job.key, answer(params, need)), 1.0)
        keys.append(job.key)
    return keys


def python(code: str, *arguments: object, **options: Any) -> subprocess.Popen[str]:
    """Start a Python process in the repository, to be killed, raced or limited."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, **options)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(tmp_path / "store", create=True)


@pytest.fixture(scope="session")
def _filled_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    store = Store.open(tmp_path_factory.mktemp("filled") / "store", create=True)
    fill(store, te=TE, gamma=GAMMA)
    store.ledger.close()
    return store.root


@pytest.fixture
def filled(tmp_path: Path, _filled_once: Path) -> Store:
    """Return a store of its own with the results of the grid TE x GAMMA."""
    return Store.open(shutil.copytree(_filled_once, tmp_path / "filled"))


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> ShapeTable:
    """Return the table of `_wrinkled`; do not change it."""
    from ._wrinkled import wrinkled  # which asks what this module asks

    store = Store.open(tmp_path_factory.mktemp("rough"), create=True)
    wrinkled(store)
    tables.build(store, SOLVER)
    return ShapeTable.open(store, surfaces=registry.surface)


@pytest.fixture(scope="module")
def alike(tmp_path_factory: pytest.TempPathFactory) -> ShapeTable:
    """Return a table like `rough` whose patterns share more than half of their power; do not change it."""
    from ._wrinkled import wrinkled

    store = Store.open(tmp_path_factory.mktemp("alike"), create=True)
    wrinkled(store, shared=0.8)
    tables.build(store, SOLVER)
    return ShapeTable.open(store, surfaces=registry.surface)
