"""Everything self-contact keeps between steps, allocated once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Integers = NDArray[np.int32]
Singles = NDArray[np.float32]
Longs = NDArray[np.int64]
Single = np.float32
Long = np.int64

OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "nsz", "arcp", "contract"}}

OPPOSED = np.float32(-0.25)
"""Cosine between two outward normals below which skin faces skin (104 degrees)."""
ASKEW = 16
"""Bit of `Contact.pair_own`: node and quad do not face each other, as at the mouth of a sulcus."""
PAIRS, NEEDED, ACTIVE, SEARCHES, HITS = 0, 1, 2, 3, 4
"""Entries of `Contact.counts`."""
ENTRIES = 16
"""Room for cell entries per quad; a quad grown by the reach overlaps about 8 cells."""

NEAR = 64
"""Room for the quads near one node; those beyond are left out."""


class Contact(NamedTuple):
    """Everything the search and the push need, allocated once; a named tuple because numba reads those natively.

    ns surface nodes, nq quads, nn nodes of the volume mesh. Lengths in units of the fruit, speeds per step.
    """

    surface_nodes: Integers  # (ns,) rows of the state
    quads: Integers  # (nq, 4) surface numbering, counter-clockwise from outside
    quad_nodes: Integers  # (nq, 4) the same corners as rows of the state
    ellipsoid: Singles  # (2, 3) centre of the rest bounding box and its squared inverse half widths
    clearance: np.float32  # gap that contact keeps
    depth: np.float32  # a node deeper than this belongs to another part: left alone
    shallow: np.float32  # the same where node and quad do not face each other
    margin: np.float32  # how far beyond the clearance candidates are collected
    rings: Integers  # (ns, ring) nodes that share a quad with the node, filled up with -1
    size: np.float32  # mean rest edge length h
    recovery: np.float32  # largest push, as lacking clearance
    normals: Singles  # (ns, 3) nodal normals at the last search
    searched: Singles  # (ns, 3) positions of the last search
    frames: Singles  # (nq, 8) quad centre (3), circumscribed radius, unit normal (3), unused
    keys: Longs  # (ENTRIES nq,) cell of each entry
    order: Integers  # (ENTRIES nq,) quad of each entry, sorted by bucket
    starts: Integers  # (buckets + 1,) first of each bucket in `order`; buckets is a power of two
    pair_nodes: Integers  # (capacity,) surface node of a pair, ascending
    pair_quads: Integers  # (capacity,)
    pair_own: NDArray[np.uint8]  # (capacity,) bit k < 4: corner k of the quad lies on a quad of the node; ASKEW
    feet: Singles  # (capacity, 2) u, v of the last closest point, where the next search for it starts
    counts: Longs  # (5,) PAIRS, NEEDED, ACTIVE, SEARCHES, HITS
    load: Singles  # (ns,) scratch: how much contact each node takes part in
    near: Singles  # (NEAR, 14) scratch: the quads near one node, as `hit_values`, and height, depth, quad
    hits: Integers  # (4 ns, 2) surface node and quad of each contact of the last push
    hit_values: Singles  # (4 ns, 12) shape functions (4), direction (3), gap, stiffness, impulse, clearance, weight


def make_contact(
    surface_nodes: ArrayLike,
    quads: ArrayLike,
    rest: ArrayLike,
    clearance: float,
    te: float,
    *,
    margin: float = 0.3,
    recovery: float = 0.05,
    capacity: int = 0,
) -> Contact:
    """Allocate a contact for the skin with rest positions `rest` (nn, >= 3) and exocarp thickness te.

    margin (mean rest edges h) and recovery (h per step) rarely need changing. Capacity is in pairs, 16 per node unless
    given.
    """
    nodes = np.ascontiguousarray(surface_nodes, np.int32)
    faces = np.ascontiguousarray(quads, np.int32)
    positions = np.asarray(rest, np.float64)[nodes, :3]
    h = float(np.linalg.norm(positions[np.roll(faces, -1, axis=1)] - positions[faces], axis=2).mean())
    low, high = positions.min(0), positions.max(0)
    half = np.maximum((high - low) / 2, h)
    ns, nq = len(nodes), len(faces)
    buckets = 1 << int(4 * nq - 1).bit_length()
    pairs = capacity or 16 * ns
    single, integer = np.float32, np.int32
    return Contact(
        surface_nodes=nodes,
        quads=faces,
        quad_nodes=np.ascontiguousarray(nodes[faces]),
        ellipsoid=np.stack([(low + high) / 2, half**-2.0]).astype(single),
        clearance=single(clearance),
        # two exocarps back to back are 2 te thick: half of that cannot be mistaken for the far side of a neck
        depth=single(min(0.6 * h, 0.75 * te)),
        shallow=single(0.25 * min(0.6 * h, 0.75 * te)),
        margin=single(margin * h),
        rings=_rings(faces, ns),
        size=single(h),
        recovery=single(recovery * h),
        normals=np.zeros((ns, 3), single),
        searched=np.full((ns, 3), 1e30, single),
        frames=np.zeros((nq, 8), single),
        keys=np.zeros(ENTRIES * nq, np.int64),
        order=np.zeros(ENTRIES * nq, integer),
        starts=np.zeros(buckets + 1, integer),
        pair_nodes=np.zeros(pairs, integer),
        pair_quads=np.zeros(pairs, integer),
        pair_own=np.zeros(pairs, np.uint8),
        feet=np.zeros((pairs, 2), single),
        counts=np.zeros(5, np.int64),
        load=np.zeros(ns, single),
        near=np.zeros((NEAR, 14), single),
        hits=np.zeros((4 * ns, 2), integer),
        hit_values=np.zeros((4 * ns, 12), single),
    )


def grow(contact: Contact, needed: int) -> Contact:
    """The same contact with room for at least `needed` pairs; search again before the next push."""
    room = max(2 * needed, len(contact.pair_nodes))
    contact.searched[:] = 1e30
    contact.counts[:3] = 0
    return contact._replace(
        pair_nodes=np.zeros(room, np.int32),
        pair_quads=np.zeros(room, np.int32),
        pair_own=np.zeros(room, np.uint8),
        feet=np.zeros((room, 2), np.float32),
    )


def _rings(faces: Integers, nodes: int) -> Integers:
    """Nodes that share a quad with each node, (nodes, most), ascending, -1 where there are fewer."""
    tails, heads = np.repeat(faces, 4, axis=1).ravel(), np.tile(faces, (1, 4)).ravel()
    pairs = np.unique(np.stack([tails, heads], axis=1)[tails != heads], axis=0)
    count = np.bincount(pairs[:, 0], minlength=nodes)
    place = np.arange(len(pairs)) - np.repeat(np.cumsum(count) - count, count)
    rings = np.full((nodes, int(count.max())), -1, np.int32)
    rings[pairs[:, 0], place] = pairs[:, 1]
    return rings
