from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from solver.fresh import FreshFruit
from solver.fruit import PRESETS, Fruit, directions, lattice
from store.surfaces import surface


@cache
def fruit(name: str) -> Fruit:
    return Fruit.parse({k: v for k, v in PRESETS[name].items() if k != "modulus_ratio"})


@pytest.mark.parametrize("name", list(PRESETS))
@pytest.mark.parametrize(("dtype", "error"), [(np.float32, 3e-7), (np.float64, 1e-14)])
def test_fresh_surface_is_the_fruit_s(name: str, dtype: type, error: float) -> None:
    n, known = 20, fruit(name)
    fresh = FreshFruit(known.radii, known.stone, known.exocarp_thickness)
    u = np.random.default_rng(0).standard_normal((3, n, 2 * n)).astype(dtype)
    position = surface.add_fresh(fresh, u)
    assert position.dtype == dtype
    assert position.flags.c_contiguous
    np.testing.assert_allclose(position, known.surface(*lattice(n)) + np.moveaxis(u, 0, -1), atol=5 * error)
    truth = known.surface(np.array([0.0, np.pi]), np.zeros(2))
    np.testing.assert_array_equal(fresh.poles(), truth)


@pytest.mark.parametrize("n", [16, 17])
def test_normals_of_a_turned_and_shifted_ellipsoid(n: int) -> None:
    # its poles are not on its axes, so nothing is aligned with the lattice
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    axes = np.array([1.0, 1.4, 0.7])
    sphere = directions(*lattice(n)) @ turn
    truth = sphere / axes
    truth /= np.linalg.norm(truth, axis=-1, keepdims=True)
    np.testing.assert_allclose(surface.normals(sphere * axes + [1, 2, 3]), truth, atol=1e-12)


def test_normals_in_single_precision() -> None:
    sphere = directions(*lattice(64)).astype(np.float32)
    normals = surface.normals(sphere)
    assert normals.dtype == np.float32
    np.testing.assert_allclose(normals, sphere, atol=2e-4)  # neighbours near the poles are close together


def test_no_tangent_plane_no_normal() -> None:
    assert not surface.normals(np.zeros((8, 16, 3))).any()
