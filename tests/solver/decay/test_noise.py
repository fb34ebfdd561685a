"""Patches against the moments of an even distribution."""

import numpy as np
import pytest

from solver.decay.fields.noise import patches


def test_patches_are_evenly_distributed():
    """Mean 0 and mean square 1/3, as of all that is even in (-1, 1), at places far apart of many fields."""
    far = 1e3 * np.random.default_rng(0).normal(size=(40, 3))
    values = np.concatenate([patches(far, 0.5, np.random.default_rng(seed)) for seed in range(500)])
    assert values.mean() == pytest.approx(0, abs=0.02)
    # a cosine's square has the mean 1/2; 64 of them are Gaussian but for a hundredth of their fourth moment
    assert np.square(values).mean() == pytest.approx(1 / 3, abs=0.01)
