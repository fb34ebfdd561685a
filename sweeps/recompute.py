"""Spot checks of a table by solving again: a stored run must come out as it is stored."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from solver import registry
from solver.contract import Context, Need, SolverError
from store import shards
from store.checking.audit import Finding
from store.store import Store
from store.tables import TableInfo

from . import tabled
from .relaxing import starts

__all__ = ["Spot", "recompute"]


class Spot(NamedTuple):
    """A run solved again: whether its content has the same digest, and the largest change of its displacement [r1]."""

    key: str
    same: bool
    apart: float


def recompute(
    store: Store,
    table: TableInfo,
    keys: Sequence[str],
    count: int,
    seed: int = 0,
    tolerance: float = 0.0,
    cancelled: Callable[[], bool] = lambda: False,
) -> Iterator[Spot | Finding]:
    """Solve `count` of the runs `keys` of a table again, drawn with `seed`, and yield how each came out.

    One machine gives the same bytes; another may round differently, and `tolerance` [r1] allows for that.

    Raises:
        Cancelled: `cancelled` said so.
        StoreError: the ledger or a result cannot be read.

    """
    solver = registry.get(table.solver)
    if solver.version != table.version:
        yield Finding(
            "run",
            table.solver,
            f"the table is of version {table.version}, this program has {solver.version}: nothing was solved again. "
            "Install that version, or sweep and build anew.",
        )
        return
    if not keys:
        yield Finding("run", table.name, "none of its runs is here: nothing was solved again. Run its plan again.")
        return
    store.learn()  # where the ledger was lost
    drawn = np.random.default_rng(seed).permutation(len(keys))[:count]
    chosen = [keys[i] for i in sorted(drawn.tolist())]
    for key in chosen:
        yield _spot(store, key, tolerance, cancelled)


def _spot(store: Store, key: str, tolerance: float, cancelled: Callable[[], bool]) -> Spot | Finding:
    job = store.ledger.get(key)
    solver, stored = registry.get(job.solver), store.get(key)
    try:
        context = Context(cancelled=cancelled, library=store.find, shapes=tabled.shape, starts=starts(store))
        again = solver.solve(solver.parse(job.params), Need.parse(job.need), context)
    except SolverError as error:
        if error.code == "cancelled":
            raise
        return Finding("run", key, f"it cannot be solved again: {error.message} Delete it and run the sweep again.")
    before, after = stored["displacement"], again["displacement"].transpose(*stored["displacement"].dims)
    if before.shape != after.shape:
        return Finding("run", key, f"its displacement was {before.shape} and is now {after.shape}.")
    same = shards.digest(again) == stored.attrs["digest"]
    apart = float(np.linalg.norm(after.values.astype(float) - before.values, axis=-1).max())
    if not same and apart > tolerance:
        return Finding(
            "run",
            key,
            f"solved again, its displacement moves by up to {apart:.3g} r1 (allowed: {tolerance:g}). "
            "If another machine solved it, allow for round-off with --tolerance; else delete it and sweep again.",
        )
    return Spot(key, same, apart)
