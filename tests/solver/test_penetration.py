"""How a delivered surface is measured: its triangles, its poles, its depth."""

from __future__ import annotations

import numpy as np
import pytest

from service.formats import mesh as drawn
from solver.dehydration.measures.penetration import of_lattice, of_quads
from solver.fruit import directions, lattice
from solver.lattice import closed_lattice

from ._skins import cubed_sphere


@pytest.mark.parametrize("n", [6, 16])
def test_the_lattice_is_cut_as_the_files_cut_it(n):
    def as_set(triangles):
        turned = [np.roll(row, -int(np.argmin(row))) for row in np.asarray(triangles, int)]
        return {tuple(map(int, row)) for row in turned}

    assert as_set(closed_lattice(n)) == as_set(drawn.triangles(n))


def test_a_smooth_lattice_is_free_and_one_with_a_finger_through_its_side_is_not():
    points = directions(*lattice(24))
    assert of_lattice(points).count == 0
    finger = points.copy()
    finger[12, 10] *= -1.05  # a node pulled across the body and out at the other side
    found = of_lattice(finger)
    assert found.count > 0
    assert 0 < found.depth < 0.06  # as far as it sticks out, or less: sideways it leaves sooner


def test_poles_are_closed():
    """A finger that comes out at the pole crosses nothing but the fan there."""
    points = directions(*lattice(24))
    points[12, 10] = [0, 1.2, 0]
    assert of_lattice(points).count > 0


def test_balls_that_overlap_cross_no_deeper_than_they_do():
    ball, quads = cubed_sphere(12)
    both = np.concatenate([quads, quads + len(ball)])
    depths = [
        of_quads(np.concatenate([ball, ball + np.array([0, 0.1, 2 - lap])]), both).depth for lap in (-0.01, 0.03, 0.08)
    ]
    assert depths[0] == 0
    assert 0.005 < depths[1] < 0.03
    assert depths[1] < depths[2] < 0.08


@pytest.mark.parametrize("overlap", [0.0, 0.004, 0.01])
def test_balls_whose_poles_meet_overlap_as_deep_as_they_cross(overlap):
    """The poles are nodes, one below the other; facets lie inside their ball by h^2 / 8.

    Deeper, whole triangles are through, and depth is a lower bound: see the test before.
    """
    ball, quads = cubed_sphere(12)
    both = np.concatenate([ball, ball * [1, 1, -1] + [0, 0, 2 - overlap]])
    found = of_quads(both, np.concatenate([quads, quads[:, ::-1] + len(ball)]))
    assert (found.count > 0) == (overlap > 0)
    assert found.depth == pytest.approx(overlap, abs=0.003)
