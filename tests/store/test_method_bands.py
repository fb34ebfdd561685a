"""What a spectrum between samples should be: it goes with the weights, also where these turn its quantiles round."""

from __future__ import annotations

import numpy as np

from solver.arrays import Array
from store.blending.methods.bands import Targets
from store.blending.methods.weights import Samples

PEAKS = (6.0, 14.0, 20.0)
DEGREES = np.arange(64)


def targets() -> Targets:
    """Three samples in a row, each with its power about one degree."""
    lines = [np.exp(-(np.log((DEGREES + 0.5) / peak) ** 2) / 0.02) for peak in PEAKS]
    return Targets(1e-3 * np.array(lines)[:, None], Samples(np.array([[10.0], [20.0], [40.0]])))


def test_no_target_jumps_as_weights_turn_negative() -> None:
    made = targets()
    even = np.full(len(made.bands.first), 1e-4)

    def gains(share: float) -> Array:
        weights = np.array([[1 + share], [-3 * share], [2 * share]])
        return made.gains(np.zeros(1), np.arange(3), weights, {0: 1.0}, even)

    shares = np.linspace(0, 1.5, 1001)
    found = np.array([gains(share) for share in shares])
    steps = np.abs(np.diff(found, axis=0)).max(axis=1)
    assert 1 < np.ptp(found, axis=0).max() < 5
    for at in np.argsort(steps)[-10:]:
        low, high = shares[at], shares[at + 1]
        for _ in range(24):
            middle = (low + high) / 2
            halves = np.abs(gains(middle) - gains(low)).max(), np.abs(gains(high) - gains(middle)).max()
            low, high = (low, middle) if halves[0] > halves[1] else (middle, high)
        assert np.abs(gains(high) - gains(low)).max() < 1e-4


def test_a_sample_has_its_own_spectrum() -> None:
    made = targets()
    power = np.exp(-(np.log((DEGREES + 0.5) / PEAKS[1]) ** 2) / 0.02) * 1e-3
    own = np.add.reduceat(power, made.bands.first)
    weights = np.array([[0.0], [1.0], [0.0]])
    place = Samples(np.array([[10.0], [20.0], [40.0]])).points[1]
    np.testing.assert_allclose(made.gains(place, np.arange(3), weights, {0: 1.0}, own), 1, atol=1e-3)
