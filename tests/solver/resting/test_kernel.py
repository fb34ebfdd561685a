"""The kernel of falling bodies against its plain twin, body by body, step by step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from solver.lattice import directions, lattice
from solver.resting.kernel import step
from solver.resting.near import radius_at

from ._twin import Bodies, radius


def bodies(count: int, bowl: tuple[float, float, float], seed: int) -> Bodies:
    """Bumpy bodies of two kinds, close to each other and to the ground."""
    random = np.random.default_rng(seed)
    n = 12
    theta, phi = lattice(n)
    tables = np.stack([1 + 0.15 * np.cos(3 * theta), 0.8 + 0.2 * np.sin(theta) * np.cos(2 * phi)])
    points = np.stack([(table[..., None] * directions(theta, phi)).reshape(-1, 3) for table in tables])
    kind, scale = np.arange(count) % 2, random.uniform(0.5, 1.0, count)
    at = random.uniform(-0.6, 0.6, (count, 3)) + np.array([0, 1.9 + 0.2 * count, 0])
    turn = np.ascontiguousarray(Rotation.random(count, random_state=seed).as_quat())
    mass = scale**3
    speed, spin = random.normal(0, 0.3, (2, count, 3))
    reach = scale * tables.max(axis=(1, 2))[kind] * 1.01
    return Bodies(
        at, turn, speed, spin, kind, scale, tables, points, reach, mass, 0.4 * mass * scale**2, np.array(bowl), 0.4
    )


@pytest.mark.parametrize("bowl", [(0.0, 0.0, 0.0), (2.5, 0.2, 2.0)])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_steps_are_those_of_the_twin(count: int, bowl: tuple[float, float, float]) -> None:
    h, drag = 0.02, 0.1
    found, truth = bodies(count, bowl, count), bodies(count, bowl, count)
    for _ in range(160):
        fastest = step(
            found.at, found.turn, found.speed, found.spin, found.kind, found.scale, found.tables, found.points,
            found.reach, found.mass, found.inertia, found.bowl, h, drag, found.friction, 1,
        )  # fmt: skip
        expected = truth.step(h, drag)
        assert fastest == pytest.approx(expected, rel=1e-7, abs=1e-9)
        for name in ("at", "turn", "speed", "spin"):
            np.testing.assert_allclose(getattr(found, name), getattr(truth, name), rtol=1e-6, atol=1e-8)
        # which of two points is the deepest hangs on rounding in the end: each step begins from the same
        for name in ("at", "turn", "speed", "spin"):
            getattr(truth, name)[:] = getattr(found, name)
    assert truth.contacts > 5


def test_radii_between_directions_are_the_twin_s() -> None:
    random = np.random.default_rng(0)
    table = random.uniform(0.5, 1.5, (9, 18))
    x = random.normal(size=(500, 3))
    r = np.linalg.norm(x, axis=1)
    found = [radius_at(table, *one, size) for one, size in zip(x, r, strict=True)]
    np.testing.assert_allclose(found, radius(table, x / r[:, None]), rtol=1e-12)


@pytest.mark.parametrize("bowl", [(0.0, 0.0, 0.0), (4.0, 0.2, 3.0)])
def test_what_is_known_to_be_near_changes_nothing(bowl: tuple[float, float, float]) -> None:
    """Lists of near bodies and points live as long as a call: one of many steps gives what many of one step give."""
    found, truth = bodies(12, bowl, 4), bodies(12, bowl, 4)
    for one in (found, truth):
        one.at[:] = one.at * [3, 1, 3] + 2.2 * np.arange(12)[:, None] * [0, 1, 0]  # apart, at first
    for one, calls, steps in ((found, 6, 200), (truth, 1200, 1)):
        for _ in range(calls):
            fastest = step(
                one.at, one.turn, one.speed, one.spin, one.kind, one.scale, one.tables, one.points, one.reach,
                one.mass, one.inertia, one.bowl, 0.02, 0.1, one.friction, steps,
            )  # fmt: skip
    assert fastest < 1.0
    assert found.at[:, 1].max() < 4
    for name in ("at", "turn", "speed", "spin"):
        assert (getattr(found, name) == getattr(truth, name)).all(), name


def test_what_turns_on_the_spot_strikes_its_neighbour() -> None:
    """Two long bodies side by side, apart; one turns, and neither of their centres moves until it reaches the other."""
    theta, phi = lattice(24)
    ways = directions(theta, phi)
    table = 1 / np.sqrt((ways[..., 0] / 2) ** 2 + ways[..., 1] ** 2 + ways[..., 2] ** 2)
    at, turn = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 2.2]]), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
    speed, spin = np.zeros((2, 2, 3))
    spin[0, 1] = 4.0
    one = np.ones(2)
    fixed = np.zeros(2, int), one, table[None], (table[..., None] * ways).reshape(1, -1, 3), 2 * one, one, 0.4 * one
    step(at, turn, speed, spin, *fixed, np.zeros(3), 0.01, 0.0, 0.1, 60)
    assert at[1, 2] > 2.3
