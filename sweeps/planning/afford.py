"""Whether what is left of a plan fits into the time allowed."""

from __future__ import annotations

from pathlib import Path

from solver.contract import budget
from store import starter
from store.store import Store

from ..errors import InvalidOption
from .plan import Plan

__all__ = ["afford"]


def afford(plan: Plan, store: Path, seconds: float, scheduler: str | None) -> None:
    """Refuse the runs of a plan that are neither stored nor in the package, if they take longer than `seconds` here.

    Raises:
        InvalidOption: other machines compute, whose speed nobody knows.
        OverBudget: they would, or one would take more memory than there is.

    """
    if scheduler is not None:
        raise InvalidOption("--max-seconds knows this machine alone.", "Leave it out, or --scheduler.")
    opened = Store.open(store) if store.exists() else None

    def known(key: str) -> bool:
        # what comes with the package is taken over
        return (opened is not None and opened.has(key)) or starter.has(key)

    for part in plan.parts():
        jobs = zip(part.samples, part.jobs(), strict=True)
        left = [params for params, job in jobs if not known(job.key)]
        budget.within(part.solver, left, part.need, seconds)
        seconds -= sum(part.solver.cost(params, part.need).seconds for params in left)
