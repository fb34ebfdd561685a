"""Declared tolerances are what sheets show: the record's worst, and previews measured again."""

import pytest

from benchmarks.figures import load
from benchmarks.growth.sheets import CASES, QUALITIES, SHEETS, measured
from solver.growth import SOLVER
from solver.growth.settings import choose

RUNS = [run for run in load("growth-sheets")["runs"] if "off" in run]


@pytest.mark.parametrize("quality", QUALITIES)
def test_a_tolerance_is_the_worst_of_the_record(quality: str):
    """Of all but a ripple's height: that hangs on how many waves there are, and no quality promises it."""
    runs = [run for run in RUNS if run["quality"] == quality]
    assert {run["sheet"] for run in runs} == set(SHEETS)
    worst = max(abs(off) for run in runs for what, off in run["off"].items() if what != "height")
    assert 0.85 * SOLVER.tolerances[quality] < worst <= SOLVER.tolerances[quality]


@pytest.mark.parametrize("name", [name for name in SHEETS if "grows" not in name])
def test_a_preview_is_as_far_off_as_the_record_says(name: str):
    case = CASES[name]()
    found, _ = measured(case, choose("preview"))
    (kept,) = [run for run in RUNS if run["sheet"] == name and run["quality"] == "preview"]
    for what, expected in case.theory.items():
        off = found[what] / expected - 1
        assert off == pytest.approx(kept["off"][what], rel=0.02, abs=1e-4)
        assert abs(off) <= SOLVER.tolerances["preview"]
