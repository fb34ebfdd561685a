"""Splitting of long rest edges: the shape stays where it is, and so does the membrane's energy.

A marked triangle is cut from the middle of its longest edge first (Rivara's 4T-LE), so that repeated splitting keeps
angles at no less than half. Children have the parent's metric, seen from their own edges; rest curvature goes through
the tensor of the parent, so that a coarse sphere's children bend like the sphere and not like its facets.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ... import shell
from ...arrays import Bools, Floats, Ints
from ..anchors import corners_of, on_surface
from ..state import Spot, State
from ..tooling.holding import loosened
from .rest import edge_squares

__all__ = ["cut"]


#: Children by cut edges (bit 1: bc, the longest; 2: ca; 4: ab); corners a b c, middles p of bc, q of ca, s of ab.
_A, _B, _C, _P, _Q, _S = range(6)
_WHERE = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
_CHILDREN = {
    1: ((_A, _B, _P), (_A, _P, _C)),
    3: ((_A, _B, _P), (_A, _P, _Q), (_Q, _P, _C)),
    5: ((_A, _S, _P), (_S, _B, _P), (_A, _P, _C)),
    7: ((_A, _S, _P), (_S, _B, _P), (_A, _P, _Q), (_Q, _P, _C)),
}


def cut(state: State, longest: float) -> tuple[State, Ints]:
    """Return the state with every rest edge above `longest` cut, and what else must be; itself if there is none.

    With it come the ends (m, 2) of the edges that were cut.
    """
    mesh = state.mesh
    mean = edge_squares(state.g, mesh)
    marked = mean > longest**2
    if not marked.any():
        return state, mesh.edges[:0]
    # both sides of an edge must agree which edge of theirs is longest: the mean's, with the edge's number for ties
    first = np.argmax(mean[mesh.face_edges] * (1 + 1e-12 * (mesh.face_edges % 7)), axis=1)
    base = mesh.face_edges[np.arange(len(first)), first]
    while True:
        more = marked[mesh.face_edges].any(axis=1) & ~marked[base]
        if not more.any():
            break
        marked[base[more]] = True
    middles = np.full(len(mesh.edges), -1)
    middles[marked] = mesh.vertices + np.arange(int(marked.sum()))
    i, j = mesh.edges[marked].T

    def carried(values: Floats) -> Floats:
        return np.concatenate([values, 0.5 * (values[i] + values[j])])

    x = carried(state.x)
    triangles, g, b, touched, riding, faces = _children(state, first, middles)
    new = shell.topology(triangles, len(x))
    rest = _rest(state, new, g, b, touched)

    corners = corners_of(x, triangles)

    def moved(spot: Spot) -> Spot:
        return replace(spot, anchor=on_surface(spot.anchor, state.x, mesh.triangles, corners))

    found = replace(
        state,
        x=x,
        mesh=new,
        g=g,
        rest=rest,
        drift=None if state.drift is None else carried(state.drift),
        shares={k: carried(v) for k, v in state.shares.items()},
        matter={k: carried(v) for k, v in state.matter.items()},
        corners=riding,
        faces=faces,
        held=np.concatenate([state.held, state.held[i] & state.held[j]]),
        spots={k: tuple(moved(spot) for spot in spots) for k, spots in state.spots.items()},
        curves={k: on_surface(a, state.x, mesh.triangles, corners) for k, a in state.curves.items()},
    )
    return loosened(found), mesh.edges[marked]


def _children(
    state: State, first: Ints, middles: Ints
) -> tuple[Ints, Floats, Floats, Bools, dict[str, Floats], dict[str, Ints]]:
    """Return triangles, metrics and second forms (f', 3) after cutting, which are new, and what rides on them."""
    mesh = state.mesh
    forms = np.stack([state.g, shell.from_angles(state.rest, state.g, mesh)])
    turn = (first[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(mesh.triangles, turn, axis=1)
    edges = middles[np.take_along_axis(mesh.face_edges, turn, axis=1)]
    case = (edges >= 0) @ np.array([1, 2, 4])
    # forms as seen from the turned corner: columns of its two edges in the old basis
    ends = _WHERE[:3][turn]
    turned = _seen(forms, ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0])
    six = np.concatenate([corners, edges], axis=1)
    keep = case == 0
    seen = {name: np.take_along_axis(v, turn[:, :, None], axis=1) for name, v in state.corners.items()}
    riding = {name: [v[keep]] for name, v in state.corners.items()}
    parents = [np.flatnonzero(keep)]
    parts = [(mesh.triangles[keep], forms[:, keep], np.zeros(int(keep.sum()), bool))]
    for kind, children in _CHILDREN.items():
        rows = case == kind
        for a, b, c in children:
            shape = (int(rows.sum()), 2)
            one, two = np.broadcast_to(_WHERE[b] - _WHERE[a], shape), np.broadcast_to(_WHERE[c] - _WHERE[a], shape)
            parents.append(np.flatnonzero(rows))
            u, v = _WHERE[[a, b, c]].T
            for name, values in seen.items():
                riding[name].append(np.einsum("cj,fjk->fck", np.stack([1 - u - v, u, v], -1), values[rows]))
            parts.append((six[rows][:, [a, b, c]], _seen(turned[:, rows], one, two), np.ones(shape[0], bool)))
    triangles = np.concatenate([p[0] for p in parts])
    both = np.concatenate([p[1] for p in parts], axis=1)
    owners = np.concatenate(parents)
    carried = {name: np.concatenate(values) for name, values in riding.items()}
    faces = {name: values[owners] for name, values in state.faces.items()}
    return triangles, both[0], both[1], np.concatenate([p[2] for p in parts]), carried, faces


def _seen(forms: Floats, u: Floats, v: Floats) -> Floats:
    """Return symmetric forms (..., f, 3) on the basis u, v (f, 2)."""

    def apply(p: Floats, q: Floats) -> Floats:
        mixed = p[:, 0] * q[:, 1] + p[:, 1] * q[:, 0]
        return forms[..., 0] * p[:, 0] * q[:, 0] + forms[..., 1] * mixed + forms[..., 2] * p[:, 1] * q[:, 1]

    return np.stack([apply(u, u), apply(u, v), apply(v, v)], -1)


def _rest(state: State, new: shell.Topology, g: Floats, b: Floats, touched: Bools) -> Floats:
    """Return rest angles: the old ones where both triangles stayed, else those of the second forms."""
    rest = shell.added_angles(b, g, new)
    n = new.vertices
    stayed = np.flatnonzero(~touched[new.hinge_faces].any(axis=1))
    before, now = (m.edges[m.hinge_edges] @ [n, 1] for m in (state.mesh, new))
    rest[stayed] = state.rest[np.searchsorted(before, now[stayed])]
    return rest
