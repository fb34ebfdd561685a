"""Spectra that are summed together, side by side: the weighted mean of many is then one pass over memory."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from ..kept import Kept, Part
from ..surfaces import steps
from ..surfaces.packed import Stored

__all__ = ["Stacks"]

#: Bytes of stacks that all tables keep.
_ROOM = 64 << 20
#: Share of waves that are not zero up to which the others are left out: putting them back takes its time, too.
_SPARSE = 0.6
#: Samples up to which they have a stack of their own: the corners of a cell. Where splines count, more take part, and
#: neighbouring cells share most of them: these use one stack by stage, of all samples of a table, up to so many.
_CORNERS, _MOST = 4, 64
#: Terms up to which they are added one by one, which reads no others. Leaning leaves two or four in most answers.
_FEW = 4

#: Samples, stages and band of a stack.
_Key = tuple[tuple[int, ...], tuple[int, ...], int]


class _Stack(NamedTuple):
    """Waves (terms, n) of spectra of a `shape`, at the `place` (n,) of each if not at all."""

    waves: Array
    place: Array | None
    shape: tuple[int, ...]


_kept: Kept[tuple[int, _Key], _Stack] = Kept(_ROOM, lambda stack: stack.waves.nbytes)


class Stacks:
    """Weighted means of the spectra (sample, stage, component, m, k, part) of a table."""

    def __init__(self, stored: Stored) -> None:
        self._stored = stored
        self._kept = Part(_kept, self)

    def mean(self, samples: tuple[int, ...], stages: tuple[int, ...], parts: Array, band: int) -> Array:
        """Return the sum (component, m, k, part), m, k <= `band`, of all samples at all stages, samples first, times
        their `parts`; zero where there are none.
        """
        if not stages or len(samples) <= _CORNERS or len(self._stored) > _MOST:
            return self._sum(samples, stages, parts, band)
        every = np.zeros((len(stages), len(self._stored)), parts.dtype)
        every[:, list(samples)] = parts.reshape(len(samples), -1).T
        whole = tuple(range(len(self._stored)))
        found = self._sum(whole, stages[:1], every[0], band)
        for j, own in zip(stages[1:], every[1:], strict=True):
            found += self._sum(whole, (j,), own, band)
        return found

    def _sum(self, samples: tuple[int, ...], stages: tuple[int, ...], parts: Array, band: int) -> Array:
        stack = self._kept.get((samples, stages, band), lambda: self._stack(samples, stages, band))
        found = _total(parts.astype(stack.waves.dtype), stack.waves)
        if stack.place is not None:
            full = np.zeros(int(np.prod(stack.shape)), found.dtype)
            full[stack.place] = found
            found = full
        whole: Array = found.reshape(stack.shape)
        return whole

    def _stack(self, samples: tuple[int, ...], stages: tuple[int, ...], band: int) -> _Stack:
        cut = slice(band + 1)
        terms = [self._stored[i, j][:, cut, cut] for i, j in itertools.product(samples, stages)]
        shape = self._stored[0, 0][:, cut, cut].shape
        if not terms:  # the fresh shape alone
            return _Stack(np.zeros((0, int(np.prod(shape))), self._stored.dtype), None, shape)
        waves = np.stack([np.ascontiguousarray(term).ravel() for term in terms])
        place = np.flatnonzero(waves.any(axis=0))
        if len(place) > _SPARSE * waves.shape[1]:
            return _Stack(waves, None, shape)
        return _Stack(np.ascontiguousarray(waves[:, place]), place, shape)


def _total(parts: Array, waves: Array) -> Array:
    """Return the sum (n,) of waves (terms, n) times their parts (terms,): where few of these count, of those alone."""
    used = np.flatnonzero(parts).tolist()
    if not used or len(used) > _FEW:
        return steps.now().total(parts, waves)
    found: Array = waves[used[0]] * parts[used[0]]
    for i in used[1:]:
        found += waves[i] * parts[i]
    return found
