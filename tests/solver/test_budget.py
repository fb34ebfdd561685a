"""Runs that do not fit into the time or the memory allowed, said before any work."""

from __future__ import annotations

import pytest

from solver.contract import InvalidInput, Need, OverBudget, budget
from solver.dehydration import SOLVER

FRUIT = SOLVER.parse({})
NEED = SOLVER.settle(Need(stages=(0.3,), quality="default"))
COST = SOLVER.cost(FRUIT, NEED)


def test_what_fits_is_let_through() -> None:
    budget.within(SOLVER, (FRUIT,), NEED, COST.seconds)
    budget.within(SOLVER, (FRUIT, FRUIT), NEED, 2 * COST.seconds)
    budget.within(SOLVER, (), NEED, 0)


def test_what_takes_longer_is_refused_with_what_it_would_take() -> None:
    with pytest.raises(OverBudget, match=f"about {COST.seconds:.0f} s") as caught:
        budget.within(SOLVER, (FRUIT,), NEED, COST.seconds * 0.99)
    cheap = SOLVER.cost(FRUIT, NEED.model_copy(update={"quality": "preview"})).seconds
    assert f"'preview' would take about {cheap:.0f} s" in caught.value.advice
    assert isinstance(caught.value, InvalidInput)
    with pytest.raises(OverBudget, match="these 2 runs"):
        budget.within(SOLVER, (FRUIT, FRUIT), NEED, 1.5 * COST.seconds)


def test_what_needs_more_memory_is_refused() -> None:
    budget.within(SOLVER, (FRUIT,), NEED, 1e9, COST.bytes)
    with pytest.raises(OverBudget, match="GB"):
        budget.within(SOLVER, (FRUIT,), NEED, 1e9, COST.bytes - 1)
