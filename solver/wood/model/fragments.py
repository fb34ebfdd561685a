"""Fragments: what hangs together by whole edges and bonds. Without scaled masses nobody asks, and there are none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from .arrays import Bonds, Rods

__all__ = ["Fragments", "fragments"]


class Fragments(NamedTuple):
    """Which vertices hang together. Without scaling there are none."""

    of: np.ndarray  # (v,) int32 fragment of a vertex
    gain: np.ndarray  # (n,) g of each; 1 where something is held
    run: np.ndarray  # (m + 1,) int64 where vertices of another fragment begin
    heavy: np.ndarray  # (n,) scaled masses [kg]; 0 where something is held
    law: np.ndarray  # (2,) s; real mass that an edge in contact needs to be stable [kg]
    field: np.ndarray  # (n, 15) what `rigid` finds


@njit(cache=True)
def _root(up: np.ndarray, i: int) -> int:
    while up[i] != i:
        up[i] = up[up[i]]
        i = up[i]
    return i


@njit(cache=True)
def _join(up: np.ndarray, i: int, j: int) -> None:
    p = _root(up, i)
    q = _root(up, j)
    # the lower number is the root: the same whatever the order
    if p < q:
        up[q] = p
    elif q < p:
        up[p] = q


@njit(cache=True, error_model="numpy")
def fragments(rods: Rods, bonds: Bonds, held: np.ndarray, mass: np.ndarray, scaling: float, least: float) -> Fragments:
    """Return the fragments of what is whole; none if `scaling` is 1.

    held (v,) uint8; mass (v,) scaled [kg]; least [kg]: real mass that an edge in contact needs to be stable.
    """
    count = len(mass) if scaling > 1.0 else 0
    up = np.arange(count)
    of = np.zeros(count, np.int32)
    law = np.array([scaling, least])
    if count == 0:
        return Fragments(of, np.zeros(0), np.zeros(1, np.int64), np.zeros(0), law, np.zeros((0, 15)))
    for e in range(len(rods.a)):
        if rods.alive[e] == 1 and rods.k[e] > 0.0:
            _join(up, rods.a[e], rods.b[e])
    for b in range(len(bonds.i)):
        # what is broken but in the way pushes: with its real mass alone, a chip could not bear that at long steps
        if bonds.on[b] > 0:
            _join(up, rods.a[bonds.i[b]], rods.a[bonds.j[b]])
    number = 0
    name = np.full(count, -1, np.int32)
    for i in range(count):
        r = _root(up, i)
        if name[r] < 0:
            name[r] = number
            number += 1
        of[i] = name[r]
    heavy = np.zeros(number)
    for i in range(count):
        heavy[of[i]] += mass[i]
    for i in range(count):
        if held[i] == 1:
            heavy[of[i]] = 0.0
    gain = np.where(heavy > 0.0, scaling, 1.0)
    change = np.flatnonzero(of[1:] != of[:-1]) + 1
    run = np.zeros(len(change) + 2, np.int64)
    run[1:-1] = change
    run[-1] = count
    return Fragments(of, gain, run, heavy, law, np.zeros((number, 15)))
