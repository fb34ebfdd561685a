"""The state on other triangles with the same vertices, or with fewer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ... import shell
from ...arrays import Floats, Ints
from ..anchors import Anchors, corners_of, on_surface
from ..state import State
from ..tooling.holding import loosened

__all__ = ["FOLD", "rebuilt"]


#: The fold beyond which an edge stays [radian].
FOLD = 0.5


def rebuilt(
    state: State, triangles: Ints, g: Floats, left: Ints, riding: dict[str, Floats], faces: dict[str, Ints]
) -> State:
    """Return the state on new triangles; left (n',): vertices that stay; riding, faces: `corners`, `faces` of a state.

    Hinges that were there keep their rest angles; new ones are bent like the old ones about their ends.
    """
    mesh, n = state.mesh, len(state.x)
    new = shell.topology(triangles, len(left))
    bent = state.rest / _widths(state.g, mesh)
    total = np.bincount(mesh.hinges.ravel(), np.repeat(bent, 4), n) / np.maximum(
        np.bincount(mesh.hinges.ravel(), minlength=n), 1
    )
    rest = total[left][new.hinges[:, :2]].mean(axis=1) * _widths(g, new)
    before, now = mesh.edges[mesh.hinge_edges] @ [n, 1], left[new.edges[new.hinge_edges]] @ [n, 1]
    _, old, same = np.intersect1d(before, now, return_indices=True)
    rest[same] = state.rest[old]
    x = state.x[left]
    corners = corners_of(x, triangles)

    def moved(anchors: Anchors) -> Anchors:
        return on_surface(anchors, state.x, mesh.triangles, corners)

    found = replace(
        state,
        x=x,
        mesh=new,
        g=g,
        rest=rest,
        shares={k: v[left] for k, v in state.shares.items()},
        held=state.held[left],
        matter={k: v[left] for k, v in state.matter.items()},
        corners=riding,
        faces=faces,
        drift=None if state.drift is None else state.drift[left],
        spots={k: tuple(replace(spot, anchor=moved(spot.anchor)) for spot in v) for k, v in state.spots.items()},
        curves={k: moved(a) for k, a in state.curves.items()},
    )
    return loosened(found)


def _widths(g: Floats, mesh: shell.Topology) -> Floats:
    """Return the sum of both triangles' heights over each hinge's edge (h,)."""
    squares = np.stack([g[:, 0] + g[:, 2] - 2 * g[:, 1], g[:, 2], g[:, 0]], -1)
    heights = 2 * shell.areas(g)[:, None] / np.sqrt(squares)
    found: Floats = heights[mesh.hinge_faces, mesh.hinge_corners].sum(axis=1)
    return found
