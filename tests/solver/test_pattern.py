"""Runs that start from a stored pattern: what is taken from it, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.special import sph_harm_y

from solver import registry
from solver.contract import Context, InvalidInput, Need
from solver.dehydration.fresh.pattern import pattern_heights
from solver.fruit import azimuths, colatitudes, directions

SOLVER = registry.get("dehydration")
KEY = "a" * 64


def wave(colatitude, azimuth):
    """A spherical harmonic of degree 12 with its largest value scaled to one."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, 721), np.linspace(0, 2 * np.pi, 721), indexing="ij")
    return sph_harm_y(12, 5, colatitude, azimuth).real / abs(sph_harm_y(12, 5, theta, phi).real).max()


def stored(amplitude=0.03, swell=0.02, n=64, solver="dehydration"):
    """A made-up result: a sphere that swelled by `swell` and waves by `amplitude` at s = 0.1, and is smooth at 0.05."""
    grid = colatitudes(n)[:, None], azimuths(n)[None, :]
    rays = directions(*grid)
    radial = np.stack([np.full((n, 2 * n), swell), swell + amplitude * wave(*grid)])
    return xr.Dataset(
        {"displacement": (("stage", "colatitude", "azimuth", "component"), (radial[..., None] * rays).astype("f4"))},
        {"stage": [0.05, 0.1]},
        {"solver": solver, "params": SOLVER.parse({"te": 0.03}).model_dump_json()},
    )


def params(stage=0.1, amplitude=0.2, **more):
    return SOLVER.parse({"te": 0.04, "pattern": {"key": KEY, "stage": stage, "amplitude": amplitude}, **more})


def context(result):
    return Context(library=lambda key: result if key == KEY else None)


def test_the_wrinkles_alone_are_taken_and_scaled_to_this_skin():
    points = np.random.default_rng(2).normal(size=(500, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    expected = 0.2 * 0.04 * wave(np.arccos(points[:, 1]), np.arctan2(points[:, 2], points[:, 0]))
    found = pattern_heights(params(), points, context(stored()))
    # the largest height is the largest on the lattice, which misses the crest by up to a quarter of a cell (1 %)
    scale = (found * expected).sum() / (expected**2).sum()
    assert 1 <= scale < 1.01
    # 128 samples around waves of degree 12: splines of third order err by less than 1e-3 of the height
    assert abs(found / scale - expected).max() < 1e-3 * 0.008
    assert np.allclose(pattern_heights(params(amplitude=0.1), points, context(stored())), found / 2)


@pytest.mark.parametrize(
    ("asked", "result", "message"),
    [
        (params(stage=0.2), stored(), "has no stage 0.2"),
        (params(stage=0.05), stored(), "is smooth at stage 0.05"),
        (params(), stored(solver="decay"), "no displacement of a dehydrated fruit"),
        (params(), stored().isel(azimuth=slice(0, 20)), "a part of the surface only"),
        (params(), None, "not in the store"),
    ],
    ids=["stage", "smooth", "solver", "region", "missing"],
)
def test_what_gives_no_pattern_is_refused(asked, result, message):
    with pytest.raises(InvalidInput, match=message) as caught:
        pattern_heights(asked, np.eye(3), context(result))
    assert caught.value.advice


def test_a_run_without_a_store_says_so_before_any_work():
    with pytest.raises(InvalidInput, match="there is no store here"):
        SOLVER.solve(params(), Need(stages=(0.3,), quality="preview"))


@pytest.mark.parametrize(("name", "value"), [("key", "../x"), ("amplitude", 0.0), ("amplitude", 3.0)])
def test_patterns_are_validated(name, value):
    with pytest.raises(InvalidInput, match=name):
        SOLVER.parse({"pattern": {"key": KEY, "stage": 0.1, name: value}})


@pytest.mark.slow
def test_neighbours_that_start_from_one_pattern_buckle_alike():
    need = Need(stages=(0.2,), quality="preview", fields=("displacement",))
    first = SOLVER.solve(SOLVER.parse({"te": 0.1, "gamma": 7}), need.model_copy(update={"stages": (0.2,)}))
    library = Context(library=lambda key: first)

    def wrinkles(te, **more):
        result = SOLVER.solve(SOLVER.parse({"te": te, "gamma": 7, **more}), need, library)
        rays = directions(result["colatitude"].values[:, None], result["azimuth"].values[None, :])
        radial = np.einsum("tpi,tpi->tp", result["displacement"].values[0], rays)
        weight = np.sin(result["colatitude"].values)[:, None]
        return weight**0.5 * (radial - (weight * radial).sum() / (2 * len(radial) * weight.sum()))

    def correlation(**more):
        a, b = wrinkles(0.09, **more), wrinkles(0.11, **more)
        return (a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum())

    warm = correlation(pattern={"key": KEY, "stage": 0.2, "amplitude": 0.2})
    assert warm > 0.8 > correlation()
