"""Closest points and touching boxes against plain twins: every candidate, bounded least squares, every pair."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from solver.geometry.boxes import touching
from solver.geometry.closest import of_segments, on_triangle
from solver.growth.anchors import place


def nearest(p, corners):
    """Least distance to a triangle, and where: its plane's point if it is inside, else the best of the three edges."""
    a, b, c = corners
    ways = np.stack([b - a, c - a], -1)
    s, t = np.linalg.lstsq(ways, p - a, rcond=None)[0]
    found = [a + ways @ [s, t]] if min(s, t, 1 - s - t) >= 0 else []
    for start, end in ((a, b), (b, c), (c, a)):
        u = np.clip((p - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
        found.append(start + u * (end - start))
    return min(found, key=lambda q: float(np.linalg.norm(p - q)))


def test_a_triangles_nearest_point_is_the_best_of_all_candidates():
    rng, weights, regions = np.random.default_rng(0), np.empty(3), set()
    for _ in range(2000):
        p, *corners = rng.normal(size=(4, 3)) * rng.uniform(0.1, 2, (4, 1))
        corners = np.array(corners)
        square = on_triangle(p, *corners, weights)
        at = nearest(p, corners)
        assert weights.min() >= -1e-12
        assert weights.sum() == pytest.approx(1, abs=1e-12)
        assert np.sqrt(square) == pytest.approx(np.linalg.norm(p - at), abs=1e-12)
        assert weights @ corners == pytest.approx(at, abs=1e-7)
        regions.add(tuple(weights > 0))
    # inside, on each edge, in each corner
    assert len(regions) == 7


def test_anchors_lie_as_near_as_the_triangles_nearest_point():
    """Points are placed by a search of its own over many triangles at once."""
    rng, weights = np.random.default_rng(1), np.empty(3)
    x, triangles = rng.normal(size=(30, 3)), rng.permuted(np.tile(np.arange(30), (20, 1)), axis=1)[:, :3]
    points = rng.normal(size=(200, 3))
    found = np.linalg.norm(place(points, x, triangles).at(x, triangles) - points, axis=1)
    for p, gap in zip(points, found, strict=True):
        least = min(on_triangle(p, *x[t], weights) for t in triangles)
        assert gap == pytest.approx(np.sqrt(least), rel=1e-12)


@pytest.mark.parametrize("middle", [0.0, 0.3])
def test_segments_are_closest_where_bounded_least_squares_says(middle):
    rng = np.random.default_rng(2)
    for _ in range(300):
        x = rng.normal(size=(4, 3))
        ways = np.stack([x[1] - x[0], x[2] - x[3]], -1)
        lean = np.sqrt(middle) * np.eye(2)
        a = np.vstack([ways, lean])
        b = np.concatenate([x[2] - x[0], lean @ [0.5, 0.5]])
        wanted = lsq_linear(a, b, (0, 1), method="bvls", tol=1e-14)
        found = np.array(of_segments(x, 0, 1, 2, 3, middle))
        assert ((found >= 0) & (found <= 1)).all()
        assert np.linalg.norm(a @ found - b) == pytest.approx(np.sqrt(2 * wanted.cost), abs=1e-9)


@pytest.mark.parametrize("count", [0, 1, 2, 300])
def test_touching_boxes_are_those_of_all_pairs(count):
    rng = np.random.default_rng(3)
    centre, half = rng.normal(size=(count, 3)), 10 ** rng.uniform(-2, -0.3, (count, 3))
    low, high = centre - half, centre + half
    found = np.sort(touching(low, high), axis=1)
    i, j = np.triu_indices(count, 1)
    meet = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
    assert found.shape == (int(meet.sum()), 2)
    assert {tuple(pair) for pair in found.tolist()} == set(zip(i[meet].tolist(), j[meet].tolist(), strict=True))
