"""How far meshes reach, against every ray with every triangle in plain numpy, and against what is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from solver.geometry.reach import reach
from solver.lattice import closed_lattice, directions, lattice


def plain(points: np.ndarray, triangles: np.ndarray, n: int) -> np.ndarray:
    """The twin: each ray against each triangle, by barycentric coordinates from a linear solve."""
    rays = directions(*lattice(n)).reshape(-1, 3)
    found = np.zeros(len(rays))
    for corners in points[triangles].astype(float):
        if abs(np.linalg.det(corners)) < 1e-300:
            continue
        # ray = sum of corners with weights: all of one sign where it passes through the triangle
        weights = np.linalg.solve(corners.T, rays.T)
        meets = (weights > -1e-12).all(axis=0)
        found[meets] = np.maximum(found[meets], 1 / weights[:, meets].sum(axis=0))
    return found.reshape(n, 2 * n)


def sphere(n: int) -> np.ndarray:
    points = directions(*lattice(n))
    return np.concatenate([points.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])


@pytest.mark.parametrize(("mesh", "n"), [(3, 12), (12, 9), (10, 24)])
def test_it_is_what_every_ray_meets(mesh: int, n: int) -> None:
    random = np.random.default_rng(mesh)
    points = sphere(mesh) * random.uniform(0.5, 1.5, (2 * mesh**2 + 2, 1)) + random.normal(0, 0.05, (1, 3))
    points = Rotation.random(random_state=1).apply(points)
    found, truth = reach(points, closed_lattice(mesh), n), plain(points, closed_lattice(mesh), n)
    assert (truth > 0).all()
    assert np.abs(found - truth).max() < 1e-9


def test_the_farthest_of_two_counts_and_nothing_is_nothing() -> None:
    inner, outer = sphere(16), 2 * sphere(16)
    faces = closed_lattice(16)
    both = reach(np.concatenate([inner, outer]), np.concatenate([faces, faces + len(inner)]), 8)
    assert np.abs(both - reach(outer, faces, 8)).max() < 1e-12
    assert np.abs(both - 2).max() < 0.03
    away = reach(inner + np.array([0, 5, 0]), faces, 8)
    assert away[-1].max() == 0.0
    assert away[0].min() > 5


def test_a_tetrahedron_s_large_triangles_are_met_everywhere() -> None:
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    found = reach(corners, faces, 20)
    assert np.abs(found - plain(corners, faces, 20)).max() < 1e-12
    assert found.min() >= 3**-0.5 - 1e-12
