"""A sheet that is said to lie over a plane passes through itself nowhere, which pairs of triangles tell as well."""

import numpy as np
import pytest

from solver import shell
from solver.geometry.crossings import crossings
from solver.geometry.unfolded import outline, steepest
from tests.solver.shell._meshes import ball, sheet


def ring_of(faces, n):
    mesh = shell.topology(faces, n)
    return outline(mesh.edges[mesh.border])


def spiral(points, pitch):
    """Return a strip along x, .13 wide then, on one and a half turns of a spiral that lie a pitch from each other."""
    angle = 3 * np.pi * points[:, 0] / np.ptp(points[:, 0])
    radius = 3.0 - pitch * angle / (2 * np.pi) + 0.5 * (points[:, 1] - points[:, 1].mean())
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.1 * np.sin(3 * angle)], axis=1)


def test_an_outline_is_one_ring_around():
    points, faces = sheet(5, 7)
    ring = ring_of(faces, len(points))
    mesh = shell.topology(faces, len(points))
    border = {frozenset(edge) for edge in mesh.edges[mesh.border].tolist()}
    assert {frozenset(pair) for pair in zip(ring.tolist(), np.roll(ring, -1).tolist(), strict=True)} == border
    assert len(set(ring.tolist())) == len(border)


def test_a_closed_body_and_one_with_two_borders_have_no_outline():
    assert ring_of(ball(60)[1], 60) is None
    points, faces = sheet(7, 9)
    inner = np.flatnonzero((np.abs(points[faces].mean(axis=1) - points.mean(axis=0))[:, :2] < 1.2).all(axis=1))
    assert ring_of(np.delete(faces, inner, axis=0), len(points)) is None
    assert ring_of(np.concatenate([faces, faces + len(points)]), 2 * len(points)) is None


@pytest.mark.parametrize("slope", [0.3, 0.8, 3.0])
def test_a_wavy_sheet_lies_over_a_plane_as_steep_as_it_is(slope):
    points, faces = sheet(30, 30, 0.1)
    ring, x = ring_of(faces, len(points)), points.copy()
    wave = 2 * np.pi / np.ptp(x[:, 0])
    x[:, 2] = slope / wave * np.cos(wave * x[:, 0])
    # turned, so that no axis is the plane's
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    least, axes = steepest(points @ turn.T, x @ turn.T, faces, ring, 4)
    assert least == pytest.approx(1 / np.hypot(1, slope), rel=0.05)
    assert np.abs(axes @ axes.T - np.eye(2)).max() < 1e-12


@pytest.mark.parametrize("pitch", [0.0, 0.06, 0.12, 0.14, 0.2, 0.5])
def test_turns_lie_over_each_other_or_beside_each_other(pitch):
    """Those of a strip that is .13 wide: where they overlap its outline crosses itself."""
    points, faces = sheet(4, 80, 0.1)
    x = spiral(points, pitch)
    least, _ = steepest(x, x, faces[:, ::-1], ring_of(faces, len(points)), 1)
    assert (least > 0) == (pitch > 0.13)
    assert not (least and crossings(x, faces).count)


def test_a_sheet_that_turns_over_on_the_way_is_not_over_the_plane():
    """Flat before and after, though on its edge in between."""
    points, faces = sheet(6, 6)
    ring = ring_of(faces, len(points))
    turned = points * [-1, -1, 1]
    assert steepest(points, points, faces, ring, 1)[0] == pytest.approx(1.0)
    assert steepest(turned, turned, faces, ring, 1)[0] == pytest.approx(1.0)
    assert steepest(points, turned, faces, ring, 3)[0] == 0.0


def test_an_outline_that_touches_itself_is_no_outline():
    points, faces = sheet(6, 12)
    ring, x = ring_of(faces, len(points)), points.copy()
    # one corner laid onto another's place: two triangles, which meet in a point alone
    x[ring[3]] = x[ring[0]]
    assert steepest(x, x, faces, ring, 1)[0] == 0.0
