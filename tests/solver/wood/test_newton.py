"""Newton's method for implicit steps, on functions whose minimum is known; and passes of breaking."""

import numpy as np
import pytest

from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.stepping.newton import descend

GOAL = np.random.default_rng(0).normal(size=(5, 3))


def to_goal(stiff, assumed, wanted, little):
    """Descend on stiff |x - GOAL|^2 / 2 with an assumed stiffness."""
    return descend(
        lambda x: stiff * (x - GOAL),
        lambda positive: lambda way: assumed * way,
        np.zeros_like(GOAL),
        lambda r: r / assumed,
        wanted,
        1000,
        lambda p: np.inf,
        little,
    )


def test_a_quadratic_takes_one_round():
    found = to_goal(3.0, 3.0, 1e-9, 0.0)
    assert (found.rounds, found.settled) == (1, True)
    assert found.x == pytest.approx(GOAL)


@pytest.mark.parametrize("times", [0.2, 20.0])
def test_steps_that_are_too_short_or_too_long_are_mended(times):
    found = to_goal(1.0, times, 1e-3 * np.linalg.norm(GOAL), 0.0)
    assert found.settled
    # at 20 times the stiffness plain steps would take 135 rounds
    assert found.rounds <= 8
    assert found.x == pytest.approx(GOAL, abs=1e-2)


def test_what_promises_little_is_the_last_step():
    energy = 0.5 * float((GOAL**2).sum())
    found = to_goal(1.0, 1.2, 1e-9, 3 * energy)
    assert found.settled
    assert found.rounds == 1
    assert found.norm > 1e-9
    # no round is left out as long as there is more to gain
    assert to_goal(1.0, 1.2, 1e-9, 1e-3 * energy).rounds > 1


def test_an_implicit_pull_parts_the_bundle():
    """Every rod breaks, most of them within a few steps: in passes, and the books stay closed."""
    values = {"rods": 9, "vertices": 10, "length": 0.1, "radius": 0.004, "clamp": "both", "pull": (0.2, 0, 0)}
    found = SOLVER.solve(
        SOLVER.parse({**values, "mode": "implicit", "step": 5e-4, "damping": 50.0}), Need(stages=(4e-3, 1.2e-2))
    )
    assert found.broken_rods.values[0] == 0
    assert found.broken_rods.values[1] >= found.attrs["rods"]
    # what is left does not hold together
    assert found.elastic_energy.values[1] < 0.05 * found.work.values[1]
    assert found.residual.values.max() < 0.3
