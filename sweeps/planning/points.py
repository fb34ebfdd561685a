"""The points of a plan: listed, on a grid, or along a Sobol sequence."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.stats import qmc

from ..errors import PlanError
from .planfile import Axis, PlanFile, Range

__all__ = ["MAX_SAMPLES", "points"]

#: More samples than this are a typing error in a range, not a plan.
MAX_SAMPLES = 100_000

#: Points of a Sobol sequence that are tried for one possible sample, before the ranges are called wrong.
_PATIENCE = 200

#: Significant digits of a generated value: 0.02 in a list and 0.02 in a range must be one number and one key.
_DIGITS = 12


def points(written: PlanFile) -> Iterator[Mapping[str, Any]]:
    """Return the values of each sample: those of a list, of a grid, or of a Sobol sequence.

    Raises:
        PlanError: they are too many.

    """
    if written.sampling.kind == "list":
        return iter(written.samples)
    if written.sampling.kind == "sobol":
        return _sobol(written)
    lists = {name: _values(axis) for name, axis in written.axes.items()}
    total = 1
    for values in lists.values():
        total *= len(values)
    _limit(total)
    return (dict(zip(lists, point, strict=True)) for point in itertools.product(*lists.values()))


def _values(axis: Axis) -> tuple[float, ...]:
    if not isinstance(axis, Range):
        return axis
    assert axis.count is not None  # a grid's range has one: checked with the grammar
    _limit(axis.count)
    space = np.geomspace if axis.scale == "log" else np.linspace
    return tuple(_round(value) for value in space(axis.start, axis.to, axis.count))


def _sobol(written: PlanFile) -> Iterator[Mapping[str, Any]]:
    count = written.sampling.count
    assert count is not None  # checked with the grammar
    _limit(count)
    unit = qmc.Sobol(len(written.axes), scramble=True, rng=written.sampling.seed)
    # impossible points are passed over and the sequence goes on, so that the plan has as many samples as it asks for
    left = _PATIENCE * count if written.sampling.skip_invalid else count
    while left > 0:
        with warnings.catch_warnings():
            # any count is allowed: the first points of the sequence stay the same, so that a plan can grow
            warnings.filterwarnings("ignore", "The balance properties of Sobol", UserWarning)
            points = unit.random(min(count, left))
        left -= len(points)
        for point in points:
            yield {name: _scaled(axis, u) for (name, axis), u in zip(written.axes.items(), point, strict=True)}


def _scaled(axis: Axis, u: float) -> float:
    """Return the value at `u` (0 to 1) between an axis's ends."""
    if isinstance(axis, Range) and axis.scale == "log":
        return _round(axis.start * (axis.to / axis.start) ** u)
    low, high = (axis.start, axis.to) if isinstance(axis, Range) else (min(axis), max(axis))
    return _round(low + (high - low) * u)


def _round(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _limit(count: int) -> None:
    if count > MAX_SAMPLES:
        raise PlanError(f"the plan has {count} samples, more than {MAX_SAMPLES}.", "Shorten the ranges.")
