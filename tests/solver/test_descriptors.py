"""Descriptors of surfaces whose wrinkles are known in closed form."""

import numpy as np
import pytest
from scipy import ndimage
from scipy.special import sph_harm_y

from solver import registry
from solver.dehydration.fresh.mesh import build_mesh, layer_fractions
from solver.dehydration.measures.descriptors import Surface, _valleys


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


def dimples(directions, count, width):
    """Heights with one round dimple at each of `count` places that a golden spiral spreads evenly."""
    k = np.arange(count) + 0.5
    height, turn = 1 - 2 * k / count, np.pi * (1 + np.sqrt(5)) * k
    ring = np.sqrt(1 - height**2)
    places = np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1)
    apart = np.arccos(np.clip(directions @ places.T, -1, 1))
    return -np.exp(-((apart / width) ** 2)).sum(axis=1)


@pytest.mark.parametrize("count", [20, 32, 58])
def test_dimples_are_counted(setting, count):
    surface, fresh, *_, d = setting
    moved = fresh + 0.03 * dimples(d, count, 1.1 / np.sqrt(count))[:, None] * d
    assert surface.describe(moved).buckle_count == count


@pytest.mark.parametrize("seed", range(4))
def test_valleys_are_the_labels_of_an_image_that_is_closed_by_hand(seed):
    """scipy.ndimage knows neither azimuth nor poles: labels that meet there are merged one by one."""
    n = 48
    noise = np.random.default_rng(seed).normal(size=(n, 2 * n))
    field = ndimage.gaussian_filter(noise, 2, mode=("reflect", "wrap"))
    level = -0.5 * field.std()
    labels, count = ndimage.label(field < level)
    name = list(range(count + 1))

    def meet(a, b):
        if a and b and name[a] != name[b]:
            old, new = name[a], name[b]
            name[:] = [new if each == old else each for each in name]

    for row in range(n):
        meet(labels[row, 0], labels[row, -1])
    for column in range(n):
        meet(labels[0, column], labels[0, column + n])
        meet(labels[-1, column], labels[-1, column + n])
    assert count > 10
    assert _valleys(field, level) == len(set(name[1:]))


@pytest.mark.parametrize(("depth", "count"), [(0.05, 0), (0.5, 20)])
def test_bumps_of_a_skin_that_has_not_buckled_are_no_buckles(setting, depth, count):
    """Dimples as deep as a part of the skin's thickness."""
    surface, fresh, *_, d = setting
    bumps = dimples(d, 20, 0.25)
    found = surface.describe(fresh + depth * 0.04 * bumps[:, None] * d)
    assert found.buckle_count == count
    assert found.dominant_degree > 3
