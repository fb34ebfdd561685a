"""Runs that do not fit into the time or the memory allowed, said before any work."""

from __future__ import annotations

import os
import re
import statistics

import pytest

from benchmarks import figures
from solver.contract import InvalidInput, Need, OverBudget, budget
from solver.dehydration import SOLVER
from solver.rounding import from_zero

FRUIT = SOLVER.parse({})
NEED = SOLVER.settle(Need(stages=(0.3,), quality="default"))
COST = SOLVER.cost(FRUIT, NEED)


def test_what_fits_is_let_through() -> None:
    budget.within(SOLVER, (FRUIT,), NEED, COST.seconds)
    budget.within(SOLVER, (FRUIT, FRUIT), NEED, 2 * COST.seconds)
    budget.within(SOLVER, (), NEED, 0)


def test_what_takes_longer_is_refused_with_what_it_would_take() -> None:
    with pytest.raises(OverBudget, match=f"about {from_zero(COST.seconds)} s") as caught:
        budget.within(SOLVER, (FRUIT,), NEED, COST.seconds * 0.99)
    cheap = SOLVER.cost(FRUIT, NEED.model_copy(update={"quality": "preview"})).seconds
    assert f"'preview' would take about {from_zero(cheap)} s" in caught.value.advice
    assert isinstance(caught.value, InvalidInput)
    with pytest.raises(OverBudget, match="these 2 runs"):
        budget.within(SOLVER, (FRUIT, FRUIT), NEED, 1.5 * COST.seconds)


@pytest.mark.parametrize("stage", [0.01, 0.05, 0.1, 0.2, 0.3])
@pytest.mark.parametrize("te", [0.02, 0.03, 0.04, 0.1])
@pytest.mark.parametrize("count", [1, 3])
def test_the_time_that_a_refusal_says_is_one_that_is_enough(stage: float, te: float, count: int) -> None:
    """Of the quality that was asked for, and of the cheaper one that is offered in its place."""
    fruits = (SOLVER.parse({"te": te}),) * count
    need = SOLVER.settle(Need(stages=(stage,), quality="fine"))
    with pytest.raises(OverBudget) as caught:
        budget.within(SOLVER, fruits, need, 1e-3)
    own = re.search(r"about (\S+) s, longer than the 0.001 s", caught.value.message)
    other = re.search(r"Quality '(\w+)' would take about (\S+) s", caught.value.advice)
    assert own is not None
    assert other is not None
    budget.within(SOLVER, fruits, need, float(own[1]))
    budget.within(SOLVER, fruits, need.model_copy(update={"quality": other[1]}), float(other[2]))


def test_what_needs_more_memory_is_refused() -> None:
    budget.within(SOLVER, (FRUIT,), NEED, 1e9, COST.bytes)
    with pytest.raises(OverBudget, match="GB"):
        budget.within(SOLVER, (FRUIT,), NEED, 1e9, COST.bytes - 1)


def test_the_mode_that_a_run_starts_from_takes_its_time() -> None:
    """A sphere's takes none; fruits with an elliptic equator half a minute."""

    def seconds(preset: str, kind: str) -> float:
        return SOLVER.cost(SOLVER.parse({"imperfection_kind": kind}, preset), NEED).seconds

    assert seconds("sphere", "mode") == seconds("sphere", "waves")
    assert seconds("plum2", "mode") > seconds("plum2", "waves") + 10


def test_what_is_expected_is_about_what_was_measured() -> None:
    """Runs of the table past the onset; what is loaded once is left out, and cores are not all of use."""
    rows = figures.load("dehydration-buckled")["runs"]
    latest = max((row["version"] for row in rows), key=int)
    runs = [row for row in rows if row["version"] == latest]
    loaded = SOLVER.cost(FRUIT, NEED.model_copy(update={"stages": ()})).seconds
    found = []
    for row in runs:
        params = SOLVER.parse({name: row[name] for name in ("te", "gamma", "mirrors", "seed")})
        need = SOLVER.settle(Need(stages=(0.1, 0.15, 0.2, 0.3), quality=row["quality"]))
        seconds = (SOLVER.cost(params, need).seconds - loaded) * (os.cpu_count() or 1)
        found.append((row["cpu"][-1], seconds / row["cpu"][-1]))
    longer = [ratio for cpu, ratio in found if cpu > 20]
    assert len(longer) >= 5
    # two seeds of one fruit (whole, gamma 30, fine) take 30,000 and 47,000 steps: what suits one is much for the other
    assert 0.5 < min(longer) <= max(longer) < 1.6
    assert 0.7 < statistics.median(ratio for _, ratio in found) < 1.4
