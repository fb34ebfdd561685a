"""What the first questions need is loaded once the service answers: whoever opens the page does not wait for it.

Descriptions of solvers, what the tables cover, the first table and the code that looks a folded shape up: some 1.5 s of
a processor, which the first visitor waited for. It is done aside, in a thread, a moment after the service has begun to
listen: what it is asked at once comes before that.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from solver import registry
from solver.contract import SolverError
from store.errors import StoreError

from ..errors import ServiceError
from ..telemetry import LOGGER
from .live import LiveTables

__all__ = ["warm"]

#: Pause before it begins: health checks and scripts ask as soon as the port is open [s].
_PAUSE = 0.2
#: Tables that the page prefers to begin with.
_FIRST = ("default", "sphere")


def warm(tables: LiveTables, then: Callable[[LiveTables], object]) -> threading.Thread:
    """Begin to load what a service's first questions need, and what comes `then`; return the thread that does it.

    A store that is missing or damaged, or a table without a shape in its middle, is left to those who ask: they are
    told what is wrong.
    """
    thread = threading.Thread(target=_load, args=(tables, then), name="warming", daemon=True)
    thread.start()
    return thread


def _load(tables: LiveTables, then: Callable[[LiveTables], object]) -> None:
    time.sleep(_PAUSE)
    from threadpoolctl import threadpool_limits

    for name in registry.names():
        registry.get(name)
    # a product that BLAS divides (a table's cell has some) leaves a thread that spins on for 27 ms, on another's core
    threadpool_limits(1, user_api="blas")
    try:
        _open_first(tables)
        then(tables)
    except (StoreError, ServiceError, SolverError, OSError) as error:
        LOGGER.info("nothing to load before the first question: %s", error)


def _open_first(tables: LiveTables) -> None:
    """Look up one shape of the table that the page begins with."""
    names = tables.names()
    for name in [name for name in _FIRST if name in names][:1] or names[:1]:
        table = tables.get(name)
        middle = {axis: (low + high) / 2 for axis, (low, high) in table.info.axes.items()}
        table.at(middle, max(table.info.stages, key=abs), resolution=64)
        # where this one does not fold, others may; and what does not is seen through several times as fast by that code
        tables.before_folds()
