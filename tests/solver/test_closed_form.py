"""Closed forms against the exact reference values kept beside the tests."""

import json
from pathlib import Path

import numpy as np
import pytest

from solver.dehydration.fresh.closed_form import flat_film_strain, flat_film_wavelength, onset_estimate, sphere_radius

REFERENCE = json.loads((Path(__file__).parent / "core_shell_sphere.json").read_text())


@pytest.mark.parametrize("case", REFERENCE["base_state"], ids=lambda c: f"A{c['A']}-t{c['t']}-theta{c['theta']}")
def test_base_state_radii(case):
    radius = sphere_radius(np.array([1.0, 1.0 + case["t"]]), case["theta"], case["A"])
    assert radius == pytest.approx([case["r_i"], case["r_o"]], rel=1e-13)


@pytest.mark.parametrize("case", REFERENCE["bifurcation"])
def test_the_march_starts_below_the_exact_onset(case):
    estimate = onset_estimate(case["gamma"], case["stone_radius"])
    # the settings start at 0.75 of the estimate; the exact onset must lie above that
    assert 0.75 * estimate < case["s_cr"] < 1.5 * estimate


@pytest.mark.parametrize("case", REFERENCE["bifurcation"])
def test_flat_film_wavelength_is_near_the_exact_degree(case):
    degree = 2 * np.pi / flat_film_wavelength(case["exocarp_thickness"], case["gamma"])
    assert degree == pytest.approx(case["l_cr"], rel=0.25)


def test_flat_film_strain_is_the_known_value():
    assert flat_film_strain(3.0) == pytest.approx(1 / 6)


@pytest.mark.parametrize("theta", [0.7, 1.3])
def test_without_a_stone_the_core_is_scaled_and_the_skin_keeps_its_volume(theta):
    fresh = np.array([0.0, 0.1, 0.5, 1.0, 1.02, 1.04])
    radius = sphere_radius(fresh, theta, 0.0)
    assert radius[:4] == pytest.approx(theta * fresh[:4], rel=1e-15)
    assert np.diff(radius[3:] ** 3) == pytest.approx(np.diff(fresh[3:] ** 3))


def test_swelling_is_the_inverse_of_shrinking():
    """Flesh swollen to theta and shrunk by 1 / theta is the fresh flesh again."""
    fresh = np.linspace(0.4, 1.0, 5)
    swollen = sphere_radius(fresh, 1.3, 0.4)
    assert (swollen[1:] > fresh[1:]).all()
    back = sphere_radius(swollen, 1 / 1.3, 0.4, interface=float(swollen[-1]))
    assert back == pytest.approx(fresh, rel=1e-13)


@pytest.mark.parametrize("stone", [0.0, 0.4, 0.7, 0.9])
def test_at_the_estimated_onset_the_skin_is_strained_as_a_flat_film_is(stone):
    """Of a skin so stiff that all strains are small: the interface of the smooth sphere has come in by that strain."""
    gamma = 1e6
    moved = sphere_radius(np.array([1.0]), 1 - onset_estimate(gamma, stone), stone)
    assert 1 - moved[0] == pytest.approx(flat_film_strain(gamma), rel=1e-3)
