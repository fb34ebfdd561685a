"""Steps of a look-up that take numpy several passes over memory: once the compiler is loaded, one (`steps_compiled`).

Both ways do the same operations on every number in the same order, so that a process gives the same bytes whether it
has the compiler or not. A look-up never loads it: that takes as long as hundreds of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from . import alone

__all__ = ["PLAIN", "Steps", "now", "use"]


class Steps(NamedTuple):
    """One way to do them.

    `total(parts (t,), terms (t, n))` returns the sum (n,) of terms times their parts, the first term first.

    `ramp(values (v,), place (n,), low (n,), high (n,))` returns 1 + values[place] low + values[place + 1] high (n,).

    `gather(parts (c, m, k, 2), factor (m, k), even, odd)` fills rows (kept, c, 2, k) of even and odd k with what a
    factor adds to waves m of which `kept` are; `scatter(parts, even, odd)` adds such rows to the waves.

    `lift(planes (3, h, w), ratio (h, w), low (3, h, w), x, y, z, out (h, w, 3))` fills `out` with planes * ratio + low
    + the fresh x, y and z, each (h, w) or (h, 1).

    `six(points (n, 2n, 3), poles (2, 3))` returns six times the volumes (2n,) between the origin and the quads of each
    column, whose corners a, b and c, d in the next row are the triangles (a, b, c) and (b, d, c). A pole is a row, too.
    """

    total: Callable[[Array, Array], Array]
    ramp: Callable[[Array, Array, Array, Array], Array]
    gather: Callable[[Array, Array, Array, Array], None]
    scatter: Callable[[Array, Array, Array], None]
    lift: Callable[[Array, Array, Array, Array, Array, Array, Array], None]
    six: Callable[[Array, Array], Array]


def _ramp(values: Array, place: Array, low: Array, high: Array) -> Array:
    found: Array = values[place] * low
    found += values[1:][place] * high
    found += 1
    return found


def _gather(parts: Array, factor: Array, even: Array, odd: Array) -> None:
    gain = factor[: len(even), None, None] - 1
    for first, rows in enumerate((even, odd)):
        np.multiply(parts[:, : len(even), first::2].transpose(1, 0, 3, 2), gain[..., first::2], out=rows)


def _scatter(parts: Array, even: Array, odd: Array) -> None:
    for first, rows in enumerate((even, odd)):
        # part by part: numpy's innermost loop is otherwise two numbers long
        for i in (0, 1):
            parts[:, : len(rows), first::2, i] += rows[:, :, i].transpose(1, 0, 2)


def _lift(planes: Array, ratio: Array, low: Array, x: Array, y: Array, z: Array, out: Array) -> None:
    moved = planes * ratio
    moved += low
    for i, fresh in enumerate((x, y, z)):
        np.add(moved[i], fresh, out=out[..., i])


def _six(points: Array, poles: Array) -> Array:
    rows, columns = points.shape[:2]
    planes = np.empty((3, rows + 2, columns + 1), points.dtype)
    planes[:, 1:-1, :-1] = np.moveaxis(points, -1, 0)
    planes[:, :, -1] = planes[:, :, 0]
    planes[:, 0], planes[:, -1] = poles[0, :, None], poles[1, :, None]
    a, c = planes[:, :-1, :-1], planes[:, 1:, :-1]
    b, d = planes[:, :-1, 1:], planes[:, 1:, 1:]
    x, y, z = ((b[j] * c[k] - b[k] * c[j]) * (a[i] - d[i]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
    found: Array = (x + y + z).sum(axis=0, dtype=np.float64)
    return found


#: By numpy.
PLAIN = Steps(alone.total, _ramp, _gather, _scatter, _lift, _six)

_way = [PLAIN]


def now() -> Steps:
    """Return the way in use."""
    return _way[0]


def use(way: Steps) -> None:
    """Do the steps that way from now on."""
    _way[0] = way
