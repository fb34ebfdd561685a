"""Order in which the kernel visits elements: strips of 16 radial stacks.

A *stack* is a run of elements in which the top face (zeta = +1) of one is the bottom face of the next, with the same
order of nodes; core elements first, then exocarp. A *strip* is 16 stacks of equal make-up, one per vector lane. The
kernel walks a strip upwards and keeps the shared face in registers: each face's positions are gathered once and its
forces written once, half of what element by element would move. Meshes without such runs still work: every element
is then a stack of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Bools, Ints

LANES = 16
GROUP = 4
"""Nodes that the march moves at a time, and the force rows that each of them has where they are moved at once."""
BOTTOM, TOP = [0, 2, 4, 6], [1, 3, 5, 7]
"""Local nodes of the faces zeta = -1 and zeta = +1; corner c of a face is local node 2c or 2c + 1."""


class Strips(NamedTuple):
    """All strips of a mesh; core and exocarp blocks are numbered apart, in the order in which they are visited."""

    table: Ints
    """(strips, 5) int64: first face, first core block, core blocks, first exocarp block, exocarp blocks"""
    faces: Ints
    """(faces, 4, LANES) int64: node at each corner of each lane's face; a strip owns blocks + 1 consecutive faces"""
    real: Bools
    """(faces, LANES) bool: False where a lane repeats the strip's last stack only to fill the vector"""
    core: Ints
    """(core blocks, LANES) int64: element of each lane"""
    exocarp: Ints
    """(exocarp blocks, LANES) int64: element of each lane"""
    core_real: Bools
    exocarp_real: Bools


def _successors(connectivity: Ints, is_exocarp: Bools) -> Ints:
    """Element above each element, or -1; one-to-one, and never from exocarp back to core."""
    nodes = int(connectivity.max()) + 1
    bottom, top = connectivity[:, BOTTOM], connectivity[:, TOP]
    bottom_key, top_key = (face[:, 0] * nodes + face[:, 3] for face in (bottom, top))
    keys, owner, counts = np.unique(bottom_key, return_index=True, return_counts=True)
    place = np.minimum(np.searchsorted(keys, top_key), len(keys) - 1)
    above = owner[place]
    _, inverse, top_counts = np.unique(top_key, return_inverse=True, return_counts=True)
    linked = (keys[place] == top_key) & (counts[place] == 1) & (top_counts[inverse] == 1)
    linked &= np.all(bottom[above] == top, axis=1) & ~(is_exocarp & ~is_exocarp[above])
    return np.where(linked, above, -1)


def find_stacks(connectivity: Ints, is_exocarp: Bools) -> list[Ints]:
    """Stacks grouped by make-up: each entry is (stacks, height) int64 of elements from bottom to top."""
    above = _successors(connectivity, is_exocarp)
    has_below = np.zeros(len(above), dtype=np.bool_)
    has_below[above[above >= 0]] = True
    columns = [np.flatnonzero(~has_below)]
    visited = np.zeros(len(above), dtype=np.bool_)
    while np.any(columns[-1] >= 0):
        current = columns[-1]
        visited[current[current >= 0]] = True
        columns.append(np.where(current >= 0, above[current], -1))
    table = np.stack(columns[:-1], axis=1) if len(columns) > 1 else np.empty((0, 1), dtype=np.int64)
    filled = table >= 0
    heights = filled.sum(axis=1)
    cores = (filled & ~is_exocarp[table]).sum(axis=1)
    kinds, kind = np.unique(np.stack([heights, cores], axis=1), axis=0, return_inverse=True)
    groups = [table[kind.ravel() == k, : int(height)] for k, (height, _) in enumerate(kinds)]
    # Elements on a closed ring have no lowest one; they stand alone.
    ring = np.flatnonzero(~visited)
    groups += [part[:, None] for part in (ring[~is_exocarp[ring]], ring[is_exocarp[ring]]) if len(part)]
    return groups


def build_strips(connectivity: Ints, is_exocarp: Bools) -> Strips:
    """Strips of a mesh; connectivity (ne, 8) int64 with local bits xi = 4, eta = 2, zeta = 1."""
    rows: list[tuple[int, int, int, int, int]] = []
    faces: list[Ints] = []
    real: list[Bools] = []
    blocks: dict[bool, list[Ints]] = {False: [], True: []}
    block_real: dict[bool, list[Bools]] = {False: [], True: []}
    for group in find_stacks(connectivity, is_exocarp):
        padding = (-len(group)) % LANES
        padded = np.concatenate([group, np.repeat(group[-1:], padding, axis=0)])
        lanes = (np.arange(len(padded)) < len(group)).reshape(-1, LANES)
        stacks = padded.reshape(-1, LANES, group.shape[1]).transpose(0, 2, 1)
        skin = is_exocarp[group[0]]
        height, cores = len(skin), int(np.sum(~skin))
        for stack, lane in zip(stacks, lanes, strict=True):
            rows.append((len(faces), len(blocks[False]), cores, len(blocks[True]), height - cores))
            faces.append(connectivity[stack[0]][:, BOTTOM].T)
            faces += [connectivity[block][:, TOP].T for block in stack]
            real += [lane] * (height + 1)
            for block, exocarp in zip(stack, skin, strict=True):
                blocks[bool(exocarp)].append(block)
                block_real[bool(exocarp)].append(lane)

    def stacked(parts: list[Ints]) -> Ints:
        return np.stack(parts) if parts else np.empty((0, LANES), dtype=np.int64)

    def masks(parts: list[Bools]) -> Bools:
        return np.stack(parts) if parts else np.empty((0, LANES), dtype=np.bool_)

    return Strips(
        np.array(rows, dtype=np.int64),
        np.stack(faces),
        masks(real),
        stacked(blocks[False]),
        stacked(blocks[True]),
        masks(block_real[False]),
        masks(block_real[True]),
    )


def group_order(row_start: Ints, rows: Ints, strips: Strips, parts: int) -> Ints:
    """Order in which groups of nodes are moved: those that the first part of the strips pushes first, and so on.

    Threads take strips and groups by even shares: so each reads what it has written itself, and fetches little from
    another's cache. By number alone, half of the rows of a whole fruit are another thread's. Within a part the order is
    that of the numbers, which a processor foresees.
    """
    nodes, counts = len(row_start) - 1, np.diff(row_start)
    strip = np.searchsorted(strips.table[:, 0], rows // (4 * LANES), side="right") - 1
    group = np.repeat(np.arange(nodes) // GROUP, counts)
    groups = -(-nodes // GROUP)
    middle = np.bincount(group, strip, groups) / np.maximum(np.bincount(group, minlength=groups), 1)
    share = np.empty(groups, np.int64)
    share[np.argsort(middle, kind="stable")] = np.arange(groups) * parts // groups
    return np.argsort(share, kind="stable")


def assembly_rows(strips: Strips, nodes: int) -> tuple[Ints, Ints]:
    """Node -> force rows, compressed: row_start (nodes + 1,) and rows, row = (face * 4 + corner) * LANES + lane.

    Rows ascend within a node, so that the order of summation is fixed; lanes that only fill a vector are left out.
    """
    used = np.broadcast_to(strips.real[:, None, :], strips.faces.shape).ravel()
    rows = np.flatnonzero(used)
    owner = strips.faces.ravel()[rows]
    order = np.argsort(owner, kind="stable")
    counts = np.bincount(owner, minlength=nodes)
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(counts)]), rows[order]
