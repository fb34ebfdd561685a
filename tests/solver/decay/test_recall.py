"""L-BFGS' loops in place against plain numpy, and what a march learns from its last two shapes."""

from __future__ import annotations

import numpy as np
import pytest

from solver.contract import Need
from solver.decay import SOLVER
from solver.decay.body.recall import direction, moved


def plain(slope: np.ndarray, pairs: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Nocedal and Wright 2006, algorithm 7.4, with an inverse of 1.5."""
    q, parts = slope.copy(), []
    for s, y in reversed(pairs):
        parts.append((s * q).sum() / (s * y).sum())
        q = q - parts[-1] * y
    d = 1.5 * q
    for (s, y), part in zip(pairs, reversed(parts), strict=True):
        d = d + (part - (y * d).sum() / (s * y).sum()) * s
    return -d


def test_directions_are_those_of_the_textbook() -> None:
    generator = np.random.default_rng(3)
    slope = generator.standard_normal((50, 3))
    pairs = [(s, s * generator.uniform(0.5, 2, (50, 3))) for s in generator.standard_normal((6, 50, 3))]
    moves = tuple(moved(s, y) for s, y in pairs)
    found = direction(slope, lambda q: 1.5 * q, moves)
    # moves are kept with seven digits
    assert np.abs(found - plain(slope, pairs)).max() < 1e-5 * np.abs(found).max()
    assert (found * slope).sum() < 0


def test_the_last_move_is_what_its_change_of_slope_asks_for() -> None:
    """The secant condition, which fails for a wrong sign or factor in either loop: H y = s."""
    generator = np.random.default_rng(4)
    pairs = [(s, s * generator.uniform(0.5, 2, (40, 3))) for s in generator.standard_normal((3, 40, 3))]
    s, y = pairs[-1]
    found = direction(y, lambda q: 0.7 * q, tuple(moved(*pair) for pair in pairs))
    assert np.abs(found + s).max() < 1e-5


def test_a_move_along_which_the_energy_curves_down_teaches_nothing() -> None:
    generator = np.random.default_rng(5)
    slope, way = generator.standard_normal((2, 30, 3))
    assert np.array_equal(direction(slope, lambda q: 2 * q, (moved(way, -way),)), -2 * slope)


def test_a_march_knows_where_it_goes() -> None:
    """A fruit that dries at an even pace is where its last two shapes point to."""
    values = {"body": "quasi-static", "wounds": (), "transpiration": 3.0, "march": 0.25}

    def steps(march: float | None) -> tuple[int, np.ndarray]:
        need = Need(fields=("displacement",), stages=(1.0, 1.25, 1.5, 1.75), quality="preview", resolution=16)
        # a stage on a node is settled from the node: its own steps are none. Between nodes they count
        shifted = need.model_copy(update={"stages": tuple(day + 0.1 for day in need.stages)})
        run = SOLVER.solve(SOLVER.parse({**values, "march": march}, "orange"), shifted)
        return int(run.body_steps.sum()), run.displacement.values

    (near, moved_), (cold, fresh) = steps(0.25), steps(None)
    assert near < cold
    assert np.abs(moved_ - fresh).max() == pytest.approx(0, abs=2e-3)
