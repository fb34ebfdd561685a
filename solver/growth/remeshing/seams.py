"""Seams: edges on the two sides of which texture coordinates or materials differ. They stay where they are."""

from __future__ import annotations

import numpy as np

from ...arrays import Bools, Floats, Ints
from ..state import State

__all__ = ["ends", "seams", "turned"]


def ends(state: State, values: Floats, hinges: Ints) -> tuple[Floats, Floats, Floats, Floats]:
    """Return corner values (m, k) of hinges (m,) at the edge's two ends: as the first triangle has them, the second."""
    mesh = state.mesh
    (a, b), (p, q) = mesh.hinge_faces[hinges].T, mesh.hinge_corners[hinges].T
    # the second triangle runs along the edge the other way
    return values[a, (p + 1) % 3], values[a, (p + 2) % 3], values[b, (q + 2) % 3], values[b, (q + 1) % 3]


def seams(state: State) -> Bools:
    """Return which hinges (h,) are seams."""
    found = np.zeros(len(state.mesh.hinges), bool)
    every = np.arange(len(found))
    for values in state.corners.values():
        i, j, k, m = ends(state, values, every)
        found |= (i != k).any(axis=1) | (j != m).any(axis=1)
    for numbers in state.faces.values():
        a, b = state.mesh.hinge_faces.T
        found |= numbers[a] != numbers[b]
    return found


def turned(state: State, hinges: Ints) -> dict[str, Floats]:
    """Return corner values after hinges (m,), none of them a seam, turned over: (k, m, j) and (m, k, i)."""
    found = {}
    (a, b), (p, q) = state.mesh.hinge_faces[hinges].T, state.mesh.hinge_corners[hinges].T
    for name, values in state.corners.items():
        i, j, _, _ = ends(state, values, hinges)
        k, m = values[a, p], values[b, q]
        found[name] = values.copy()
        found[name][a], found[name][b] = np.stack([k, m, j], 1), np.stack([m, k, i], 1)
    return found
