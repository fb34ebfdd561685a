"""What gains add at the poles: nothing where waves of that order cannot be, all elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import sph_harm_y

from solver.fruit import azimuths, colatitudes
from store.blending.methods.poles import highest_degree, multiply
from store.surfaces import spectra

N = 48


def added(waves: np.ndarray, degree: int) -> np.ndarray:
    """What doubling all waves adds."""
    doubled = waves.copy()
    multiply(doubled, np.full(waves.shape[1:], 2.0), degree)
    return doubled - waves


@pytest.mark.parametrize(("degree", "order"), [(6, 0), (9, 1), (20, 2), (20, 8), (20, 20), (30, 15)])
def test_harmonics_pass(degree: int, order: int) -> None:
    field = sph_harm_y(degree, order, colatitudes(N)[:, None], azimuths(N)[None, :]).real[..., None].repeat(3, axis=-1)
    waves = np.moveaxis(spectra.truncate(spectra.spectrum(field), 40), -1, 0)
    kept = added(np.ascontiguousarray(waves), 38)
    # where the window cuts, sin(colatitude) < m / 38, harmonics up to degree 30 have lost all but a hundredth
    assert np.linalg.norm(kept - waves) < 0.02 * np.linalg.norm(waves)


def test_no_star_is_left_at_the_pole() -> None:
    waves = np.zeros((1, 41, 41), complex)
    waves[0, 20, 0] = 1  # cos(20 azimuth) right up to the poles
    field = spectra.synthesize(added(waves, 38)[0], N)
    close = np.sin(colatitudes(N)) < 0.25  # waves m = 20 of degree 38 end at 0.3
    assert abs(field[close]).max() < 0.02
    equator = np.sin(colatitudes(N)) > 0.6
    assert np.allclose(field[equator], 2 * np.cos(20 * azimuths(N)), atol=0.02)


def test_the_highest_degree_holds_nearly_all_power() -> None:
    power = np.zeros((2, 3, 60))
    power[..., 4] = 1.0
    power[1, 2, 31] = 0.01
    power[0, 1, 50] = 1e-4
    assert highest_degree(power) == 32
    assert highest_degree(np.zeros((1, 1, 60))) == 1
