"""The documented bowls, as their files give them: where fruits fall hangs on last digits unless the bowl has room."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from solver.contract import InvalidInput, Need
from solver.decay import SOLVER
from solver.decay.heap.kinds import sorted_out
from solver.decay.heap.lying import lie
from solver.decay.settings import choose

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "decay"
#: What the commands in the files name besides.
PRESETS = {"bowl": "orange", "mixed": "apple"}


def example(name, **heap):
    values = tomllib.loads((EXAMPLES / f"{name}.toml").read_text())
    return SOLVER.parse({**values, "heap": {**values["heap"], **heap}}, PRESETS[name])


def lying(params):
    single = params.model_copy(update={"heap": None, "wounds": ()})
    return lie(params, sorted_out(params, single, choose(params, "preview").cells))


@pytest.mark.parametrize("name", PRESETS)
def test_fruits_lie_in_the_bowl_with_room_to_spare(name):
    params = example(name)
    rest = lying(params)
    assert np.hypot(rest.centre[:, 0], rest.centre[:, 2]).max() < 0.9 * params.heap.bowl


def test_the_mouldy_orange_lies_on_top_with_its_wound_upwards():
    params = example("bowl")
    rest = lying(params)
    (top,) = params.heap.infected
    assert top == rest.centre[:, 1].argmax()
    down, around = np.radians([params.wounds[0].colatitude, params.wounds[0].azimuth])
    wound = [np.sin(down) * np.cos(around), np.cos(down), np.sin(down) * np.sin(around)]
    assert (rest.turn[top] @ wound)[1] > 0.95


def test_a_bowl_too_small_says_which_is_wide_enough():
    with pytest.raises(InvalidInput, match=r"do not fit into a bowl of 2\.6 r1") as refused:
        lying(example("bowl", bowl=2.6))
    fits = float(re.search(r"a bowl of ([\d.]+) r1, which holds them", refused.value.advice).group(1))
    assert 2.6 < fits <= 5.2
    assert lying(example("bowl", bowl=fits)).inside.all()


@pytest.mark.parametrize("seed", range(6))
def test_fruits_are_thrown_again_where_one_bounces_out(seed):
    """Four in a bowl for four: what falls beside by chance is no reason to refuse."""
    params = SOLVER.parse({"seed": seed, "heap": {"fruits": 4, "bowl": 2.6}}, "orange")
    assert lying(params).inside.all()


def test_places_in_the_floor_or_in_the_air_are_refused():
    with pytest.raises(InvalidInput, match=r"places\.1 lies at y = -5, below the floor"):
        SOLVER.parse({"heap": {"places": [(0, 1, 0), (3, -5, 0)]}}, "orange")
    with pytest.raises(InvalidInput, match=r"places\.0 hangs at y = 30, 29 above"):
        SOLVER.parse({"heap": {"places": [(0, 30, 0), (3, 1, 0)]}}, "orange")


def test_under_the_wall_is_not_in_the_bowl():
    middle, under = (0.0, 1.2, 0.0), (4.4, 1.0, 0.0)
    with pytest.raises(InvalidInput, match="1 of 2 fruits do not fit") as refused:
        lying(SOLVER.parse({"heap": {"places": (middle, under), "bowl": 4.5, "infected": [0]}}, "orange"))
    assert "nearer to the middle" in refused.value.advice


@pytest.mark.parametrize("name", PRESETS)
def test_the_documented_bowls_run(name):
    need = Need(stages=(0.0, 0.5), quality="preview", fields=SOLVER.fields[2:])
    run = SOLVER.solve(example(name), need)
    assert run["converged"].values.all()
    assert run["overlap"].values.max() <= 1e-3
    closed = run["mass"] + run["water_lost"] + run["juice_lost"] + run["respired"]
    np.testing.assert_allclose(closed.values, 1.0, atol=1e-6)
