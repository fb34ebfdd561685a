"""Numbers of the rest state that remeshing asks for after every step, of the whole mesh."""

from __future__ import annotations

import numpy as np
from numba import njit

from ... import shell
from ...arrays import Bools, Floats, Ints

__all__ = ["edge_squares", "flat_hinges"]


def edge_squares(g: Floats, mesh: shell.Topology) -> Floats:
    """Return the squared rest lengths (e,) of edges from metrics g (f, 3): the mean of their triangles'."""
    found = np.zeros(len(mesh.edges))
    _edge_squares(g, mesh.face_edges, found, np.zeros(len(found)))
    return found


def flat_hinges(g: Floats, mesh: shell.Topology, near: float) -> Ints:
    """Return the hinges whose opposite rest angles come within `near` of pi together, or exceed it."""
    return np.flatnonzero(_flat(g, mesh.hinge_faces, mesh.hinge_corners, np.sin(near)))


@njit(cache=True, error_model="numpy")
def _edge_squares(g: Floats, face_edges: Ints, found: Floats, count: Floats) -> None:
    for t in range(len(g)):
        squares = (g[t, 0] + g[t, 2] - 2 * g[t, 1], g[t, 2], g[t, 0])
        for k in range(3):
            found[face_edges[t, k]] += squares[k]
            count[face_edges[t, k]] += 1
    for e in range(len(found)):
        found[e] /= count[e]


@njit(cache=True, error_model="numpy")
def _flat(g: Floats, hinge_faces: Ints, hinge_corners: Ints, sine: float) -> Bools:
    """Return where the sine of the sum of both angles is below `sine` (h,)."""
    found = np.empty(len(hinge_faces), np.bool_)
    cosines, sines = np.empty(2), np.empty(2)
    for h in range(len(hinge_faces)):
        for side in range(2):
            t, k = hinge_faces[h, side], hinge_corners[h, side]
            a, b, c = g[t, 0], g[t, 1], g[t, 2]
            if k == 0:
                dot, square = b, a * c
            elif k == 1:
                dot, square = a - b, a * (a + c - 2 * b)
            else:
                dot, square = c - b, c * (a + c - 2 * b)
            size = np.sqrt(square)
            cosines[side], sines[side] = dot / size, np.sqrt(a * c - b * b) / size
        found[h] = sines[0] * cosines[1] + cosines[0] * sines[1] < sine
    return found
