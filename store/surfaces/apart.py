"""A looked-up surface out of contact with itself: between samples that fold, a blend of them folds into itself.

What crosses on the lattice that is handed over is evened out there (`solver.geometry.apart`), from nothing on.
A fine lattice first takes over what that did on the one of `COARSE` colatitudes: rounds of evening out reach from point
to point, and points of a fine lattice lie close.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.arrays import Array
from solver.geometry.outward import faces_outward
from solver.lattice import azimuths, closed_lattice, colatitudes

from . import steps

if TYPE_CHECKING:
    from solver.geometry.apart import Topology

__all__ = ["COARSE", "Evened", "compiled", "crossings", "even_out"]

#: Lattice on which most of the evening out is done: what tables are asked for mostly.
COARSE = 64
#: The smallest that is a surface.
_LEAST = 4
#: Gap that is left between triangles [r1]: rounded to single precision, two come nearer by up to that.
_ROUNDED = 2e-7


class Evened(NamedTuple):
    """How points (n, 2n, 3) and the two poles (2, 3) have to move, None where none has, and the pairs of triangles that
    cross afterwards; `near` of them crossed before, or nearly did.
    """

    points: Array | None
    poles: Array | None
    crossings: int
    near: int


def compiled() -> None:
    """Load the compiled code that folded surfaces need, and that of `steps`; where none is kept yet, make it: some 20 s
    of a processor.
    """
    from solver.geometry.apart import put_apart
    from solver.geometry.seen import seen_whole

    from .steps_compiled import COMPILED, load

    colatitude, azimuth = np.meshgrid(colatitudes(_LEAST), azimuths(_LEAST), indexing="ij")
    x, y = np.sin(colatitude) * np.cos(azimuth), np.sin(colatitude) * np.sin(azimuth)
    ball = np.stack([x, y, np.cos(colatitude)], axis=-1).reshape(-1, 3)
    ends = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    put_apart(np.concatenate([ball, ends]), _topology(_LEAST), 0)
    for kind in (np.float32, np.float64):
        seen_whole(ball.reshape(_LEAST, 2 * _LEAST, 3).astype(kind), ends.astype(kind))
    load()
    steps.use(COMPILED)


def crossings(points: Array, poles: Array) -> int:
    """Return how many pairs of triangles of a closed lattice, points (n, 2n, 3) and poles (2, 3), cross.

    What is seen whole from the centre crosses nowhere; for the others compiled code is loaded.
    """
    given, ends = (np.require(part, requirements=["C", "W"]) for part in (points, poles.astype(points.dtype)))
    if _is_seen_whole(given, ends):
        return 0
    from solver.geometry import crossings as geometry

    whole = np.concatenate([given.reshape(-1, 3), ends], dtype=np.float64)
    return int(geometry.crossings(whole, closed_lattice(len(given))).count)


def even_out(
    whole: Callable[[int], tuple[Array, Array]],
    n: int,
    keep: bool = False,
    before: Callable[[], None] = lambda: None,
) -> Evened:
    """Return how the surface `whole(n)`, points and poles of the lattice of n colatitudes, comes out of contact.

    `keep` moves nothing where nothing crosses, however near it comes: a stored result, on a lattice fine enough.
    `before` is called where there is something to do that takes its time: the surface folds.
    """
    points, poles = whole(n)
    if _is_seen_whole(points, poles):
        return Evened(None, None, 0, 0)
    before()
    given = np.concatenate([points.reshape(-1, 3), poles], dtype=np.float64)
    # compiled: loaded when the first surface that folds is asked for
    from solver.geometry.apart import ROUNDS, look, look_again, put_apart

    topology, moved = _topology(n), given.copy()
    looked = look(moved, topology)
    # of a fine lattice only whether it has to be, at first
    found = put_apart(moved, topology, 0 if keep or n > COARSE else ROUNDS, looked, _ROUNDED)
    near = found.near
    if not near or (keep and not found.crossings):
        return Evened(None, None, found.crossings, near)
    if keep and n <= COARSE:
        found = put_apart(moved, topology, looked=looked, least=_ROUNDED)
    if n > COARSE:
        coarse = even_out(whole, max(COARSE, n // 2), before=before)
        if coarse.points is not None and coarse.poles is not None:
            moved[:-2] += _refine(coarse.points, coarse.poles, n).reshape(-1, 3)
            moved[-2:] += coarse.poles
            looked = look_again(moved, topology, looked, (moved != given).any(axis=1))
        found = put_apart(moved, topology, looked=looked, least=_ROUNDED)
    shift = moved - given
    return Evened(shift[:-2].reshape(n, 2 * n, 3), shift[-2:], found.crossings, near)


def _is_seen_whole(points: Array, poles: Array) -> bool:
    # once the compiler is there, by what it makes; it is not loaded for that
    if "solver.geometry.apart" not in sys.modules:
        return faces_outward(points, poles)
    from solver.geometry.seen import seen_whole

    return bool(seen_whole(points, poles))


@lru_cache(maxsize=8)
def _topology(n: int) -> Topology:
    from solver.geometry.apart import Topology

    return Topology.of(closed_lattice(n), 2 * n * n + 2, _across_needles(n))


def _across_needles(n: int) -> Array:
    """Return neighbours (m, 2) along the circles next to the poles, as far as points lie apart from north to south.

    There triangles are needles, and evening out from each point to the next takes hundreds of rounds.
    """
    links = []
    for row, colatitude in enumerate(colatitudes(n)):
        reach, step, column = 1 / np.sin(colatitude), 2, np.arange(2 * n)
        while step <= min(reach, n - 1):
            links += [np.stack([column, (column + way) % (2 * n)], axis=1) + 2 * n * row for way in (-step, step)]
            step *= 2
    return np.concatenate(links) if links else np.zeros((0, 2), int)


def _refine(coarse: Array, poles: Array, n: int) -> Array:
    """Return a field (m, 2m, 3) with its values (2, 3) at the poles on the finer lattice of n, linear in between."""
    m = len(coarse)
    ends = [np.broadcast_to(pole, (1, 2 * m, 3)) for pole in poles]
    lines = np.concatenate([ends[0], coarse, ends[1]])
    places = np.concatenate([[0.0], (np.arange(m) + 0.5) / m, [1.0]])
    row = np.interp((np.arange(n) + 0.5) / n, places, np.arange(m + 2.0))
    upper = np.minimum(row.astype(int), m)
    part = (row - upper)[:, None, None]
    down = lines[upper] * (1 - part) + lines[upper + 1] * part
    column = np.arange(2 * n) * (m / n)
    left = column.astype(int)
    part = (column - left)[:, None]
    found: Array = down[:, left % (2 * m)] * (1 - part) + down[:, (left + 1) % (2 * m)] * part
    return found
