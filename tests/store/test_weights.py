"""Weights of look-ups: exact at samples, without jumps, within the hull."""

from __future__ import annotations

import numpy as np
import pytest

from store.blending import methods
from store.blending.methods.weights import Samples

from ._wrinkled import grid


def test_linear_is_linear_in_the_logarithms() -> None:
    samples = grid()
    assert samples.is_grid
    for te, gamma in ((0.025, 17.0), (0.05, 90.0), (0.08, 33.0)):
        near = samples.weigh("linear", np.array([te, gamma]), 6, 2.0)
        assert near.weights.sum() == pytest.approx(1)
        assert (near.weights > 0).all()
        logs = near.weights @ np.log(samples.values[near.samples])
        np.testing.assert_allclose(np.exp(logs), [te, gamma], rtol=1e-12)


def test_every_weighting_hits_its_samples() -> None:
    samples = grid()
    for i, value in enumerate(samples.values):
        for weighting in methods.WEIGHTINGS:
            near = samples.weigh(weighting, value, 6, 2.0)
            assert (near.samples.tolist(), near.weights.tolist(), near.nearest) == ([i], [1.0], 0.0)


def test_scattered_weights_have_no_jumps() -> None:
    rng = np.random.default_rng(1)
    samples = Samples(rng.uniform(1, 2, (40, 2)))
    assert not samples.is_grid

    def dense(weighting: str, x: float) -> np.ndarray:
        near = samples.weigh(weighting, np.array([x, 1.5]), 6, 2.0)
        return np.bincount(near.samples, near.weights, 40)

    def largest(weighting: str, steps: int) -> float:
        rows = np.array([dense(weighting, x) for x in np.linspace(1.1, 1.9, steps)])
        return float(np.abs(np.diff(rows, axis=0)).max())

    assert largest("linear", 4001) < 0.3 * largest("linear", 1001)  # falls with the step
    assert largest("idw", 4001) > 0.5 * largest("idw", 1001)  # the paper's does not


def test_an_axis_through_zero_is_not_taken_by_logarithm() -> None:
    samples = Samples(np.array([[-1.0, 0.0], [1.0, 0.0], [-1.0, 2.0], [1.0, 2.0]]))
    near = samples.weigh("linear", np.array([0.0, 0.5]), 6, 2.0)
    np.testing.assert_allclose(near.weights @ samples.values[near.samples], [0, 0.5])


def test_the_hull_of_scattered_samples() -> None:
    samples = Samples(np.exp(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])))
    assert samples.contains(np.exp([0.3, 0.3]))
    assert samples.contains(np.exp([0.5, 0.5]))
    assert not samples.contains(np.exp([0.6, 0.6]))


def test_left_out_from_both_sides() -> None:
    samples = grid()
    middle = int(np.flatnonzero((samples.values == [0.04, 10.0]).all(axis=1))[0])
    near = samples.without(middle)
    np.testing.assert_allclose(samples.values[near.samples], [[0.02, 10], [0.08, 10]])
    np.testing.assert_allclose(near.weights, 0.5)
    corner = samples.without(0)
    assert 0 not in corner.samples
    assert corner.weights.sum() == pytest.approx(1)
    assert len(samples.adjacent()) == 3 + 4


@pytest.mark.parametrize("eta", [2.0, 28.0, 500.0])
def test_samples_as_far_as_the_next_one_share_evenly(eta: float) -> None:
    samples = Samples(np.array([[1.0, 1.0], [2.0, 1.0], [1.0, 2.0], [2.0, 2.0]]))
    near = samples.weigh("scattered", np.array([2**0.5, 2**0.5]), 2, eta)
    np.testing.assert_allclose(near.weights, 0.5)
