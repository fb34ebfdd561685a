"""The paper's mass-spring body: its longest step, its stiffness, and where it settles."""

import json
import re

import numpy as np
import pytest

from solver.contract import Context, Need, Unstable
from solver.decay import SOLVER
from solver.decay.body.flesh import Softened, Swing
from solver.decay.body.loads import Loads
from solver.decay.body.solid import fill
from solver.decay.body.springs import Network, knit, longest_step, slower, swing
from solver.fruit import Fruit


@pytest.fixture(scope="module")
def free():
    """Return a free body of modulus 1e4 Pa, its springs and no loads."""
    solid = fill(Fruit(stone=(0, 0)), 4)
    ones = np.ones(len(solid.tets))
    network = knit(solid, Softened(ones, 1e4 * ones, ones), 1.0)
    zero = np.zeros(len(solid.points))
    return solid, network, Loads(zero, None, zero, zero, solid.points)


def test_a_mass_on_one_spring_is_stable_up_to_the_textbook_step():
    network = Network(np.array([[0, 1]]), np.ones(1), np.array([50.0]), np.array([2.0, 1e12]))
    x, zero = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.zeros(2)
    assert longest_step(x, network, Loads(zero, None, zero, zero, x)) == pytest.approx(8**0.5 / 5, rel=1e-6)


def test_springs_swing_below_the_predicted_step_and_blow_up_above(free):
    solid, network, loads = free
    limit = longest_step(solid.points, network, loads)

    def grown(share):
        x = solid.points + 1e-6 * Context.generator(0).standard_normal(solid.points.shape)
        v = np.zeros_like(x)
        swing(x, v, network, loads, share * limit, 0.0, 1500)
        return float(np.abs(x - solid.points).max()) / 1e-6

    assert grown(0.98) < 20
    assert not grown(1.03) < 1000


def test_springs_are_as_stiff_as_the_solid_they_stand_for(free):
    solid, network, _ = free
    # all lengths a little longer: energy of an even strain is 9 K e^2 / 2 per volume, K = E / (3 (1 - 2/4))
    strain = 1e-4
    i, j = network.ends.T
    gap = (1 + strain) * np.linalg.norm(solid.points[i] - solid.points[j], axis=1) - network.length
    energy = float(np.sum(network.stiffness * gap**2)) / 2
    assert energy == pytest.approx(9 * (1e4 / 1.5) * strain**2 / 2 * solid.volume.sum(), rel=1e-9)


def test_steps_of_the_paper_are_refused_for_an_apple_and_told_what_would_do():
    need = Need(fields=("volume",), stages=(1.0,), quality="preview")
    with pytest.raises(Unstable, match="longest") as caught:
        SOLVER.solve(SOLVER.parse({"body": "paper", "wounds": ()}, "apple"), need)
    # what it says can be typed as it stands, and does
    (swing_said,) = re.findall(r"swing=(\{.*?\})", caught.value.advice)
    (softer,) = re.findall(r"unit (\d+) times", caught.value.advice)
    short = json.loads(swing_said) | {"seconds": 0.001}
    for values in ({"swing": short}, {"flesh": {"unit": 1e4 / int(softer)}, "swing": {"seconds": 0.006}}):
        assert SOLVER.solve(SOLVER.parse({"body": "paper", "wounds": (), **values}, "apple"), need).volume.size == 1


@pytest.mark.parametrize("limit", [1.7e-5, 9.6e-5, 1e-6, 1e-9])
def test_a_step_that_is_advised_is_stable_and_allowed(limit):
    """One digit would round 1.53e-5 up to 2e-5, which is too long again."""
    said = re.findall(r"swing=(\{.*?\})", slower(Swing(), limit))
    steps = [Swing(**json.loads(one)).step for one in said]
    assert len(steps) == (limit > 1.2e-6)
    assert all(step < limit for step in steps)


def test_soft_springs_settle_to_the_share_that_eq_1_leaves():
    values = {"body": "paper", "wounds": (), "flesh": {"gravity": 0, "unit": 0.25}, "swing": {"seconds": 20}}
    need = Need(fields=("volume", "water_lost"), stages=(0.0, 10.0), quality="preview")
    run = SOLVER.solve(SOLVER.parse({**values, "stone": (0, 0)}, "apple"), need)
    left = float(run.volume[1] / run.volume[0])
    assert left == pytest.approx(1 - float(run.water_lost[1]), rel=1e-5)
