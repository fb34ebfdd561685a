"""Normals and volume of the mesh that is handed over, against plain sums over its triangles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver import registry
from solver.lattice import closed_lattice, directions, lattice
from store import starter
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import drawn

Floats = NDArray[np.float64]
NAMES = Store.open(starter.ROOT).table_names()


def summed(points: Floats, triangles: NDArray[np.int64]) -> tuple[Floats, float]:
    """Return the unit normals of vertices, weighted by area, and the volume inside, triangle by triangle."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas, total = np.cross(b - a, c - a), np.zeros_like(points)
    for k in range(3):
        np.add.at(total, triangles[:, k], areas)
    return total / np.linalg.norm(total, axis=1, keepdims=True), float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def apart(found: Floats, truth: Floats) -> Floats:
    """Return the angles [degree] between unit vectors: by the chord, as a cosine in single precision tells 0.03."""
    return np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(found - truth, axis=1) / 2, 1)))


def check(name: str, count: int) -> None:
    rng = np.random.default_rng(NAMES.index(name))
    table = ShapeTable.open(Store.open(starter.ROOT), name, surfaces=registry.surface)
    for i in range(count):
        point = {axis: float(rng.uniform(*span)) for axis, span in table.axes.items()}
        stage = table.reach[1] if i % 2 == 0 else float(rng.uniform(0.05, table.reach[1]))
        n = int(rng.choice([24, 32, 48, 64]))
        shape = table.at(point, stage, resolution=n)
        assert shape.position is not None
        assert shape.poles is not None
        points = np.concatenate([shape.position.reshape(-1, 3), shape.poles]).astype(float)
        truth, volume = summed(points, closed_lattice(n))
        found = np.concatenate([shape.normals.reshape(-1, 3), shape.pole_normals]).astype(float)
        # single precision; by the surface's series up to 1,000 points of a folded shape were turned by over 90 degrees
        assert apart(found, truth).max() < 0.05, (point, stage, n)
        assert shape.volume == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_normals_and_volume_are_those_of_the_triangles(name: str) -> None:
    check(name, 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_normals_and_volume_are_those_of_the_triangles_of_many(name: str) -> None:
    check(name, 24)


@pytest.mark.parametrize("n", [4, 5, 31])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_any_surface_in_either_precision(n: int, kind: type) -> None:
    rng = np.random.default_rng(n)
    points = directions(*lattice(n)) * rng.uniform(0.5, 1.5, (n, 2 * n, 1)) + [3, 0, -1]
    poles = np.array([[3, 1, -1], [3, -1.2, -1]])
    points, poles = points.astype(kind), poles.astype(kind)
    truth, volume = summed(np.concatenate([points.reshape(-1, 3), poles]).astype(float), closed_lattice(n))
    found = np.concatenate([part.reshape(-1, 3) for part in drawn.normals(points, poles)])
    assert found.dtype == np.float32
    assert apart(found.astype(float), truth).max() < 0.05
    assert drawn.volume(points, poles) == pytest.approx(volume, rel=1e-5)


def test_a_collapsed_surface_still_has_unit_normals() -> None:
    flat, ends = np.zeros((8, 16, 3), np.float32) + np.float32([0.5, 0.5, 0]), np.zeros((2, 3), np.float32)
    normals, poles = drawn.normals(flat, ends)
    assert np.allclose(np.linalg.norm(normals, axis=-1), 1)
    assert np.array_equal(poles, [[0, 1, 0]] * 2)
    assert drawn.volume(flat, ends) == 0
