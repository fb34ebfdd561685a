"""The weightings `thin` and `lean` against thin-plate splines and correlations of other code."""

from __future__ import annotations

import numpy as np
import pytest

from solver.fruit import directions, lattice
from store.blending.methods.bands import Bands
from store.blending.methods.lean import leaning
from store.blending.methods.products import Products
from store.blending.methods.thin import Thin
from store.blending.methods.weights import Samples
from store.errors import OutsideTable
from store.lookup import ShapeTable

from ._thin import NODES, agreement, bilinear, leant, mixture
from ._wrinkled import N, own
from .conftest import GAMMA, TE

SHARED = 0.8
POINTS = [(0.0331, 14.2), (0.0476, 27.7), (0.0412, 21.3), (0.04, 13.0)]


def found(table: ShapeTable, te: float, gamma: float, s: float, method: str = "thin") -> np.ndarray:
    shape = table.at({"te": te, "gamma": gamma}, s, fields=("displacement",), method=method, resolution=N)
    assert shape.displacement is not None
    return shape.displacement


def test_the_tables_patterns_are_between_alike_and_not() -> None:
    shares = [agreement(*node, SHARED) for node in NODES]
    assert 0.05 < min(shares) < max(shares) < 0.95
    assert max(agreement(*node, 0.0) for node in NODES) == 0


@pytest.mark.parametrize("method", ["thin", "lean"])
@pytest.mark.parametrize(("te", "gamma"), POINTS)
def test_splines_count_as_far_as_neighbours_agree(alike: ShapeTable, te: float, gamma: float, method: str) -> None:
    weights, part = mixture(te, gamma, SHARED, method == "lean")
    assert 0.05 < part < 0.95
    radial = sum(w * own(i, j, SHARED) for w, (i, j) in zip(weights, NODES, strict=True))
    exact = 0.17 * (radial - 0.5)[..., None] * directions(*lattice(N))
    np.testing.assert_allclose(found(alike, te, gamma, 0.17, method), exact, atol=5e-7)
    assert np.abs(found(alike, te, gamma, 0.17, "linear") - exact).max() > 1e-4
    said = alike.at({"te": te, "gamma": gamma}, 0.17, fields=(), method=method).weights
    assert sum(said.values()) == pytest.approx(1)
    assert sorted(said.values()) == pytest.approx(sorted(weights), abs=1e-5)  # a table holds likeness to five digits


@pytest.mark.parametrize(("te", "gamma"), POINTS)
def test_patterns_that_are_unlike_are_left_to_linear_weights(rough: ShapeTable, te: float, gamma: float) -> None:
    for method in ("", "+LL+env"):
        both = [found(rough, te, gamma, 0.17, name + method) for name in ("thin", "linear")]
        np.testing.assert_array_equal(both[0], both[1])


@pytest.mark.parametrize(("te", "gamma"), POINTS)
def test_patterns_that_are_unlike_lean_to_the_nearest(rough: ShapeTable, te: float, gamma: float) -> None:
    plain, weights = bilinear(te, gamma), leant(bilinear(te, gamma), 0.0)
    assert (weights > 0).sum() < (plain > 0).sum()
    radial = sum(w * own(i, j) for w, (i, j) in zip(weights, NODES, strict=True))
    exact = 0.17 * (radial - 0.5)[..., None] * directions(*lattice(N))
    np.testing.assert_allclose(found(rough, te, gamma, 0.17, "lean"), exact, atol=5e-7)


def test_a_sample_in_reach_is_all_there_is(rough: ShapeTable) -> None:
    te, gamma = TE[1] * 1.04, GAMMA[1] * 1.04
    near, at = (found(rough, *place, 0.2, "lean") for place in ((te, gamma), (TE[1], GAMMA[1])))
    np.testing.assert_allclose(near, at, atol=1e-7)


def test_weights_that_lean_change_no_faster_than_they_may(rough: ShapeTable) -> None:
    """From sample to sample across a cell, five times as fast as linear ones at most, and they do where they change."""
    samples = Samples(np.array([(te, gamma) for te in TE for gamma in GAMMA]))
    steps = np.linspace(0, 1, 401)
    rows = []
    for part in steps:
        near = samples.weigh("lean", samples.unscale(np.array([0.3, part])), 6, 2.0)
        weights = leaning(near.weights, np.array([0.0, 1.0]))
        np.testing.assert_allclose(weights[:, 1], near.weights, atol=1e-12)
        rows.append([np.bincount(near.samples, w, 9) for w in (weights[:, 0], near.weights)])
    fastest = [float(np.linalg.norm(np.diff(row, axis=0), axis=1).max()) for row in np.moveaxis(np.array(rows), 1, 0)]
    assert 3 < fastest[0] / fastest[1] < 5 + 1e-9
    assert np.array(rows)[:, 0].min() >= 0
    np.testing.assert_allclose(np.array(rows).sum(axis=-1), 1)


