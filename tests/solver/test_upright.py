"""Columns of elements that stand upright under an oblique skin."""

from __future__ import annotations

import numpy as np
import pytest

from solver.dehydration import SOLVER, DehydrationParams
from solver.dehydration.bifurcation.places import expected_onsets
from solver.dehydration.implicit import base_state, build_quadratic_mesh
from solver.dehydration.implicit.location import locate
from solver.dehydration.implicit.upright import parametric, slanted, upright
from solver.fem import HEX27

FOOT = 0.8
CORE = np.array([0.0, 0.5, FOOT, 0.95, 1.0])


def fruit(name: str) -> DehydrationParams:
    params = SOLVER.parse({}, name)
    assert isinstance(params, DehydrationParams)
    return params


def inside(params: DehydrationParams, shares: np.ndarray) -> np.ndarray:
    """Return points of random rays: `shares` of the flesh's depth, above 1 of the skin's."""
    rng = np.random.default_rng(1)
    colatitude, azimuth = np.arccos(rng.uniform(-1, 1, len(shares))), rng.uniform(-np.pi, np.pi, len(shares))
    interface = params.sarcocarp(colatitude, azimuth)
    distance = np.linalg.norm(interface, axis=1)
    rays = interface / distance[:, None]
    stone = params.stone_distance(rays)
    depth = stone + np.minimum(shares, 1) * (distance - stone)
    found: np.ndarray = rays * (depth + np.maximum(shares - 1, 0) * params.exocarp_thickness)[:, None]
    return found


def places(params: DehydrationParams, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return colatitude and azimuth of the rays through points."""
    towards = parametric(params, points)
    return np.arccos(np.clip(towards[:, 1], -1, 1)), np.arctan2(towards[:, 2], towards[:, 0])


@pytest.mark.parametrize("name", ["plum1", "raisin"])
def test_the_way_back_leads_to_the_same_points(name: str) -> None:
    params = fruit(name)
    points = inside(params, np.random.default_rng(0).uniform(0, 2, 400))
    moved = upright(params, points, FOOT)
    assert np.abs(moved - points).max() > 3e-3
    # elements are .02 and more across; within one, local coordinates are found exactly
    np.testing.assert_allclose(slanted(params, moved, FOOT), points, atol=1e-3)


def test_only_what_is_between_the_surfaces_moves_and_nothing_on_a_sphere() -> None:
    params = fruit("plum1")
    for share in (0.0, 1.0):
        held = inside(params, np.full(50, share))
        np.testing.assert_allclose(upright(params, held, FOOT), held, atol=1e-7)
    out = upright(params, inside(params, np.full(50, 2.0)), FOOT)
    np.testing.assert_allclose(params.surface(*places(params, out)), out, atol=1e-6)
    ball = fruit("sphere")
    points = inside(ball, np.linspace(0, 2, 50))
    np.testing.assert_allclose(upright(ball, points, FOOT), points, atol=1e-6)


def test_columns_stand_on_the_surface_and_points_are_found_in_them() -> None:
    params = fruit("plum1")
    slants = []
    for foot in (None, FOOT):
        mesh = build_quadratic_mesh(params, 6, CORE, "octant", 1, foot=foot)
        assert mesh.foot == foot
        columns = mesh.positions.reshape(-1, mesh.levels, 3)[mesh.stacks]
        across = columns[:, [3, 5, 1, 7]]
        normal = np.cross(across[:, 1, -1] - across[:, 0, -1], across[:, 3, -1] - across[:, 2, -1])
        skin, flesh = (columns[:, 4, -1] - columns[:, 4, below] for below in (-3, -5))
        for way in (skin, flesh):
            cosine = np.einsum("si,si->s", normal, way) / np.linalg.norm(normal, axis=1) / np.linalg.norm(way, axis=1)
            slants.append(np.degrees(np.arccos(np.minimum(np.abs(cosine), 1))).max())
        points = np.matmul(HEX27.shape(np.array([[0.3, -0.4, 0.5]])), mesh.positions[mesh.connectivity])[:, 0]
        element, local = locate(params, mesh, points)
        np.testing.assert_array_equal(element, np.arange(len(points)))
        np.testing.assert_allclose(local, [[0.3, -0.4, 0.5]] * len(points), atol=1e-6)
    # degrees, along rays and upright; what is left is the coarse faces' own
    assert min(slants[:2]) > 30
    assert max(slants[2:]) < 6


def test_the_estimate_knows_how_thin_the_skin_is_across() -> None:
    params = fruit("plum1")
    found = expected_onsets(base_state(params, 0.02, n=4, layers=1, kappa_ratio=10.0))
    colatitude, azimuth = places(params, found.middles)
    step = 1e-5
    along = params.surface(colatitude + step, azimuth) - params.surface(colatitude - step, azimuth)
    around = params.surface(colatitude, azimuth + step) - params.surface(colatitude, azimuth - step)
    normal = np.cross(around, along)
    expected = np.einsum("ei,ei->e", normal, found.middles)
    expected /= np.linalg.norm(normal, axis=1) * np.linalg.norm(found.middles, axis=1)
    np.testing.assert_allclose(found.thinned, np.abs(expected), atol=0.02)
    assert found.thinned.min() < 0.82
