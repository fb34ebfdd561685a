"""How far looked-up shapes are from equilibrium: how the solver moves them when it relaxes them.

Deep in the folds a run is one of many equilibria, so that correlation with one run is the wrong judge of a look-up. The
right one: put on the mesh, from which residual does it start, how far does it go until forces balance, and does it
still look the same afterwards?

On the mesh of which fruit matters: runs begin with bumps, and with a pattern that they share, which are part of their
fresh shape. About the onset these hold up wrinkles that a smooth fruit would not have: without them a run that is in
balance loses a fifth of its roughness at s = 0.1. So what is looked up keeps them where they are at hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from solver.contract import Context, Need, Solver, SolverError
from solver.lattice import lattice
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import measures
from store.surfaces.measures import Surface

from ..relaxing import begun, lattice_of

__all__ = ["Distance", "at_hand", "between", "distance", "mean"]


@dataclass(frozen=True)
class Distance:
    """How relaxing changed a shape that `method` looked up at `stage`.

    residual_placed and residual: before and after. moved: rms of the radial motion over the roughness. rgh, dB, W1 and
    corr: the shape as looked up against what became of it, as `store.surfaces.measures` has them.
    """

    method: str
    stage: float
    residual_placed: float
    residual: float
    moved: float
    rgh: float
    dB: float
    W1: float
    corr: float

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return asdict(self)


def between(table: ShapeTable, count: int, seed: int = 0) -> list[dict[str, float]]:
    """Return random points between a table's samples, drawn evenly in the logarithm of axes that allow one.

    A table of a single sample has one point.
    """
    rng = np.random.default_rng(seed)
    return [{name: _drawn(rng, *span) for name, span in table.axes.items()} for _ in range(count if table.axes else 1)]


def at_hand(table: ShapeTable, store: Store) -> bool:
    """Return whether a store, or the package, has what a table's runs begin with: the run whose pattern they share."""
    origin = table.info.template.get("pattern")
    return origin is None or store.find(str(origin["key"])) is not None


def distance(
    solver: Solver, table: ShapeTable, values: dict[str, float], stage: float, method: str, store: Store | None = None
) -> Distance | None:
    """Relax what a method looks up on the mesh of its runs until it is in balance; None where the solver cannot.

    With a `store` that has what they begin with (see `at_hand`), else without the pattern that they share.

    Raises:
        InvalidInput: it relaxes nothing.

    """
    n = measures.lattice_for(table.resolution)
    shape = table.at(values, stage, resolution=n, fields=("displacement",), method=method, apart=False)
    looked_up = shape.displacement
    assert looked_up is not None
    surface = begun(table, values, stage, method, lattice_of(table))
    need = Need(fields=("displacement", "position"), quality=table.info.quality, resolution=n)
    told, library = table.at_parameters(values), None if store is None else store.find
    params = solver.parse({name: value for name, value in told.items() if library is not None or name != "pattern"})
    try:
        found = solver.relaxed(params, surface, stage, need, Context(library=library)).isel(stage=0)
    except SolverError as error:
        if error.code == "invalid-input":
            raise
        return None
    fresh = table.fresh(values).points(*lattice(n))
    alike = measures.compare(Surface(fresh, looked_up), Surface(fresh, found["displacement"].values))
    said = {name: float(found[name]) for name in ("residual_placed", "residual", "moved")}
    return Distance(method, stage, **said, rgh=alike.rgh, dB=alike.dB, W1=alike.W1, corr=alike.corr)


def mean(rows: Sequence[Distance]) -> Distance:
    """Return the means over rows of one method and stage."""
    first = rows[0]
    numbers = {k: float(np.mean([row.to_json()[k] for row in rows])) for k in first.to_json() if k not in _PLACE}
    return Distance(first.method, first.stage, **numbers)


_PLACE = ("method", "stage")


def _drawn(rng: np.random.Generator, low: float, high: float) -> float:
    if low <= 0:
        return float(rng.uniform(low, high))
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
