"""Where a table should get its next samples: where what it would predict there is worst.

The error at a point is that of the samples around it, each predicted from the others (`store.generations.trust`), times
the distance to the nearest sample: a sample that is predicted badly asks for neighbours, and a wide gap for something
in it. Samples that form a grid get whole lines, so that they still form one and stay interpolated along it; others get
single points. Only points that the solver accepts are proposed, so that no run is wasted.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist
from scipy.stats import qmc

from solver.arrays import Array
from solver.contract import InvalidGeometry, Params
from store import tables
from store.blending.methods.weights import Samples
from store.errors import MixedSamples
from store.generations import generation, trust
from store.store import Store
from store.surfaces.measures import Measures
from store.tables import TableInfo

from ..errors import PlanError
from ..planning.plan import Plan

__all__ = ["Proposal", "State", "check", "name_of", "propose", "read", "with_samples"]


#: Points of the box among which the next sample is chosen.
_CANDIDATES = 2048
#: Significant digits of a proposed value, as of those in a plan's ranges.
_DIGITS = 12
#: Samples around a point whose errors count there.
_NEAREST = 6


@dataclass(frozen=True)
class State:
    """What refinement knows of a table: samples (count, axes), and the left-out error (count,) of each."""

    table: TableInfo
    samples: Samples
    errors: Array

    @property
    def mean(self) -> float:
        """Mean left-out error of the samples."""
        return float(self.errors.mean())


@dataclass(frozen=True)
class Proposal:
    """Runs that belong together: one point, or the missing ones of a grid's new line; and the error expected there."""

    points: tuple[dict[str, float], ...]
    samples: tuple[Params, ...]
    expected: float


def read(store: Store, name: str, measure: str) -> State:
    """Return the state of the current generation of a table, by a measure of `store.surfaces.measures`.

    Raises:
        PlanError: there is no such measure, or the table knows no errors.
        UnknownTable, CorruptTable: it cannot be read.

    """
    if measure not in Measures._fields:
        raise PlanError(f"there is no measure {measure!r}.", f"Known: {', '.join(Measures._fields)}.")
    table = tables.info(store, name)
    opened = generation.read(tables.path_of(store, table))
    found = generation.left_out(opened)
    values = np.stack([opened[axis].values for axis in table.axes], axis=-1) if table.axes else None
    if found is None or values is None:
        raise PlanError(
            f"table {name} does not say how well its samples predict each other.",
            "It needs several samples, of fruits; build it again if it is an old one.",
        )
    errors = [[trust.errors(Measures(*row))[measure] for row in rows] for rows in found[0]]
    return State(table, Samples(values), np.array(errors).mean(axis=1))


def check(plan: Plan, table: TableInfo) -> None:
    """Make sure that the plan's runs would fit the table, before any is run.

    Raises:
        MixedSamples: they would not.

    """
    advice = "Refine a table with the plan that it was built from."
    if (plan.solver.name, plan.solver.version) != (table.solver, table.version):
        raise MixedSamples(
            f"the table is of {table.solver} {table.version}, the plan of {plan.solver.name} {plan.solver.version}.",
            f"{advice} One of another version is swept and built anew first: samples of two versions do not mix.",
        )
    if not any(job.key in table.keys for job in plan.jobs()):
        raise MixedSamples(f"table {table.name} holds no run of the plan {plan.name}.", advice)
    odd = sorted(set(table.axes) - set(plan.axes))
    if odd:
        raise MixedSamples(f"the table varies {', '.join(odd)}, the plan does not.", advice)


def name_of(plan: Plan) -> str:
    """Return the name under which a plan's added runs stand in the ledger."""
    return f"{plan.name}:refined"


def propose(plan: Plan, state: State, avoid: Sequence[Mapping[str, float]] = ()) -> Iterator[Proposal]:
    """Yield proposals, the worst place first; `avoid` are points that failed, and where nothing is to be had.

    Each proposal takes those before it for granted, so that several can run at once.
    """
    return (_lines if state.samples.is_grid else _points)(plan, state, avoid)


