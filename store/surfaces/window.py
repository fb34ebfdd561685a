"""Part of a surface: a patch of the lattice and some of the components, and the way to them that is the shortest.

A patch that is small enough is evaluated by two small matrices, one in colatitude and one in azimuth, from the waves
alone; a larger one by the whole lattice's fast transforms, of which it is cut. Both agree to round-off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from . import alone, transforms

__all__ = ["WHOLE", "Patch", "Window", "around", "down", "planes", "series"]


#: Operations of the matrices that take as long as the fast transforms' work on one point of the lattice, measured.
_PER_POINT = 110


class Patch(NamedTuple):
    """A window on the lattice of n colatitudes: `height` rows from `top`, `width` columns from `left`, which may pass
    the end of a row and go on at its beginning; and the components' numbers.
    """

    n: int
    top: int
    height: int
    left: int
    width: int
    components: tuple[int, ...]

    @property
    def is_whole(self) -> bool:
        """Whether all rows and columns are in it."""
        return self.height == self.n and self.width == 2 * self.n

    @property
    def rows(self) -> slice:
        """The rows."""
        return slice(self.top, self.top + self.height)

    @property
    def columns(self) -> Array | slice:
        """The columns, from left to right."""
        if self.width == 2 * self.n:
            return slice(None)
        return np.arange(self.left, self.left + self.width) % (2 * self.n)


@dataclass(frozen=True)
class Window:
    """Ranges of colatitude (0 to pi) and azimuth [radian], and the components x, y, z as 0, 1, 2.

    An azimuth range that ends before it begins passes the meridian 0.
    """

    colatitude: tuple[float, float] = (0.0, math.pi)
    azimuth: tuple[float, float] = (0.0, 2 * math.pi)
    components: tuple[int, ...] = (0, 1, 2)

    @lru_cache(maxsize=64)  # noqa: B019 - windows are small and equal ones are the same key
    def on(self, n: int) -> Patch:
        """Return the lattice points within; the nearest row or column where none is."""
        north, south = (angle * n / math.pi - 0.5 for angle in self.colatitude)
        top, height = _within(north, south, n)
        first, last = (angle * n / math.pi for angle in self.azimuth)
        if last - first >= 2 * n - 1e-9:
            return Patch(n, top, height, 0, 2 * n, self.components)
        while last < first:
            last += 2 * n
        left, width = _within(first, last, None)
        return Patch(n, top, height, left % (2 * n), min(width, 2 * n), self.components)


WHOLE = Window()


def _within(first: float, last: float, count: int | None) -> tuple[int, int]:
    """Return the first whole number in a range and how many there are; the one nearest to its middle if none is."""
    begin, end = math.ceil(first - 1e-9), math.floor(last + 1e-9)
    if end < begin:
        begin = end = round((first + last) / 2)
    if count is not None:
        begin, end = min(max(begin, 0), count - 1), max(min(end, count - 1), 0)
    return begin, end - begin + 1


@contextmanager
def planes(waves: Array, patch: Patch) -> Iterator[Array]:
    """Lend the values (c, height, width) on a patch of spectra (3, m, k), of its components only; good until left."""
    n = patch.n
    if len(patch.components) < len(waves):
        waves = waves[list(patch.components)]
    if not patch.is_whole and _by_matrices(waves.shape[-1], patch):
        yield series(waves, patch)
        return
    with transforms.borrow(n, min(waves.shape[1] - 1, n), len(waves), waves.real.dtype) as plan:
        plan.put(waves)
        found = plan.run()
        yield found if patch.is_whole else found[:, patch.rows][..., patch.columns]


def _by_matrices(waves: int, patch: Patch) -> bool:
    """Return whether two matrices take fewer operations than the whole lattice's transforms."""
    held = min(waves, patch.n + 1)
    work = 4 * held * held * patch.height + 4 * held * patch.height * patch.width
    return work < _PER_POINT * 2 * patch.n * patch.n


def series(waves: Array, patch: Patch) -> Array:
    """Sum spectra (c, m, k) at the points of a patch: (c, height, width)."""
    held = min(waves.shape[-1], patch.n + 1)
    waves = waves[:, :held, :held]
    real = waves.real.dtype
    count = len(waves)
    lines = np.empty((count, patch.height, held, 2), real)
    cosines, sines = down(patch.n, held, patch.top, patch.height, real.str)
    for first, matrix in ((0, cosines), (1, sines)):
        parts = np.ascontiguousarray(waves[:, first::2]).view(real).reshape(count, -1, held, 2)
        lines[:, :, first::2] = np.einsum("cmkp,kt->ctmp", parts, matrix, optimize=True)
    columns = around(patch.n, held, patch.left, patch.width, real.str)
    return alone.product(lines.reshape(count * patch.height, -1), columns).reshape(count, patch.height, -1)


@lru_cache(maxsize=32)
def down(n: int, held: int, top: int, height: int, dtype: str) -> tuple[Array, Array]:
    """Return cosines and sines (k, rows) of the colatitudes of a patch."""
    angle = np.outer(np.arange(held), (np.arange(top, top + height) + 0.5) * np.pi / n)
    return np.cos(angle).astype(dtype), np.sin(angle).astype(dtype)


@lru_cache(maxsize=32)
def around(n: int, held: int, left: int, width: int, dtype: str) -> Array:
    """Return the waves (real and imaginary part of m in turn, columns) of a real field."""
    m = np.arange(held)
    angle = np.outer(m, np.arange(left, left + width) * np.pi / n)
    twice = np.where(m == 0, 1.0, 2.0)[:, None]
    both = np.stack([twice * np.cos(angle), -twice * np.sin(angle)], axis=1)
    return np.ascontiguousarray(both.reshape(2 * held, width).astype(dtype))
