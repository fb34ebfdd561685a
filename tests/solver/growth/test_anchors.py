"""Nearest points of a surface: inside, beyond its border, and off it."""

import numpy as np
import pytest

from solver.growth.anchors import place
from solver.growth.shapes import start


def test_the_nearest_point_of_a_flat_strip_is_the_clipped_one():
    mesh = start("strip", 120, 2.0)
    points = np.random.default_rng(0).uniform([-1.6, -0.9, -0.3], [1.6, 0.9, 0.3], (200, 3))
    low, high = mesh.x.min(axis=0), mesh.x.max(axis=0)
    beyond = ((points < low) | (points > high))[:, :2].any(axis=1)
    assert 50 < beyond.sum() < 150
    anchors = place(points, mesh.x, mesh.triangles)
    assert anchors.at(mesh.x, mesh.triangles) == pytest.approx(np.clip(points, low, high), abs=1e-12)
    assert anchors.weights.sum(axis=1) == pytest.approx(1, abs=1e-12)
    assert anchors.weights.min() >= 0
