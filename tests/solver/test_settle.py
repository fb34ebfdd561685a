"""How a stage comes to rest: what is far from it swings on, what is near is calmed; and where the rungs stand."""

from __future__ import annotations

import numpy as np
import pytest

from solver import registry
from solver.dehydration.kernel.march import SEARCH_EVERY
from solver.dehydration.settings import choose
from solver.dehydration.settle import settle

SOLVER = registry.get("dehydration")
PARAMS = SOLVER.parse({"mirrors": "xyz"})
SETTINGS = choose(PARAMS, "preview")


class Told:
    """Stands in for `Motion`: after each calm turn the residual is the next that it is told; the surface stays."""

    params, settings = PARAMS, SETTINGS
    slice = 1000
    masses = None

    def __init__(self, residuals):
        self.left, self.turns, self.steps = list(residuals), [], 0
        self.layout = self
        self.mass, self.free = np.ones(1), np.ones(1, bool)
        self.sector = self
        self.copies = 1

    def surface(self, state):
        return np.zeros((1, 3))

    def whole(self, surface):
        return surface

    def run(self, state, velocity, rest, count, a, b, damping):
        self.steps += count
        self.turns.append((damping, count))

    def residual(self, state, rest, shrinkage, damping):
        return self.left.pop(0) * SETTINGS.residual

    def strained(self, state, rest, shrinkage):
        return 0.0, 1.0

    def looks(self):
        """S for each swing and c for each calm turn, in order."""
        word = "".join("c" if damping == SETTINGS.calm_damping else "s" for damping, _ in self.turns)
        swing = "s" * sum(damping != SETTINGS.calm_damping for damping, _ in self.turns[: word.index("c")])
        return word.replace(swing, "S") if swing else word


def settled(residuals, shrinkage=0.2):
    motion = Told(residuals)
    found = settle(motion, np.zeros((1, 4)), np.zeros((1, 4)), np.ones(1), shrinkage)
    assert found.residual <= SETTINGS.residual
    return motion


@pytest.mark.parametrize(
    ("residuals", "turns"),
    [
        ([0.9], "Sc"),
        ([1.2, 1.1, 0.9], "Sccc"),
        ([9.0, 0.9], "ScSc"),
        ([1.2, 1.1, 1.1, 1.1, 0.9], "SccccSc"),
    ],
)
def test_what_is_far_from_rest_swings_on_and_what_is_near_is_calmed(residuals, turns):
    assert settled(residuals).looks() == turns


def test_what_is_smooth_is_calmed_however_far_from_rest():
    """Before the march begins there are no buckles that could slide."""
    assert settled([9.0, 5.0, 0.9], SETTINGS.start / 2).looks() == "ccc"


def test_whole_searches_for_contact_lie_between_two_looks():
    swing = [count for damping, count in settled([0.9]).turns if damping != SETTINGS.calm_damping]
    assert {count % SEARCH_EVERY for count in swing} == {0}
    assert sum(swing) == pytest.approx(SETTINGS.swing_steps, rel=0.1)


@pytest.mark.parametrize("quality", ["preview", "default", "fine"])
def test_rungs_stand_wherever_a_run_may_end(quality):
    rungs = choose(PARAMS, quality).rungs
    assert rungs[-1] == pytest.approx(SOLVER.stages.highest)
    assert np.all(np.diff(rungs) > 0)
