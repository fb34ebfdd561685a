"""Piles: ellipsoids, whose inside an equation tells, rest on each other, on the floor and in a bowl."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from solver.contract import InvalidInput
from solver.lattice import directions, lattice
from solver.resting import Body, Bowl, Rest, settle
from solver.resting.near import radius_at, rotate
from solver.resting.settle import MOST, Pouring, radii

HALF = np.array([[1.0, 1.0, 1.0], [0.8, 1.3, 0.8]])
WAYS = directions(*lattice(32)).reshape(-1, 3)
BODIES = [Body(WAYS * half) for half in HALF]
BOWL = Bowl(6.0, 0.3)


def poured(bowl: Bowl | None) -> tuple[Rest, list[np.ndarray]]:
    kinds, sizes = [i % 2 for i in range(14)], np.linspace(0.8, 1.2, 14)
    rest = settle(BODIES, kinds, sizes, bowl, 3)
    turns = Rotation.from_quat(rest.turn)
    return rest, [turns[i].apply(WAYS * HALF[k] * sizes[i]) + rest.centre[i] for i, k in enumerate(kinds)]


@pytest.fixture(scope="module", params=["floor", "bowl"])
def pile(request: pytest.FixtureRequest) -> tuple[Bowl | None, Rest, list[np.ndarray]]:
    bowl = BOWL if request.param == "bowl" else None
    return (bowl, *poured(bowl))


def depths(pile: tuple[Bowl | None, Rest, list[np.ndarray]]) -> np.ndarray:
    """How deep each body's surface is in each other one, along its radius; negative is a gap."""
    _, rest, surfaces = pile
    sizes, turns = np.linspace(0.8, 1.2, 14), Rotation.from_quat(rest.turn)
    found = np.full((14, 14), -np.inf)
    for j in range(14):
        for i in range(14):
            if i != j:
                local = turns[j].inv().apply(surfaces[i] - rest.centre[j])
                level = np.linalg.norm(local / (HALF[j % 2] * sizes[j]), axis=1)
                found[i, j] = (np.linalg.norm(local, axis=1) * (1 / level - 1)).max()
    return found


def ground(bowl: Bowl | None, points: np.ndarray) -> np.ndarray:
    """How deep points are in what stands still."""
    deep = -points[:, 1]
    if bowl is None:
        return deep
    away = np.linalg.norm(points - [0, bowl.sphere + bowl.thickness, 0], axis=1)
    return np.maximum(deep, np.where(points[:, 1] < bowl.rim, away - bowl.sphere, -np.inf))


def test_what_lies_is_still_and_nothing_is_within_another(pile) -> None:
    bowl, rest, surfaces = pile
    assert rest.still
    assert depths(pile).max() < 0.04
    assert max(ground(bowl, points).max() for points in surfaces) < 0.04


def test_every_body_is_held_from_below(pile) -> None:
    bowl, rest, surfaces = pile
    touching = depths(pile) > -0.05
    below = rest.centre[:, 1][:, None] > rest.centre[:, 1][None, :]
    held = (touching | touching.T) & below
    for i, points in enumerate(surfaces):
        assert held[i].any() or ground(bowl, points).max() > -0.05


def test_a_ball_alone_lies_at_the_bottom_of_the_bowl() -> None:
    rest = settle(BODIES[:1], [0], np.array([1.0]), BOWL, 0)
    assert rest.centre[0, 1] == pytest.approx(BOWL.thickness + 1, abs=0.05)
    # its points are 15 degrees apart: as a polyhedron, it may rest on a slope of half of that
    assert np.hypot(*rest.centre[0, [0, 2]]) < (BOWL.sphere - 1) * np.sin(np.radians(9))


def test_the_same_seed_gives_the_same_pile() -> None:
    first, again = poured(None)[0], poured(None)[0]
    assert (first.centre == again.centre).all()
    assert (first.turn == again.turn).all()


def test_radii_of_a_ball_and_an_ellipsoid() -> None:
    np.testing.assert_allclose(radii(BODIES[0]), 1)
    table = radii(BODIES[1])
    for way in np.random.default_rng(0).standard_normal((50, 3)):
        way /= np.linalg.norm(way)
        assert radius_at(table, *way, 1.0) == pytest.approx(1 / np.linalg.norm(way / HALF[1]), rel=0.04)


def test_turning_is_what_scipy_does() -> None:
    random = np.random.default_rng(1)
    turn, v = Rotation.random(random_state=2), random.standard_normal(3)
    np.testing.assert_allclose(rotate(turn.as_quat(), v, False), turn.apply(v), atol=1e-14)
    np.testing.assert_allclose(rotate(turn.as_quat(), v, True), turn.inv().apply(v), atol=1e-14)


@pytest.mark.parametrize("opening", [2.8, 2.95, 3.1, 3.3, 3.5, 3.8])
@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_thrown_out_of_a_bowl_with_room(opening: float, seed: int) -> None:
    """Five balls start beside each other where the bowl is wide enough for that, and not in its wall."""
    rest = settle(BODIES[:1], [0] * 5, np.ones(5), Bowl(opening, 0.15), seed)
    assert np.hypot(rest.centre[:, 0], rest.centre[:, 2]).max() < opening


@pytest.mark.parametrize("opening", [3e3, 1e9])
def test_a_bowl_costs_what_is_in_it_however_wide_it_is(opening: float) -> None:
    tracemalloc.start()
    try:
        pouring = Pouring(BODIES[:1], [0] * 3, np.ones(3), Bowl(opening, 1.0), 0)
        assert tracemalloc.get_traced_memory()[1] < 10e6
    finally:
        tracemalloc.stop()
    assert np.isfinite(pouring.centre).all()
    assert np.hypot(pouring.centre[:, 0], pouring.centre[:, 2]).max() < opening


def test_a_pile_of_too_many_is_refused() -> None:
    with pytest.raises(InvalidInput, match="several piles"):
        settle(BODIES[:1], [0] * (MOST + 1), np.ones(MOST + 1), None, 0)


@pytest.mark.slow
def test_a_heap_of_hundreds_is_done_when_waiting_longer_changes_no_overlap() -> None:
    """300 balls on the floor: found before the longest way, and no deeper in each other than ten batches on."""
    pouring = Pouring(BODIES[:1], [0] * 300, np.ones(300), None, 5)
    rest = pouring.rest()
    assert pouring._batch < 40
    for _ in range(10):
        pouring.advance()
    found, after = overlap(rest.centre), overlap(pouring.centre)
    assert found == pytest.approx(after, abs=0.001)
    assert found < 0.02


def overlap(centre: np.ndarray) -> float:
    """Return by how much touching balls of radius 1 are in each other, in the mean."""
    away = np.linalg.norm(centre[:, None] - centre, axis=2)[np.triu_indices(len(centre), 1)]
    return float((2 - away[away < 2]).mean())
