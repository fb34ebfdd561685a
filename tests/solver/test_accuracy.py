"""What is promised of a run's error, against all runs that were measured."""

from __future__ import annotations

import statistics

import pytest

from benchmarks import figures
from solver.contract import InvalidInput, Need
from solver.dehydration import SOLVER
from solver.dehydration.accuracy import SCATTER, expected_error

RUNS = [row for row in figures.load("dehydration-buckled")["runs"] if "failed" not in row]
LATEST = max((row["version"] for row in RUNS), key=int)


def test_every_measured_run_is_as_near_the_finest_as_expected() -> None:
    """Each seed, stage and quality, against the mean of the finest runs of the same fruit."""
    runs = [row for row in RUNS if row["version"] == LATEST]
    checked = 0
    for row in runs:
        fruit = {name: row[name] for name in ("te", "gamma", "mirrors")}
        finest = [other for other in runs if other["quality"] == "fine" and fruit.items() <= other.items()]
        if not finest or row["quality"] == "fine":
            continue
        params = SOLVER.parse(fruit)
        expected = expected_error(params, row["quality"], 0.3)
        for stage, value in enumerate(row["roughness"]):
            truth = statistics.mean(other["roughness"][stage] for other in finest)
            assert abs(value / truth - 1) <= expected, (fruit, row["quality"], row["seed"], stage)
            checked += 1
    assert checked >= 48


def test_the_expected_error_falls_with_the_mesh_and_grows_with_the_stiffness() -> None:
    def error(quality: str, **values: float) -> float:
        return expected_error(SOLVER.parse(values), quality, 0.3)  # type: ignore[arg-type]

    assert error("preview") > error("default") > error("fine") > SCATTER
    assert error("default", gamma=50.0) > error("default", gamma=30.0) > error("default", gamma=10.0)


def test_a_tolerance_takes_the_quality_that_the_fruit_needs() -> None:
    def quality(**values: float) -> str:
        return SOLVER.settle(Need(tolerance=0.21), of=[SOLVER.parse(values)]).quality

    assert quality() == "preview"
    assert quality(gamma=50.0) == "fine"
    both = [SOLVER.parse({}), SOLVER.parse({"gamma": 50.0})]
    assert SOLVER.settle(Need(tolerance=0.21), of=both).quality == "fine"
    with pytest.raises(InvalidInput, match="finer than what"):
        SOLVER.settle(Need(tolerance=0.05), of=both)


@pytest.mark.parametrize(
    "values", [{"te": 0.005}, {"te": 0.1}, {"gamma": 100.0}, {"r4": 0.8}, {"wy": 0.3}, {"rs1": 0.5, "rs2": 0.5}]
)
def test_what_was_never_measured_is_refused_with_what_it_takes(values: dict[str, float]) -> None:
    with pytest.raises(InvalidInput, match="no error was measured") as caught:
        SOLVER.settle(Need(tolerance=0.5), of=[SOLVER.parse(values)])
    assert "elements" in (caught.value.advice or "")
