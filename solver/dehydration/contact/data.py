"""Everything self-contact keeps between steps, allocated once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Bools, Ints, Ints32, Singles
from ...geometry.crossings import split_quads
from .features import features, neighbours

Single = np.float32
Long = np.int64

OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "nsz", "arcp", "contract"}}
INLINE: dict[str, Any] = OPTIONS | {"forceinline": True}
"""For what is done pair by pair: a call hands over arrays whole and counts their references, more work than a pair."""

PAIRS, NEEDED, ACTIVE, SEARCHES, HITS, LIVE, READS, HELD = 0, 1, 2, 3, 4, 5, 6, 7
"""Entries of `Contact.counts`; LIVE: pairs near enough to be looked at in this step, READS: nodes that they need, HELD:
whether ways may have been cut short, of nodes that no pair pushed, too."""
ENTRIES = 16
"""Room for cell entries per triangle; one grown by half the reach overlaps about 6 cells."""
BATCH, MEETINGS, PARTS = 1024, 16, 16
"""Pairs of triangles whose nodes are entered before their edges; room for pairs that a search meets, per triangle (a
skin meets 8 of each); and parts of the cells that are gone through side by side."""
SHARES = 16
"""Shares of the nodes that a step looks at side by side."""
AT_ONCE = 16
"""Entries of a cell that the search holds against another one at once."""
BINS = 16
"""Classes of distance that pairs are sorted into at a search, so that a step looks at the near ones alone."""


class Contact(NamedTuple):
    """Everything the search and the push need, allocated once; a named tuple because numba reads those natively.

    ns surface nodes, nt triangles, nn nodes of the volume mesh. Lengths in units of the fruit, speeds per step.
    A pair is a node and a triangle, or two edges; its four nodes are (node, corners) or (ends, ends).
    """

    surface_nodes: Ints32  # (ns,) rows of the state
    triangles: Ints32  # (nt, 3) surface numbering, counter-clockwise from outside
    own_nodes: Ints32  # (nt, 3) corners that this triangle answers for, each node once; -1: another one does
    own_edges: Ints32  # (nt, 3, 2) ends of the edges that it answers for, each edge once; -1: another one does
    source: Ints32  # (ns,) node that this one is a mirror image of; itself where it is none
    around: Ints32  # (na, 7) pairs of triangles around a node, and two features of theirs: four nodes, kind
    bending: Ints32  # (nb,) triangles that are in `around`; the others can do nothing to one that shares a node
    least: Singles  # (nt,) distance of those to the nearest around it, of the features named above, at `looked`
    looked: Singles  # (ns, 3) positions when `least` was measured
    bent: Singles  # (nt, 2) how far corners have come against each other since, its own and those of any around it
    sure: Bools  # (nt,) whether nothing around it can have come into reach
    doubts: Ints  # (2,) triangles that are not sure, now and when `least` was measured
    rest: Singles  # (ns, 3) positions in the fresh fruit
    ellipsoid: Singles  # (2, 3) centre of the rest bounding box and its squared inverse half widths
    clearance: np.float32  # gap that contact keeps
    margin: np.float32  # how far beyond the clearance candidates are collected
    size: np.float32  # mean rest edge length h
    searched: Singles  # (ns, 3) positions of the last search
    before: Singles  # (ns, 3) positions at the beginning of the step
    boxes: Singles  # (nt, 6) least and largest coordinates at the last search
    keys: Ints  # (ENTRIES nt,) cell of each entry
    order: Ints32  # (ENTRIES nt,) triangle of each entry, sorted by bucket
    entered: Ints32  # (nt,) scratch: triangles that have entries
    starts: Ints32  # (buckets + 1,) first of each bucket in `order`; buckets is a power of two
    sides: Singles  # (6, ENTRIES nt + AT_ONCE) both corners of the box of each entry, see `cells.spread`
    marks: Ints32  # (3, ENTRIES nt + AT_ONCE) its cell, and in which directions that is the triangle's first
    met: Ints32  # (a multiple of BATCH, 2) pairs of triangles that the search has met and not yet looked at
    met_by_part: Ints  # (PARTS,) how many each part of the cells has
    near: Ints32  # (as many,) bits of their features that are in reach
    found: Ints32  # (capacity, 5) as the search meets them: four nodes, kind
    away: Singles  # (capacity, 2) their distance and clearance
    pairs: Ints32  # (capacity, 5) the same in classes of distance: four nodes, kind (0: node and triangle)
    limits: Singles  # (capacity,) clearance of each of `pairs`
    apart: Singles  # (capacity,) distance of each of `pairs` at the last search
    bins: Ints  # (BINS + 1,) first of each class in `pairs`
    load: Singles  # (ns,) scratch: how much contact each node takes part in
    room: Singles  # (ns,) scratch: how far each node is from what it might touch, the clearance at most
    values: Singles  # (capacity, 8) of each live pair: shares of the nodes (4), direction (3), distance
    weights: Singles  # (capacity,) how much it counts
    hits: Ints32  # (capacity,) live pairs that count
    hit_values: Singles  # (capacity, 2) stiffness and impulse
    moved: Singles  # (2,) farthest that a node has moved since the last search, and the square of the fastest speed
    extremes: Singles  # (SHARES, 2) the squares of both, of each share of the nodes
    reads: Ints32  # (ns,) nodes that a step looks at: own ones and those in pairs
    counts: Ints  # (8,) PAIRS, NEEDED, ACTIVE, SEARCHES, HITS, LIVE, READS, HELD


def make_contact(
    surface_nodes: ArrayLike,
    quads: ArrayLike,
    rest: ArrayLike,
    clearance: float,
    *,
    margin: float = 0.3,
    capacity: int = 0,
    source: ArrayLike | None = None,
) -> Contact:
    """Allocate a contact for the skin with rest positions `rest` (nn, >= 3).

    quads: (nq, 4) in surface numbering, counter-clockwise from outside; each is the two triangles of `split_quads`.
    margin (mean rest edges h) rarely needs changing. Capacity is in pairs, 16 per node unless given. source: (ns,) see
    `Contact`; a pair of images alone is left to the pair that it is an image of.
    """
    nodes = np.ascontiguousarray(surface_nodes, np.int32)
    faces = np.ascontiguousarray(quads, np.int32)
    positions = np.asarray(rest, np.float64)[nodes, :3]
    h = float(np.linalg.norm(positions[np.roll(faces, -1, axis=1)] - positions[faces], axis=2).mean())
    low, high = positions.min(0), positions.max(0)
    half = np.maximum((high - low) / 2, h)
    triangles = np.ascontiguousarray(split_quads(faces), np.int32)
    own_nodes, own_edges = features(triangles, len(nodes))
    ns, nt = len(nodes), len(triangles)
    pairs, meetings = capacity or 16 * ns, -(-MEETINGS * nt // BATCH) * BATCH
    single, integer = np.float32, np.int32
    origin = np.arange(ns, dtype=integer) if source is None else np.ascontiguousarray(source, integer)
    return Contact(
        surface_nodes=nodes,
        triangles=triangles,
        own_nodes=own_nodes,
        own_edges=own_edges,
        source=origin,
        rest=positions.astype(single),
        ellipsoid=np.stack([(low + high) / 2, half**-2.0]).astype(single),
        clearance=single(clearance),
        margin=single(margin * h),
        size=single(h),
        searched=np.full((ns, 3), 1e15, single),
        before=np.zeros((ns, 3), single),
        met=np.zeros((meetings, 2), integer),
        met_by_part=np.zeros(PARTS, np.int64),
        near=np.zeros(meetings, integer),
        bins=np.zeros(BINS + 1, np.int64),
        load=np.zeros(ns, single),
        room=np.zeros(ns, single),
        moved=np.zeros(2, single),
        extremes=np.zeros((SHARES, 2), single),
        reads=np.zeros(ns, integer),
        counts=np.zeros(8, np.int64),
        **_cells(nt),
        **_trusted(triangles, own_nodes, own_edges, origin),
        **_room(pairs),
    )


def _cells(nt: int) -> dict[str, Any]:
    """The arrays that sort triangles into cells."""
    integer = np.int32
    return {
        "boxes": np.zeros((nt, 6), np.float32),
        "sides": np.zeros((6, ENTRIES * nt + AT_ONCE), np.float32),
        "marks": np.zeros((3, ENTRIES * nt + AT_ONCE), integer),
        "keys": np.zeros(ENTRIES * nt, np.int64),
        "order": np.zeros(ENTRIES * nt, integer),
        "entered": np.zeros(nt, integer),
        "starts": np.zeros((1 << int(2 * nt - 1).bit_length()) + 1, integer),
    }


def _trusted(triangles: Ints32, own_nodes: Ints32, own_edges: Ints32, source: Ints32) -> dict[str, Any]:
    """The arrays that say which neighbours need no look."""
    nt = len(triangles)
    around = neighbours(triangles, own_nodes, own_edges, source)
    return {
        "around": around,
        "bending": np.unique(around[:, :2]).astype(np.int32),
        "least": np.zeros(nt, np.float32),
        "looked": np.full((len(source), 3), 1e15, np.float32),
        "bent": np.zeros((nt, 2), np.float32),
        "sure": np.ones(nt, np.bool_),
        "doubts": np.zeros(2, np.int64),
    }


def _room(pairs: int) -> dict[str, Any]:
    """The arrays that hold one entry per pair."""
    single, integer = np.float32, np.int32
    return {
        "found": np.zeros((pairs, 5), integer),
        "away": np.zeros((pairs, 2), single),
        "pairs": np.zeros((pairs, 5), integer),
        "values": np.zeros((pairs, 8), single),
        "limits": np.zeros(pairs, single),
        "apart": np.zeros(pairs, single),
        "weights": np.zeros(pairs, single),
        "hits": np.zeros(pairs, integer),
        "hit_values": np.zeros((pairs, 2), single),
    }


def grow(contact: Contact, needed: int) -> Contact:
    """The same contact with room for at least `needed` pairs; search again before the next push."""
    contact.searched[:] = 1e15
    contact.counts[:3] = 0
    return contact._replace(**_room(max(2 * needed, len(contact.pairs))))
