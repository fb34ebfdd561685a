"""Descriptors of surfaces whose wrinkles are known in closed form."""

import numpy as np
import pytest
from scipy.special import sph_harm_y

from solver import registry
from solver.dehydration.fresh.mesh import build_mesh, layer_fractions
from solver.dehydration.measures.descriptors import Surface


@pytest.fixture(scope="module")
def setting():
    fruit = registry.get("dehydration").parse({}, preset="sphere")
    mesh = build_mesh(fruit, 32, layer_fractions(0.6, 0.1, 1.4))
    d = mesh.sphere.directions
    return Surface(fruit, mesh), mesh.positions[mesh.surface_nodes], np.arccos(d[:, 1]), np.arctan2(d[:, 2], d[:, 0]), d


def test_a_shrunk_sphere_is_smooth(setting):
    surface, fresh, *_ = setting
    found = surface.describe(0.9 * fresh)
    assert found.mean_radius == pytest.approx(0.9 * 1.04, rel=1e-9)
    assert found.volume == pytest.approx(4 / 3 * np.pi * (0.9 * 1.04) ** 3, rel=2e-3)
    assert found.roughness < 1e-7  # the spline's sampling error of a smooth field at n = 32
    assert found.buckle_count == 0


@pytest.mark.parametrize(("degree", "order", "anisotropy"), [(10, 10, 1), (12, 0, -1)])
def test_one_harmonic_is_recognised(setting, degree, order, anisotropy):
    surface, fresh, theta, phi, d = setting
    wave = sph_harm_y(degree, order, theta, phi).real
    amplitude = 0.02
    found = surface.describe(0.9 * fresh + amplitude * wave[:, None] * d)
    rms = amplitude * np.sqrt((1 if order == 0 else 0.5) / (4 * np.pi))
    assert found.roughness == pytest.approx(rms, rel=1e-3)
    assert found.dominant_degree == pytest.approx(degree, rel=1e-3)
    assert found.wavelength == pytest.approx(2 * np.pi * found.mean_radius / np.sqrt(degree * (degree + 1)), rel=1e-3)
    assert found.ridge_anisotropy * anisotropy > 0.85
    if order == degree:
        assert found.buckle_count == degree  # one valley per period around the equator
