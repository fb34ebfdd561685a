"""Shapes with known answers: wrinkles that are scaled, shifted in degree, turned, or not there at all."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import sph_harm_y

from solver.fruit import Fruit, directions, lattice
from store.surfaces import harmonics, spectra
from store.surfaces.measures import Measures, Surface, compare, mean

N = 48
THETA, PHI = lattice(N)
RAYS = directions(THETA, PHI)
FRESH = Fruit.parse({"te": 0.04}).surface(THETA, PHI)
PERFECT = Measures(1, 0, 0, 0, 0, 0, 1)


def wave(degree: int, order: int, phase: float = 0.0) -> np.ndarray:
    """A harmonic of mean square 1 (for order > 0)."""
    return np.sqrt(8 * np.pi) * sph_harm_y(degree, order, THETA, PHI + phase).real


def surface(radial: np.ndarray) -> Surface:
    return Surface(FRESH, (radial - 0.1)[..., None] * RAYS)


def test_the_truth_is_perfect() -> None:
    truth = surface(0.02 * wave(9, 4))
    np.testing.assert_allclose(compare(truth, truth), PERFECT, atol=1e-5)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_scaled_wrinkles(factor: float) -> None:
    found = compare(surface(factor * 0.01 * wave(9, 4)), surface(0.01 * wave(9, 4)))
    assert found.rgh == pytest.approx(factor, rel=1e-3)
    assert found.dB == pytest.approx(abs(20 * np.log10(factor)), rel=1e-3)
    assert found.L2nr == pytest.approx(abs(factor - 1), rel=1e-3)
    assert found.corr == pytest.approx(1, abs=1e-3)
    assert found.W1 > 0.5
    assert found.ang > 0.5


def test_turned_wrinkles_are_the_same_surface_elsewhere() -> None:
    found = compare(surface(0.02 * wave(9, 4, np.pi / 8)), surface(0.02 * wave(9, 4)))
    assert found.rgh == pytest.approx(1, abs=1e-6)
    assert found.dB == pytest.approx(0, abs=1e-6)
    assert found.W1 < 1e-3
    assert found.patch == pytest.approx(0, abs=1e-6)
    assert found.corr == pytest.approx(0, abs=1e-3)
    assert found.L2nr == pytest.approx(np.sqrt(2), rel=1e-3)
    assert found.ang > 5


def test_a_smooth_surface_has_no_roughness() -> None:
    found = compare(surface(np.zeros_like(THETA)), surface(0.02 * wave(9, 4)))
    assert found.rgh < 0.01
    assert found.dB == pytest.approx(30)
    assert found.L2nr == pytest.approx(1, rel=1e-3)
    both = compare(surface(np.zeros_like(THETA)), surface(np.zeros_like(THETA)))
    np.testing.assert_allclose(both, PERFECT, atol=1e-5)


def test_size_shift_and_ellipticity_are_no_wrinkles() -> None:
    low = 0.1 * wave(2, 1) + 0.05 * wave(1, 1)
    assert surface(low).power.sum() < 1e-20
    found = compare(surface(0.02 * wave(9, 4) + low), surface(0.02 * wave(9, 4)))
    assert found.rgh == pytest.approx(1, abs=1e-3)
    assert found.L2nr > 1


def test_power_goes_to_its_degree() -> None:
    power = surface(0.02 * wave(9, 4) + 0.01 * wave(14, 3)).power
    assert power[9] == pytest.approx(4e-4, rel=1e-6)
    assert power[14] == pytest.approx(1e-4, rel=1e-6)
    assert power.sum() == pytest.approx(5e-4, rel=1e-6)


def test_wrinkles_on_one_side_are_patchy() -> None:
    even, one_side = 0.02 * wave(12, 5), 0.02 * wave(12, 5) * (1 + np.tanh(3 * RAYS[..., 1]))
    assert compare(surface(one_side), surface(even)).patch > 0.4


def test_slopes_of_a_cone_in_closed_form() -> None:
    # r = 1.04 exp(a cos theta) meets its rays at arctan(a sin theta); the area mean of theta's slope is known
    a = 0.3
    radius = 1.04 * np.exp(a * np.cos(THETA))
    steep = Surface(FRESH, (radius - 1.04)[..., None] * RAYS)
    np.testing.assert_allclose(steep.slope, np.degrees(np.arctan(a * np.sin(THETA))), atol=1e-6)
    sphere = Surface(FRESH, np.zeros_like(FRESH))
    truth = (harmonics.area(N) * steep.slope).sum()
    distance = compare(sphere, steep)[Measures._fields.index("W1")]
    assert distance == pytest.approx(truth, rel=1e-3)


def test_the_mean_of_comparisons() -> None:
    assert mean([Measures(*range(7)), Measures(*range(2, 9))]) == Measures(1, 2, 3, 4, 5, 6, 7)


def test_harmonics_of_a_lattice_field() -> None:
    field = 3 * wave(5, 3) + wave(2, 1) + np.ones_like(THETA)
    waves = spectra.spectrum(field)
    power = harmonics.power(harmonics.degrees(waves))
    expected = np.zeros(N + 1)
    expected[[0, 2, 5]] = 1, 1, 9
    np.testing.assert_allclose(power, expected, atol=1e-12)
    np.testing.assert_allclose(spectra.synthesize(harmonics.without_low(waves), N), 3 * wave(5, 3), atol=1e-12)
    assert harmonics.area(N).sum() * 2 * N == pytest.approx(1)
