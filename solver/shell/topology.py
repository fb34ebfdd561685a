"""Edges and hinges of a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..contract import InvalidGeometry

__all__ = ["Topology", "part_of", "topology"]


@dataclass(frozen=True, eq=False)
class Topology:
    """What follows from the triangles alone.

    triangles: (f, 3). edges: (e, 2), lower vertex first, sorted. face_edges: (f, 3), edge opposite to corner k.
    hinges: (h, 4) edge from 0 to 1 as the first triangle turns, then the opposite corners of both triangles.
    hinge_edges: (h,) edge under a hinge. hinge_faces, hinge_corners: (h, 2) its triangles and the opposite corners.
    border: (b,) edges of one triangle.
    """

    triangles: Ints
    edges: Ints
    face_edges: Ints
    hinges: Ints
    hinge_edges: Ints
    hinge_faces: Ints
    hinge_corners: Ints
    border: Ints
    vertices: int


def topology(triangles: NDArray[np.integer], vertices: int) -> Topology:
    """Return edges and hinges of `triangles` (f, 3) on `vertices` points.

    Raises:
        InvalidGeometry: a corner that is no vertex, a triangle with two equal corners, an edge of three triangles,
            two neighbours that turn in opposite senses.

    """
    faces = np.asarray(triangles, np.int64)
    if faces.size == 0 or faces.min() < 0 or faces.max() >= vertices:
        raise InvalidGeometry("the triangles name vertices that are not there.", advice="Count vertices from 0.")
    if (faces == np.roll(faces, 1, axis=1)).any():
        raise InvalidGeometry("a triangle has the same vertex twice.", advice="Remove collapsed triangles.")
    # half-edge k of a face runs from corner k+1 to corner k+2 and lies opposite to corner k
    tails, heads = np.roll(faces, -1, axis=1).T.ravel(), np.roll(faces, -2, axis=1).T.ravel()
    keys = np.minimum(tails, heads) * vertices + np.maximum(tails, heads)
    unique, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    if counts.max() > 2:
        raise InvalidGeometry(
            f"{int((counts > 2).sum())} edges belong to three or more triangles.",
            advice="Split the surface where its sheets meet.",
        )
    inverse = inverse.ravel()
    order = np.argsort(inverse, kind="stable")
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    shared = np.flatnonzero(counts == 2)
    a, b = order[first[shared]], order[first[shared] + 1]
    if (tails[a] != heads[b]).any():
        raise InvalidGeometry("two neighbouring triangles turn in opposite senses.", advice="Orient the mesh.")
    count = len(faces)
    faces_of, corners_of = np.stack([a % count, b % count], -1), np.stack([a // count, b // count], -1)
    opposite = faces[faces_of, corners_of]
    return Topology(
        triangles=faces,
        edges=np.stack([unique // vertices, unique % vertices], -1),
        face_edges=inverse.reshape(3, count).T.copy(),
        hinges=np.column_stack([tails[a], heads[a], opposite]),
        hinge_edges=shared,
        hinge_faces=faces_of,
        hinge_corners=corners_of,
        border=np.flatnonzero(counts == 1),
        vertices=vertices,
    )


def part_of(mesh: Topology, faces: Ints) -> tuple[Topology, Ints, Ints]:
    """Return the topology of some triangles (m,), rising, and which vertices and hinges of `mesh` it has, in order.

    Vertices, edges and hinges keep their order, so that what belongs to them can be taken by number.
    """
    triangles, face_edges = mesh.triangles[faces], mesh.face_edges[faces]
    vertices, number = _kept(triangles, mesh.vertices)
    edges, edge_number = _kept(face_edges, len(mesh.edges))
    face_number = np.full(len(mesh.triangles), -1)
    face_number[faces] = np.arange(len(faces))
    sides = face_number[mesh.hinge_faces]
    hinges = np.flatnonzero((sides >= 0).all(axis=1))
    found = Topology(
        triangles=number[triangles],
        edges=number[mesh.edges[edges]],
        face_edges=edge_number[face_edges],
        hinges=number[mesh.hinges[hinges]],
        hinge_edges=edge_number[mesh.hinge_edges[hinges]],
        hinge_faces=sides[hinges],
        hinge_corners=mesh.hinge_corners[hinges],
        border=np.flatnonzero(np.bincount(edge_number[face_edges].ravel(), minlength=len(edges)) == 1),
        vertices=len(vertices),
    )
    return found, vertices, hinges


def _kept(used: Ints, count: int) -> tuple[Ints, Ints]:
    """Return the different numbers below count that are used, sorted, and for each number its place among them."""
    there = np.zeros(count, bool)
    there[used] = True
    return np.flatnonzero(there), np.cumsum(there) - 1
