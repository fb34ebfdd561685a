"""The random bumps of a fresh fruit have no waves that a mesh cannot carry."""

import numpy as np
import pytest

from solver.dehydration.fresh.imperfection import bumps


@pytest.mark.parametrize("highest", [12.0, 30.0])
def test_waves_above_the_highest_are_left_out(highest):
    """Along a great circle a plane wave of wavenumber k has orders up to k; its Bessel functions vanish beyond."""
    angle = np.arange(512) * 2 * np.pi / 512
    circle = np.column_stack([np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)])
    whole, smooth = (np.abs(np.fft.rfft(bumps(circle, np.random.default_rng(3), h))) for h in (130.0, highest))
    beyond = int(1.5 * highest) + 15
    assert smooth[beyond:].max() < 1e-6 * smooth.max()
    assert whole[beyond:].max() > 0.1 * whole.max()
    assert smooth[: int(highest)].max() > 0.1 * whole.max()