@pytest.mark.parametrize("method", ["thin", "thin+LL+env", "lean", "lean+LL+env"])
def test_no_jumps_where_splines_count(alike: ShapeTable, method: str) -> None:
    at_node, between = (TE[1], GAMMA[1], 0.2), (0.036, 14.0, 0.2)
    for te, gamma, stage in (at_node, (TE[1], 14.0, 0.15), between, (0.036, GAMMA[1], 1e-5)):
        at = found(alike, te, gamma, stage, method)
        for step in ((1e-8, 0, 0), (-1e-8, 0, 0), (0, 1e-5, 0), (0, -1e-5, 0), (0, 0, 1e-6), (0, 0, -1e-6)):
            moved = found(alike, te + step[0], gamma + step[1], stage + step[2], method)
            assert np.abs(moved - at).max() < 1e-5
    np.testing.assert_allclose(found(alike, *at_node, method), found(alike, *at_node, "nearest"), atol=1e-7)


def test_what_is_left_out_takes_no_part(alike: ShapeTable) -> None:
    middle = NODES.index((1, 1))
    i = next(k for k in range(9) if alike.sample(k) == {"te": TE[1], "gamma": GAMMA[1]})
    predicted = alike.left_out(i, 0.2, "thin", N)
    fields = [0.2 * (own(*node, SHARED) - 0.5) for node in NODES]
    radial = np.einsum("tpi,tpi->tp", predicted, directions(*lattice(N)))
    rows = [field.ravel() for k, field in enumerate(fields) if k != middle]
    weights, *_ = np.linalg.lstsq(np.array(rows).T, radial.ravel(), rcond=None)
    np.testing.assert_allclose(weights @ np.array(rows), radial.ravel(), atol=1e-6)
    assert weights.sum() == pytest.approx(1, abs=1e-4)
    assert (weights > 0.01).all()  # linear weights leave the corners out


def test_large_tables_have_a_spline_at_every_sample() -> None:
    te, gamma = np.meshgrid(np.geomspace(0.02, 0.06, 6), np.geomspace(10, 60, 6), indexing="ij")
    samples = Samples(np.stack([te.ravel(), gamma.ravel()], axis=-1))
    same = np.random.default_rng(0).standard_normal((1, 1, 3, 9, 9, 2)).astype(np.float32)
    thin = Thin(Products(np.repeat(same, 36, axis=0), Bands(8)), samples)
    places = np.random.default_rng(1).uniform(0, 1, (40, 2))

    def dense(place: np.ndarray) -> np.ndarray:
        query = samples.unscale(place)
        near = samples.weigh("thin", query, 6, 2.0)
        mixed = thin.mix(near, samples.scale(query), [0])
        assert len(mixed.samples) < 36
        assert mixed.lossy == pytest.approx(0, abs=1e-6)
        return np.bincount(mixed.samples, mixed.weights[:, 0], 36)

    for place in places:
        weights = dense(place)
        assert weights.sum() == pytest.approx(1)
        np.testing.assert_allclose(weights @ samples.points, place, atol=1e-9)
        # a spline follows what bends, where a linear mean cuts the corner
        assert weights @ (samples.points[:, 0] ** 2) == pytest.approx(place[0] ** 2, abs=0.012)
    # at a sample, where no spline is asked, no more is lost than beside it
    at = np.array([te[2, 3], gamma[2, 3]])
    near = samples.weigh("thin", at, 6, 2.0)
    assert near.samples.tolist() == [15]
    assert thin.mix(near, samples.scale(at), [0]).lossy == pytest.approx(0, abs=1e-6)
    line = np.stack([np.linspace(0.15, 0.45, 4001), np.full(4001, 0.37)], axis=-1)
    rows = np.array([dense(place) for place in line])
    assert np.abs(np.diff(rows, axis=0)).max() < 4e-3


def test_a_table_on_a_line_of_two_is_linear(rough: ShapeTable) -> None:
    samples = Samples(np.array([[1.0], [2.0]]))
    thin = Thin(Products(np.ones((2, 1, 3, 9, 9, 2), np.float32), Bands(8)), samples)
    near = samples.weigh("thin", np.array([1.3]), 6, 2.0)
    np.testing.assert_allclose(thin.mix(near, samples.scale(np.array([1.3])), [0]).weights[:, 0], near.weights)
    with pytest.raises(OutsideTable, match="did you mean 'thin'"):
        rough.at({"te": 0.04, "gamma": 20}, 0.2, method="thim")
