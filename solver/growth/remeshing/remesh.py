"""Remeshing after a step: short rest edges collapse, long ones are cut, and thin triangles turn over."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ...arrays import Ints
from ...contract import OverBudget
from ...geometry.crossings import crossings
from ..state import State
from .collapses import collapse
from .cuts import cut
from .flips import flip

__all__ = ["MOST", "remesh"]


#: A mesh does not grow beyond this many times its first vertices.
MOST = 20
#: Rest edges shorter than this share of the longest allowed are removed: a cut leaves no less than half.
_SHORT = 0.25


def remesh(
    state: State, longest: float, most: int, apart: bool = False
) -> Generator[None, None, tuple[State, list[Ints]]]:
    """Find the state without rest edges above `longest` or far below it, edges turned over where that helps.

    Yields after pieces of the work; the generator's value is the state and, with it, the changes: for each vertex
    (n', 2) the two before in the middle of which it lies, twice the same where it was there. apart: whether nothing may
    pass through the sheet: what would, when triangles change where it is not flat, is left for another time.

    Raises:
        OverBudget: there would be more than `most` vertices.

    """
    changes: list[Ints] = []
    coarser, left = collapse(state, longest * _SHORT)
    if coarser is not state and not (apart and _crossed(coarser)):
        state = coarser
        changes.append(np.stack([left, left], -1))
    yield
    while True:
        finer, ends = cut(state, longest)
        if finer is state:
            break
        if len(finer.x) > most:
            raise OverBudget(
                f"at growth time {state.time:g} the mesh needs over {most} vertices, {MOST} times those at its start.",
                advice="Grow less, let edges be longer (`remesh`), or leave the mesh as it is (remesh = 0).",
                last_stage=state.time,
            )
        stayed = np.arange(len(state.x))
        changes.append(np.concatenate([np.stack([stayed, stayed], -1), ends]))
        state = finer
        yield
    yield
    turned = flip(state)
    return (state if apart and turned is not state and _crossed(turned) else turned), changes


def _crossed(state: State) -> bool:
    return crossings(state.x, state.mesh.triangles).count > 0
