"""Whether what is left of a plan fits into the time allowed."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

from solver.contract import OverBudget, budget
from solver.rounding import from_zero, towards_zero
from store import starter
from store.store import Store

from ..errors import InvalidOption
from .plan import Plan

__all__ = ["afford"]


def afford(
    plan: Plan, store: Path, seconds: float, scheduler: str | None, workers: int = 1, memory: int | None = None
) -> None:
    """Refuse the runs of a plan that are neither stored nor in the package, if they take longer than `seconds` here.

    They are counted one after the other: workers share the cores, which one run may use by itself. Their memory is that
    of as many as run at once, of `memory` bytes; this machine's without.

    Raises:
        InvalidOption: other machines compute, whose speed nobody knows.
        OverBudget: they would, or would take more memory than there is.

    """
    if scheduler is not None:
        raise InvalidOption("--max-seconds knows this machine alone.", "Leave it out, or --scheduler.")
    opened = Store.open(store) if (store / "shards").is_dir() else None

    def known(key: str) -> bool:
        # what comes with the package is taken over
        return (opened is not None and opened.has(key)) or starter.has(key)

    spent = 0.0
    for part in plan.parts():
        jobs = zip(part.samples, part.jobs(), strict=True)
        left = [params for params, job in jobs if not known(job.key)]
        try:
            budget.within(part.solver, left, part.need, seconds - spent, memory)
        except OverBudget as error:
            told = [error.advice]
            if spent:
                told.append(f"Of the {seconds:g} s, those before take about {from_zero(spent)}.")
            if workers > 1:
                told.append("Runs are counted one after the other: what several workers gain is not known.")
            raise OverBudget(error.message, advice=" ".join(told)) from None
        costs = [part.solver.cost(params, part.need) for params in left]
        _check_memory([cost.bytes for cost in costs], workers, memory)
        spent += sum(cost.seconds for cost in costs)


def _check_memory(bytes: list[int], workers: int, memory: int | None) -> None:
    """Refuse more runs at once than there is memory for; one by itself has its room.

    Raises:
        OverBudget: saying how many workers fit.

    """
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if memory is None else memory
    needed = list(itertools.accumulate(sorted(bytes, reverse=True)[:workers]))
    if needed and needed[-1] > there:
        fitting = sum(total <= there for total in needed)
        raise OverBudget(
            f"{len(needed)} runs at once would need about {from_zero(needed[-1] / 1e9)} GB, more than the "
            f"{towards_zero(there / 1e9)} GB there are.",
            advice=f"Use fewer workers: --workers {fitting}.",
        )
