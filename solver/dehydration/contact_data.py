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

OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": {"reassoc", "nsz", "arcp", "contract"}}

OPPOSED = np.float32(-0.25)
"""Cosine between two outward normals below which skin faces skin (104 degrees)."""
PAIRS, NEEDED, ACTIVE, SEARCHES = 0, 1, 2, 3
"""Entries of `Contact.counts`."""
ENTRIES = 16
"""Room for cell entries per quad; a quad grown by the reach overlaps about 8 cells."""


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
    margin: np.float32  # how far beyond the clearance candidates are collected
    size: np.float32  # mean rest edge length h
    recovery: np.float32  # largest speed at which a penetrating node is led out
    normals: Singles  # (ns, 3) nodal normals at the last search
    searched: Singles  # (ns, 3) positions of the last search
    frames: Singles  # (nq, 8) quad centre (3), circumscribed radius, unit normal (3), unused
    keys: Longs  # (ENTRIES nq,) cell of each entry
    order: Integers  # (ENTRIES nq,) quad of each entry, sorted by bucket
    starts: Integers  # (buckets + 1,) first of each bucket in `order`; buckets is a power of two
    pair_nodes: Integers  # (capacity,) surface node of a pair, ascending
    pair_quads: Integers  # (capacity,)
    feet: Singles  # (capacity, 2) u, v of the last closest point, where the next search for it starts
    counts: Longs  # (4,) PAIRS, NEEDED, ACTIVE, SEARCHES
    load: Singles  # (ns,) scratch: how much contact each node takes part in
    hits: Integers  # (ns, 2) scratch: surface node and quad of the active contacts
    hit_values: Singles  # (ns, 10) scratch: weights (4), direction (3), gap, lacking, onset


def make_contact(
    surface_nodes: ArrayLike,
    quads: ArrayLike,
    rest: ArrayLike,
    clearance: float,
    te: float,
    *,
    margin: float = 0.3,
    recovery: float = 0.01,
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
        margin=single(margin * h),
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
        feet=np.zeros((pairs, 2), single),
        counts=np.zeros(4, np.int64),
        load=np.zeros(ns, single),
        hits=np.zeros((ns, 2), integer),
        hit_values=np.zeros((ns, 10), single),
    )


def grow(contact: Contact, needed: int) -> Contact:
    """The same contact with room for at least `needed` pairs; search again before the next push."""
    room = max(2 * needed, len(contact.pair_nodes))
    contact.searched[:] = 1e30
    contact.counts[:3] = 0
    return contact._replace(
        pair_nodes=np.zeros(room, np.int32), pair_quads=np.zeros(room, np.int32), feet=np.zeros((room, 2), np.float32)
    )
