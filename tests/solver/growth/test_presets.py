"""Presets are what the gallery shows: the files of examples/growth."""

import tomllib
from pathlib import Path

import pytest

from solver.growth.params import GrowthParams
from solver.growth.presets import PRESETS

FOLDER = Path(__file__).parents[3] / "examples" / "growth"
NAMES = {
    "sphere-spot": "a-isotropic",
    "sphere-anisotropic": "a-anisotropic",
    "sphere-twisted": "a-twisted",
    "sphere-branching": "a-branching",
    "mushroom": "b-mushroom-normalised",
    "leaf": "b-leaf",
    "pumpkin": "c-pumpkin",
    "flower": "c-flower",
    "bed": "d-bed",
    "cloth": "e-cloth",
    "cabbage": "f-cabbage",
    "calla": "h-calla",
    "fern": "h-fern",
    "lettuce": "h-lettuce",
}


def test_every_preset_has_its_file():
    assert PRESETS.keys() == NAMES.keys()


@pytest.mark.parametrize("preset", NAMES)
def test_a_preset_is_the_example_that_was_looked_at(preset):
    values = tomllib.loads((FOLDER / f"{NAMES[preset]}.toml").read_text(encoding="utf-8"))
    assert GrowthParams.parse(PRESETS[preset]) == GrowthParams.parse(values)
