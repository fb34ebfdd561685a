"""What is promised of a run's error, against all runs that were measured."""

from __future__ import annotations

import math
import statistics

import numpy as np
import pytest

from benchmarks import figures
from benchmarks.figures import Row
from solver.contract import InvalidInput, Need
from solver.dehydration import SOLVER
from solver.dehydration.accuracy import SCATTER, expected_error, of_mesh

RUNS = [row for row in figures.load("dehydration-meshes")["runs"] if "failed" not in row]
LATEST = max((row["version"] for row in RUNS), key=int)


def farthest(row: Row, stage: int, truth: float) -> float:
    """How far a run is off at most; of seeds whose mean and standard deviation alone were kept, any of them."""
    value, spread = row["roughness"][stage], row.get("deviation", [0.0] * 5)[stage]
    # of n values with that deviation none is farther from the mean
    n = len(row.get("seeds", [0]))
    reach = spread * value * (n - 1) / math.sqrt(n)
    return max(abs(value + sign * reach - truth) for sign in (-1, 1)) / truth


def test_every_measured_run_is_as_near_the_finest_as_expected() -> None:
    """Each seed, stage and mesh, against the mean of the finest mesh's runs of the same fruit, those included."""
    runs = [row for row in RUNS if row["version"] == LATEST]
    checked = 0
    for row in runs:
        same = [other for other in runs if all(other[name] == row[name] for name in ("te", "gamma"))]
        finest = [other for other in same if other["n"] == max(each["n"] for each in same)]
        for stage in range(len(row["roughness"])):
            truth = statistics.mean(other["roughness"][stage] for other in finest)
            promised = of_mesh(row["te"], row["gamma"], row["n"])
            assert farthest(row, stage, truth) <= promised, (row["gamma"], row["n"], row.get("seed"), stage)
            checked += 1
    assert checked >= 60


def test_what_a_quality_is_promised_holds_for_runs_that_it_was_not_made_of() -> None:
    """Runs of another record, by meshes with fewer layers of flesh, against the mean of fine's."""
    rows = figures.load("dehydration-buckled")["runs"]
    latest = max((row["version"] for row in rows), key=int)
    runs = [row for row in rows if row["version"] == latest and row["te"] >= 0.02]
    checked = 0
    for row in (row for row in runs if row["quality"] != "fine"):
        fruit = {name: row[name] for name in ("te", "gamma", "mirrors")}
        finest = [r["roughness"] for r in runs if r["quality"] == "fine" and fruit.items() <= r.items()]
        off = np.abs(np.array(row["roughness"]) / np.mean(finest, axis=0) - 1)
        assert off.max() <= expected_error(SOLVER.parse(fruit), row["quality"], 0.3), (fruit, row["quality"])
        checked += 1
    assert checked >= 40


def test_a_quality_is_promised_what_its_mesh_is() -> None:
    params = SOLVER.parse({})
    assert expected_error(params, "default", 0.3) == of_mesh(0.04, 10.0, 26)


def test_the_expected_error_falls_with_the_mesh_and_grows_with_the_stiffness() -> None:
    def error(quality: str, **values: float) -> float:
        return expected_error(SOLVER.parse(values), quality, 0.3)  # type: ignore[arg-type]

    assert error("preview") > error("default") > error("fine") > SCATTER
    assert error("default", gamma=50.0) > error("default", gamma=30.0) > error("default", gamma=10.0)
    assert error("default", gamma=50.0) == error("default", gamma=40.0)


def test_a_tolerance_takes_the_quality_that_the_fruit_needs() -> None:
    def quality(**values: float) -> str:
        return SOLVER.settle(Need(tolerance=0.35), of=[SOLVER.parse(values)]).quality

    assert quality() == "preview"
    assert quality(gamma=50.0) == "fine"
    both = [SOLVER.parse({}), SOLVER.parse({"gamma": 50.0})]
    assert SOLVER.settle(Need(tolerance=0.35), of=both).quality == "fine"
    with pytest.raises(InvalidInput, match="finer than what"):
        SOLVER.settle(Need(tolerance=0.05), of=both)


@pytest.mark.parametrize("last", [0.1, 0.3])
def test_the_tolerance_that_a_refusal_says_is_one_that_is_reached(last: float) -> None:
    for te in np.linspace(0.02, 0.04, 6):
        for gamma in (10.0, 13.0, 22.0, 35.0, 50.0):
            params = SOLVER.parse({"te": float(te), "gamma": gamma})
            with pytest.raises(InvalidInput) as caught:
                SOLVER.settle(Need(tolerance=1e-3, stages=(last,)), of=[params])
            said = float(caught.value.advice.removeprefix("The finest setting was measured at ").removesuffix("."))
            SOLVER.settle(Need(tolerance=said, stages=(last,)), of=[params])


@pytest.mark.parametrize("stages", [(-0.2,), (-0.2, 0.2), (0.2, 0.4)])
def test_a_tolerance_holds_for_all_stages(stages: tuple[float, ...]) -> None:
    with pytest.raises(InvalidInput, match="no error was measured"):
        SOLVER.settle(Need(tolerance=0.5, stages=stages), of=[SOLVER.parse({})])


@pytest.mark.parametrize(
    "values", [{"te": 0.005}, {"te": 0.1}, {"gamma": 100.0}, {"r4": 0.8}, {"wy": 0.3}, {"rs1": 0.5, "rs2": 0.5}]
)
def test_what_was_never_measured_is_refused_with_what_it_takes(values: dict[str, float]) -> None:
    with pytest.raises(InvalidInput, match="no error was measured") as caught:
        SOLVER.settle(Need(tolerance=0.5), of=[SOLVER.parse(values)])
    assert "elements" in (caught.value.advice or "")
