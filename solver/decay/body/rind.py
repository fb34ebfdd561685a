"""A rind behind an open mesh: the closed surface of flesh of one thickness, on the side that the triangles face from.

The inner side is the mesh moved against its normals, wound the other way; a strip along each border joins the two.
Where the mesh bends more sharply than the thickness the inner side crosses itself, which what is inside does not mind.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Ints
from ...contract import InvalidGeometry
from ...shell.normals import normals

__all__ = ["place", "rind"]


def rind(points: Floats, faces: Ints, thickness: float) -> tuple[Floats, Ints]:
    """Return points (2 v, 3) and faces of the closed surface behind an open mesh (v, 3), (f, 3); thickness [r1].

    Raises:
        InvalidGeometry: more than two triangles share an edge, or neighbours are wound opposite ways.

    """
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, back, uses = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    shared = uses[back.ravel()]
    if shared.max() > 2:
        raise InvalidGeometry(
            f"{int(shared.max())} triangles share an edge at {place(points[ends[np.argmax(shared), 0]])}.",
            advice="An open mesh gets a rind of flesh where no more than two do. Split it there, or take body=none.",
        )
    first, count = np.unique(ends, axis=0, return_counts=True)
    if count.max() > 1:
        raise InvalidGeometry(
            f"neighbouring triangles are wound opposite ways at {place(points[first[np.argmax(count), 0]])}.",
            advice="Wind them alike: an open mesh has its flesh on the side that they face from.",
        )
    inner = points - thickness * normals(points, faces)
    a, b = ends[shared == 1].T
    far = len(points)
    strip = np.concatenate([np.stack([b, a, a + far], axis=1), np.stack([b, a + far, b + far], axis=1)])
    return np.concatenate([points, inner]), np.concatenate([faces, faces[:, ::-1] + far, strip])


def place(point: Floats) -> str:
    """Return a point as errors say it."""
    return "(" + ", ".join(f"{x:.3g}" for x in point) + ")"
