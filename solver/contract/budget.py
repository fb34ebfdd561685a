"""Whether what is asked for fits into a given time and this machine's memory, said before any work."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..rounding import from_zero, towards_zero
from .errors import OverBudget
from .need import Need, Quality

if TYPE_CHECKING:
    from .params import Params
    from .solver import Solver

__all__ = ["within"]


def within(solver: Solver, samples: Sequence[Params], need: Need, seconds: float, memory: int | None = None) -> None:
    """Refuse runs of `samples`, one after the other, that are expected to take more than `seconds` in all.

    Args:
        solver: who computes.
        samples: its parameters.
        need: settled.
        seconds: wall time that all of them may take.
        memory: bytes that one run may take; this machine's without.

    Raises:
        OverBudget: with what the runs would take, and what a cheaper quality would.

    """
    allowed = _installed() if memory is None else memory
    time, most = _expected(solver, samples, need)
    if not samples or (time <= seconds and most <= allowed):
        return
    runs = "this run" if len(samples) == 1 else f"these {len(samples)} runs"
    if time > seconds:
        found = f"{runs} would take about {from_zero(time)} s, longer than the {towards_zero(seconds, 4)} s allowed."
    else:
        need_gb, have_gb = from_zero(most / 1e9), towards_zero(allowed / 1e9)
        found = f"a run would need about {need_gb} GB, more than the {have_gb} GB there are."
    raise OverBudget(found, advice=_cheaper(solver, samples, need, seconds, allowed))


def _expected(solver: Solver, samples: Sequence[Params], need: Need) -> tuple[float, int]:
    costs = [solver.cost(params, need) for params in samples]
    return sum(cost.seconds for cost in costs), max((cost.bytes for cost in costs), default=0)


def _cheaper(solver: Solver, samples: Sequence[Params], need: Need, seconds: float, allowed: int) -> str:
    """Say what fits, or what comes nearest."""
    order: list[Quality] = ["preview", "default", "fine"]
    for quality in reversed(order[: order.index(need.quality)]):
        time, most = _expected(solver, samples, need.model_copy(update={"quality": quality}))
        if (time <= seconds and most <= allowed) or quality == order[0]:
            said = f"Quality {quality!r} would take about {from_zero(time)} s and {from_zero(most / 1e9)} GB"
            return f"{said}; fewer or earlier stages less."
    return "Ask for fewer or earlier stages, or for less of the shape (mirrors, where the solver has them)."


def _installed() -> int:
    """Return bytes of this machine's memory."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