def _points(plan: Plan, state: State, avoid: Sequence[Mapping[str, float]]) -> Iterator[Proposal]:
    candidates = _unique(_candidates(state))
    known = state.samples.points
    failed = [state.samples.scale(np.array([point[axis] for axis in state.table.axes])) for point in avoid]
    error = _interpolate(known, state.errors, candidates)
    distance = cdist(candidates, np.vstack([known, *failed])).min(axis=1)
    while (score := error * distance).max() > 0:
        i = int(np.argmax(score))
        values = _unscale(state, candidates[i])
        sample = _parse(plan, state, values)
        distance = np.minimum(distance, np.linalg.norm(candidates - candidates[i], axis=1))
        if sample is not None:
            yield Proposal((values,), (sample,), float(error[i]))
        else:
            error[i] = 0.0


def _lines(plan: Plan, state: State, avoid: Sequence[Mapping[str, float]]) -> Iterator[Proposal]:
    """Yield new lines of a grid, halfway between two of its own, those where most error lies per run first."""
    points, errors = state.samples.points, state.errors
    ticks = [_ticks(column) for column in points.T]
    found = []
    for axis, tick in enumerate(ticks):
        for low, high in itertools.pairwise(tick):
            near = np.isclose(points[:, axis], low) | np.isclose(points[:, axis], high)
            found.append(
                (float(errors[near].mean() * (high - low)), axis, (low + high) / 2, float(errors[near].mean()))
            )
    for _, axis, place, error in sorted(found, key=lambda line: (-line[0], line[1], line[2])):
        columns = [np.array([place]) if a == axis else tick for a, tick in enumerate(ticks)]
        nodes = [_snap(state, np.array(node)) for node in itertools.product(*columns)]
        samples = [_parse(plan, state, values) for values in nodes]
        # a line with a hole would end the grid
        if all(sample is not None for sample in samples) and not any(node in avoid for node in nodes):
            yield Proposal(tuple(nodes), tuple(sample for sample in samples if sample is not None), error)


def _ticks(column: Array) -> Array:
    order = np.sort(column)
    found: Array = order[np.append(True, np.diff(order) > 1e-9)]
    return found


def _candidates(state: State) -> Array:
    """Return points (count, axes) of the unit box: a space-filling sequence, and halfway between near samples."""
    known = state.samples.points
    dimension = known.shape[1]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The balance properties of Sobol", UserWarning)
        spread = qmc.Sobol(dimension, scramble=True, rng=0).random(_CANDIDATES)
    near = np.argsort(cdist(known, known), axis=1, kind="stable")[:, 1 : _NEAREST + 1]
    between = (known[:, None] + known[near]).reshape(-1, dimension) / 2
    return np.vstack([between, spread])


def _unique(points: Array) -> Array:
    return np.asarray(points[np.sort(np.unique(points.round(9), axis=0, return_index=True)[1])])


def _interpolate(known: Array, errors: Array, points: Array) -> Array:
    """Return the errors (count,) of the nearest samples at points, weighted by distance^-2."""
    distance = cdist(points, known)
    near = np.argsort(distance, axis=1, kind="stable")[:, :_NEAREST]
    weights = 1 / np.maximum(np.take_along_axis(distance, near, axis=1), 1e-9) ** 2
    return np.asarray((weights * errors[near]).sum(axis=1) / weights.sum(axis=1))


def _unscale(state: State, point: Array) -> dict[str, float]:
    values = state.samples.unscale(point).tolist()
    return {axis: float(f"{v:.{_DIGITS}g}") for axis, v in zip(state.table.axes, values, strict=True)}


def _snap(state: State, node: Array) -> dict[str, float]:
    """Return a node's parameters, to the last bit those of the samples on its lines."""
    values = _unscale(state, node)
    for a, axis in enumerate(values):
        apart = np.abs(state.samples.points[:, a] - node[a])
        if apart.min() < 1e-9:
            values[axis] = float(state.samples.values[int(apart.argmin()), a])
    return values


def _parse(plan: Plan, state: State, values: Mapping[str, float]) -> Params | None:
    """Return the parameters of a point, None where the solver refuses its geometry."""
    base = plan.samples[0].model_dump()
    for axis, value in values.items():
        field, index = plan.solver.params.axes[axis]
        if index is None:
            base[field] = value
        else:
            base[field] = tuple(value if i == index else old for i, old in enumerate(base[field]))
    try:
        return plan.solver.parse(base)
    except InvalidGeometry:
        return None


def with_samples(plan: Plan, samples: Sequence[Params]) -> Plan:
    """Return the plan of the added samples: all else as in `plan`."""
    return replace(plan, name=name_of(plan), samples=tuple(samples), skipped=0, repeated=0)
