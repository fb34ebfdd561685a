"""What a tolerance of decay means: the errors in the record, for the runs that it holds, and a refusal elsewhere."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from solver.contract import InvalidInput, Need
from solver.decay import SOLVER
from solver.decay.accuracy import LAST, MEASURED, expected_error

RUNS = json.loads((Path(__file__).parents[3] / "benchmarks/results/decay-mesh.json").read_text())["runs"]
CELLS = {"preview": 32, "default": 96}


@pytest.mark.parametrize("preset", MEASURED)
@pytest.mark.parametrize("quality", CELLS)
def test_no_kept_run_is_worse_than_what_is_expected_and_none_far_better(preset, quality):
    (run,) = (r for r in RUNS if r["preset"] == preset and r["cells"] == CELLS[quality])
    worst = max(run["error_rot"], run["error_mould"])
    assert worst <= expected_error(SOLVER.parse({}, preset), quality, run["days"]) <= 1.5 * worst
    assert run["days"] == LAST


def asked(tolerance, preset="apple", stages=(10.0,), **values):
    params = SOLVER.parse(values, preset)
    return SOLVER.settle(Need(tolerance=tolerance, stages=stages), preset, of=(params,))


def test_a_tolerance_picks_a_quality_by_the_colonies():
    assert asked(0.06).quality == "default"
    assert asked(0.06, "apple-paper").quality == "preview"
    assert asked(0.002, "apple-paper").quality == "default"


@pytest.mark.parametrize(
    ("tolerance", "preset", "stages"),
    [(0.002, "apple", (10.0,)), (0.2, "apple", (20.0,)), (0.2, "orange", (10.0,)), (0.2, "tomato-paper", (10.0,))],
)
def test_what_was_not_measured_is_refused_with_what_was(tolerance, preset, stages):
    with pytest.raises(InvalidInput, match="no error was measured") as refused:
        asked(tolerance, preset, stages)
    assert "quality" in refused.value.advice
