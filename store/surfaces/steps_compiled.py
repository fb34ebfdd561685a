"""`store.surfaces.steps`, compiled: for who has the compiler loaded anyway."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from solver.arrays import Array
from solver.geometry.seen import fill

from .steps import Steps

__all__ = ["COMPILED", "load"]


#: Waves that are summed together: they stay in the processor's nearest memory.
_AT_ONCE = 2048


@njit(cache=True, nogil=True)  # a service has others to answer meanwhile
def _total(parts: Array, terms: Array) -> Array:
    count = terms.shape[1]
    found = np.zeros(count, terms.dtype)
    for first in range(0, count, _AT_ONCE):
        last = min(first + _AT_ONCE, count)
        for t in range(len(parts)):
            if parts[t] != 0:
                _add_times(found[first:last], terms[t, first:last], parts[t])
    return found


@njit(cache=True)
def _add_times(found: Array, term: Array, part: np.floating[Any]) -> None:
    for i in range(len(found)):
        found[i] += part * term[i]


@njit(cache=True, nogil=True)
def _ramp(values: Array, place: Array, low: Array, high: Array) -> Array:
    found = np.empty_like(low)
    one = values.dtype.type(1)
    for i in range(len(place)):
        j = place[i]
        found[i] = values[j] * low[i] + values[j + 1] * high[i] + one
    return found


@njit(cache=True, nogil=True)
def _gather(parts: Array, factor: Array, even: Array, odd: Array) -> None:
    one = factor.dtype.type(1)
    for c in range(parts.shape[0]):
        for m in range(even.shape[0]):
            for k in range(even.shape[3]):
                gain = factor[m, 2 * k] - one
                even[m, c, 0, k] = parts[c, m, 2 * k, 0] * gain
                even[m, c, 1, k] = parts[c, m, 2 * k, 1] * gain
            for k in range(odd.shape[3]):
                gain = factor[m, 2 * k + 1] - one
                odd[m, c, 0, k] = parts[c, m, 2 * k + 1, 0] * gain
                odd[m, c, 1, k] = parts[c, m, 2 * k + 1, 1] * gain


@njit(cache=True, nogil=True)
def _scatter(parts: Array, even: Array, odd: Array) -> None:
    for c in range(parts.shape[0]):
        for m in range(even.shape[0]):
            for k in range(even.shape[3]):
                parts[c, m, 2 * k, 0] += even[m, c, 0, k]
                parts[c, m, 2 * k, 1] += even[m, c, 1, k]
            for k in range(odd.shape[3]):
                parts[c, m, 2 * k + 1, 0] += odd[m, c, 0, k]
                parts[c, m, 2 * k + 1, 1] += odd[m, c, 1, k]


@njit(cache=True, nogil=True)
def _lift(planes: Array, ratio: Array, low: Array, x: Array, y: Array, z: Array, out: Array) -> None:
    rows, columns = ratio.shape
    # by component first: so that several points are done at once
    row = np.empty((3, columns), planes.dtype)
    for i in range(rows):
        _lift_row(planes[0, i], ratio[i], low[0, i], x[i], row[0])
        _lift_row(planes[1, i], ratio[i], low[1, i], y[i], row[1])
        _lift_row(planes[2, i], ratio[i], low[2, i], z[i], row[2])
        for j in range(columns):
            out[i, j, 0] = row[0, j]
            out[i, j, 1] = row[1, j]
            out[i, j, 2] = row[2, j]


@njit(cache=True)
def _lift_row(plane: Array, ratio: Array, low: Array, fresh: Array, row: Array) -> None:
    if len(fresh) == len(row):
        for j in range(len(row)):
            row[j] = plane[j] * ratio[j] + low[j] + fresh[j]
    else:
        for j in range(len(row)):
            row[j] = plane[j] * ratio[j] + low[j] + fresh[0]


@njit(cache=True, nogil=True, error_model="numpy")
def _six(points: Array, poles: Array) -> Array:
    rows, columns = points.shape[:2]
    found = np.zeros(columns)
    # two rows by component, closed in azimuth: so that several points are done at once
    pair = np.empty((2, 3, columns + 1), points.dtype)
    for k in range(3):
        pair[0, k] = poles[0, k]
    for i in range(rows + 1):
        if i < rows:
            fill(pair[(i + 1) % 2], points[i])
        else:
            for k in range(3):
                pair[(i + 1) % 2, k] = poles[1, k]
        _add_six(pair[i % 2], pair[(i + 1) % 2], found)
    return found


@njit(cache=True)
def _add_six(upper: Array, lower: Array, found: Array) -> None:
    for j in range(len(found)):
        bx, by, bz = upper[0, j + 1], upper[1, j + 1], upper[2, j + 1]
        cx, cy, cz = lower[0, j], lower[1, j], lower[2, j]
        x = (by * cz - bz * cy) * (upper[0, j] - lower[0, j + 1])
        y = (bz * cx - bx * cz) * (upper[1, j] - lower[1, j + 1])
        z = (bx * cy - by * cx) * (upper[2, j] - lower[2, j + 1])
        found[j] += x + y + z


COMPILED = Steps(_total, _ramp, _gather, _scatter, _lift, _six)


def load() -> None:
    """Load the code for spectra and surfaces in single and in double precision; where none is kept yet, make it."""
    place = np.zeros(1, np.int32)
    one = np.ones(2, np.float32)
    for kind in (np.float32, np.float64):
        parts, rows = np.zeros((1, 1, 2, 2), kind), np.zeros((1, 1, 2, 1), kind)
        _gather(parts, _ramp(one, place, one[:1], one[:1]).repeat(2).reshape(1, 2), rows, rows)
        _scatter(parts, rows, rows)
        planes = np.zeros((3, 2, 2), kind)
        _total(np.zeros(1, kind), np.zeros((1, 2), kind))
        _six(np.zeros((2, 4, 3), kind), np.zeros((2, 3), kind))
        _lift(planes, planes[0], planes, planes[0], planes[1], planes[2], np.zeros((2, 2, 3), kind))
