"""Whether a surface is seen whole from the origin, against the compiled look for what faces inwards."""

from __future__ import annotations

import numpy as np
import pytest

from solver.geometry.inward import inward
from solver.geometry.outward import Field, faces_outward
from solver.geometry.seen import seen_whole
from solver.lattice import closed_lattice, directions, lattice


def wavy(height: float, slide: float, n: int = 24) -> np.ndarray:
    """A sphere with waves along its rays, whose points slide along its poles' axis so that it folds over."""
    theta, phi = lattice(n)
    waves = np.cos(8 * theta) * np.cos(6 * phi) * np.sin(theta)
    points = (1 + height * waves)[..., None] * directions(theta, phi)
    points[..., 1] += slide * waves
    return points


def seen(points: Field, poles: Field) -> bool:
    """What both say."""
    found = faces_outward(points, poles)
    assert seen_whole(points, poles) == found
    return found


def ends(points: np.ndarray) -> np.ndarray:
    return np.asarray(points[[0, -1]].mean(axis=1))


@pytest.mark.parametrize("height", [0.0, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("slide", [0.0, 0.1, 0.3])
def test_it_is_whole_where_nothing_faces_inwards(height: float, slide: float) -> None:
    triangles = closed_lattice(24).astype(np.int32)
    points = wavy(height, slide)
    whole = np.concatenate([points.reshape(-1, 3), ends(points)])
    found = inward(whole, triangles, np.arange(len(triangles), dtype=np.int32))
    assert seen(points, ends(points)) == (len(found) == 0)
    assert seen(points.astype("f4"), ends(points).astype("f4")) == (len(found) == 0)


def test_both_answers_are_given() -> None:
    for points, is_seen in ((wavy(0.02, 0.0), True), (wavy(0.02, 0.3), False), (-wavy(0.02, 0.0), False)):
        assert seen(points, ends(points)) == is_seen
    unknown = wavy(0.02, 0.0)
    unknown[5, 7] = np.nan
    assert not seen(unknown, ends(unknown))


@pytest.mark.parametrize(("row", "column"), [(0, 0), (0, 47), (11, 30), (23, 13)])
def test_one_point_pushed_beyond_its_neighbours_is_seen_wherever_it_lies(row: int, column: int) -> None:
    for n in (24, 96):  # of the finer one, bands of rows are looked at in turn
        points = wavy(0.0, 0.0, n)
        i, j = row * n // 24, column * n // 24
        points[i, j] = points[i, (j + 3) % (2 * n)]
        assert not seen(points, ends(wavy(0.0, 0.0, n)))
