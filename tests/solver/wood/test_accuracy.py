"""What a tolerance of wood means: the errors in the record, for the bundles that it holds, and a refusal elsewhere."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from solver.contract import InvalidInput, Need
from solver.wood import SOLVER
from solver.wood.accuracy import FEWEST, expected_error

RUNS = json.loads((Path(__file__).parents[3] / "benchmarks/results/wood-bundles.json").read_text())["runs"]
QUIET = {"fracture": "none", "grain": {"strength": 0.0}}


def bundle(slender: float = 30.0, rods: int = 50, **values):
    return SOLVER.parse({**QUIET, "length": slender * 0.01, "rods": rods, **values})


def test_no_kept_run_is_worse_than_what_is_expected():
    worst: dict[int, float] = {}
    for run in RUNS:
        params = bundle(run["slender"], run["rods"], unevenness=run["unevenness"])
        swings = {"preview": run["frequency"]} if run["frequency"] else {}
        for found in (run["stiffness"], swings):
            for quality, ratio in found.items():
                assert abs(ratio - 1) <= expected_error(params, quality, 1.0), run
                worst[run["rods"]] = max(worst.get(run["rods"], 0.0), abs(ratio - 1))
    # and it says no more than half as much again, or nobody would be served by it
    for rods, off in worst.items():
        assert expected_error(bundle(rods=rods), "preview", 1.0) <= 1.5 * off
    assert set(worst) == {FEWEST, 50, 200}


def test_a_tolerance_picks_a_quality_by_the_rods():
    many = bundle(rods=200)
    # the record's largest error of 200 rods is .44 %
    assert SOLVER.settle(Need(tolerance=0.005, stages=(1.0,)), of=(many,)).quality == "preview"
    with pytest.raises(InvalidInput, match="no error was measured at fine"):
        SOLVER.settle(Need(tolerance=0.003, stages=(1.0,)), of=(many,))
    with pytest.raises(InvalidInput, match="finer than what wood was measured"):
        SOLVER.settle(Need(tolerance=0.003, stages=(1.0,)), of=(bundle(),))


@pytest.mark.parametrize(
    "values",
    [
        {"fracture": "stress"},
        {"mode": "auto"},
        {"curvature": 1.0},
        {"clamp": "both"},
        {"rods": 19},
        {"rods": 201},
        {"slender": 9.9},
        {"slender": 101.0},
        {"vertices": 29},
        {"unevenness": 0.4},
        {"reach": 1.0},
        {"shear": 1e9},
        {"twist": True},
        {"outline": [(0.0, 0.0), (0.02, 0.0), (0.02, 0.02), (0.0, 0.02)]},
        {"grain": {"strength": 0.0, "stiffness": 0.1}},
        {"grain": {"strength": 0.0, "spiral": 1.0}},
        {"mass_scaling": 100.0},
        {"bodies": [{"size": (0.01, 0.01, 0.01), "path": [{"time": 0.0, "position": (0.1, 0.0, 0.1)}]}]},
    ],
)
def test_what_was_not_measured_is_refused_with_what_was(values):
    with pytest.raises(InvalidInput, match="no error was measured for") as refused:
        expected_error(bundle(**values), "preview", 1.0)
    assert "quality" in refused.value.advice


def test_equilibria_that_break_nothing_have_one():
    assert expected_error(bundle(fracture="stress", mode="static"), "preview", 1.0) < 0.01
