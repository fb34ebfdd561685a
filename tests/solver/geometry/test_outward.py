"""Whether a surface is seen whole from the origin, against the compiled look for what faces inwards."""

from __future__ import annotations

import numpy as np
import pytest

from solver.geometry.inward import candidates
from solver.geometry.outward import faces_outward
from solver.lattice import closed_lattice, directions, lattice


def wavy(height: float, slide: float, n: int = 24) -> np.ndarray:
    """A sphere with waves along its rays, whose points slide along its poles' axis so that it folds over."""
    theta, phi = lattice(n)
    waves = np.cos(8 * theta) * np.cos(6 * phi) * np.sin(theta)
    points = (1 + height * waves)[..., None] * directions(theta, phi)
    points[..., 1] += slide * waves
    return np.concatenate([points.reshape(-1, 3), points[[0, -1]].mean(axis=1)])


@pytest.mark.parametrize("height", [0.0, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("slide", [0.0, 0.1, 0.3])
def test_it_is_whole_where_nothing_faces_inwards(height: float, slide: float) -> None:
    triangles = closed_lattice(24).astype(np.int32)
    points = wavy(height, slide)
    found = candidates(points, triangles, np.empty(len(triangles)))
    assert faces_outward(points, triangles) == (len(found) == 0)


def test_both_answers_are_given() -> None:
    triangles = closed_lattice(24)
    assert faces_outward(wavy(0.02, 0.0), triangles)
    assert not faces_outward(wavy(0.02, 0.3), triangles)
    assert not faces_outward(-wavy(0.02, 0.0), triangles)
