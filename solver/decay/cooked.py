"""A run in an oven: steps of one length on a path that no stage changes. Nothing lives in it."""

from __future__ import annotations

from collections.abc import Iterator

from ..contract import Context
from .fields.stepping import Reached
from .fields.system import System
from .within.roast import STEP, Roast

__all__ = ["cooked"]

_DAY = 86400.0


def cooked(system: System, days: tuple[float, ...], context: Context) -> Iterator[Reached]:
    """Yield the stages of a fruit in an oven in turn; one between two steps is reached on a copy.

    Raises:
        Cancelled: the observer asked to stop.

    """
    params, joint = system.params, system.joint
    assert params.within is not None
    assert params.oven is not None
    assert joint is not None
    roast = Roast(params, params.within, params.oven, joint, system.skin.extent)
    state, done = roast.fresh, 0
    for day in days:
        while (done + 1) * STEP <= day * _DAY * (1 + 1e-12):
            context.check_cancelled()
            state, done = roast.advance(state, STEP), done + 1
            context.report(done * STEP / max(days[-1] * _DAY, 1e-9), f"minute {done * STEP / 60:.1f}")
        rest = day * _DAY - done * STEP
        shown = roast.advance(state, rest) if rest > 1e-6 else state
        held = system.start._replace(water=roast.lost(shown.wet), wet=shown.wet, roasted=shown)
        yield Reached(day, held, done, 0.0)
