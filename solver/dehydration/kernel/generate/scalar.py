"""Back end B: the same two functions as `vector_ir`, in plain numba on generated source text."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from solver.dehydration.kernel.coupled import mix
from solver.dehydration.kernel.fixed_point import QUANTUM
from solver.dehydration.kernel.generate.source import load_generated
from solver.dehydration.kernel.strips import GROUP, LANES

from ....arrays import Ints, Ints32, Singles

_generated = load_generated()
core_block = _generated.core_block
exocarp_block = _generated.exocarp_block
one_point_block = _generated.one_point_block

# A call that is not inlined counts references of its arrays, atomically: more work than one node's update.
OPTIONS: Any = {
    "error_model": "numpy",
    "fastmath": {"reassoc", "nsz", "arcp", "contract", "afn"},
    "boundscheck": False,
    "forceinline": True,
}
# Unsigned offsets spare numba's handling of negative indices, which would keep loops from being vectorised.
ONE, TWO = np.uint32(1), np.uint32(2)
UNIT, QUANTA = np.float32(QUANTUM), np.float32(1 / QUANTUM)
VECTORS = 3 * LANES
"""Floats of one node's three components over the lanes."""


@njit(**OPTIONS)
def _gather_face(state: Ints32, offsets: Ints32, face: int, side: int, quanta: Ints32) -> None:
    """Fixed-point positions of a face into the scratch of its side: 0 below, 1 above."""
    for corner in range(4):
        first = (2 * corner + side) * VECTORS
        for lane in range(LANES):
            place = np.uint32(offsets[np.uint64(face), corner, lane])
            quanta[first + lane] = state[place]
            quanta[first + LANES + lane] = state[place + ONE]
            quanta[first + 2 * LANES + lane] = state[place + TWO]


@njit(**OPTIONS)
def _from_first_node(quanta: Ints32, positions: Singles) -> None:
    """Positions relative to node 0, in units of length: only differences enter, and in integers they are exact."""
    for node in range(8):
        for k in range(VECTORS):
            positions[node * VECTORS + k] = np.float32(quanta[node * VECTORS + k] - quanta[k]) * UNIT


@njit(**OPTIONS)
def _store_rows(carried: Singles, face: int, forces: Singles) -> None:
    """Write the rows of a face: 16 lanes of three floats per corner."""
    for corner in range(4):
        first = corner * VECTORS
        row = np.uint64(3 * (face * 4 + corner) * LANES)
        rows = forces[row : row + np.uint64(VECTORS)]
        for lane in range(LANES):
            rows[3 * lane] = carried[first + lane]
            rows[3 * lane + 1] = carried[first + LANES + lane]
            rows[3 * lane + 2] = carried[first + 2 * LANES + lane]


@njit(**OPTIONS)
def _add_squares(nodal: Singles, face: int, squares: Singles) -> None:
    """Add the squared nodal forces of an element to the rows of its two faces."""
    for corner in range(4):
        for side in range(2):
            row = ((face + side) * 4 + corner) * LANES
            first = (2 * corner + side) * VECTORS
            for k in range(VECTORS):
                squares[row + k % LANES] += nodal[first + k] ** 2


@njit(**OPTIONS)
def _carry_up(quanta: Ints32, nodal: Singles, carried: Singles) -> None:
    """Make the face above the face below; its forces so far are those of the element just done."""
    for corner in range(4):
        low, high, first = 2 * corner * VECTORS, (2 * corner + 1) * VECTORS, corner * VECTORS
        for k in range(VECTORS):
            carried[first + k] = nodal[high + k]
            quanta[low + k] = quanta[high + k]


@njit(**OPTIONS)
def strip_forces(
    state: Ints32,
    offsets: Ints32,
    strips: Ints,
    strip: int,
    core: Singles,
    one_point: Singles,
    exocarp: Singles,
    full: int,
    theta: float,
    forces: Singles,
    record: bool,
    squares: Singles,
) -> None:
    """Element forces of one strip; arguments as in `vector_ir.strip_forces`."""
    face, first_core, cores, first_exocarp, exocarps = strips[strip]
    core_flat = core.reshape(core.shape[0], core.shape[1] * LANES)
    one_point_flat = one_point.reshape(one_point.shape[0], one_point.shape[1] * LANES)
    exocarp_flat = exocarp.reshape(exocarp.shape[0], exocarp.shape[1] * LANES)
    quanta = np.empty(8 * VECTORS, np.int32)
    positions = np.empty(8 * VECTORS, np.float32)
    nodal = np.empty(8 * VECTORS, np.float32)
    carried = np.zeros(4 * VECTORS, np.float32)
    _gather_face(state, offsets, face, 0, quanta)
    for level in range(cores + exocarps):
        _gather_face(state, offsets, face + 1, 1, quanta)
        _from_first_node(quanta, positions)
        if level >= cores:
            exocarp_block(positions, exocarp_flat, np.uint64(first_exocarp + level - cores), np.float32(1), nodal)
        elif level < cores - full:
            one_point_block(positions, one_point_flat, np.uint64(first_core + level), theta, nodal)
        else:
            core_block(positions, core_flat, np.uint64(first_core + level), theta, nodal)
        if record:
            _add_squares(nodal, face, squares)
        for corner in range(4):
            for k in range(VECTORS):
                carried[corner * VECTORS + k] += nodal[2 * corner * VECTORS + k]
        _store_rows(carried, face, forces)
        _carry_up(quanta, nodal, carried)
        face += 1
    _store_rows(carried, face, forces)


# Inlined by numba, not by LLVM, whose inlining leaves the reference counts of a branch behind.
# Without "reassoc": nodes sum about four rows, too few for the gathers LLVM would vectorise the sum with.
@njit(inline="always")
def update_node(
    forces: Singles,
    row_start: Ints32,
    rows: Ints32,
    inverse_mass: Singles,
    state: Ints32,
    velocity: Singles,
    keep: float,
    push: float,
    node: int,
) -> None:
    """Central-difference update of one node; arguments as in `node_ir.update_nodes`."""
    x = y = z = np.float32(0)
    for entry in range(np.uint32(row_start[np.uint64(node)]), np.uint32(row_start[np.uint64(node + 1)])):
        row = np.uint32(rows[entry])
        x += forces[row]
        y += forces[row + ONE]
        z += forces[row + TWO]
    weight = push * inverse_mass[np.uint64(node)]
    first = np.uint32(4 * node)
    held = keep if weight > 0 else np.float32(0)
    x = held * velocity[first] - weight * x
    y = held * velocity[first + ONE] - weight * y
    z = held * velocity[first + TWO] - weight * z
    velocity[first], velocity[first + ONE], velocity[first + TWO] = x, y, z
    state[first] += np.int32(np.rint(x * QUANTA))
    state[first + ONE] += np.int32(np.rint(y * QUANTA))
    state[first + TWO] += np.int32(np.rint(z * QUANTA))


@njit(inline="always")
def update_nodes(
    forces: Singles,
    row_start: Ints32,
    rows: Ints32,
    inverse_mass: Singles,
    state: Ints32,
    velocity: Singles,
    keep: float,
    push: float,
    group: int,
) -> None:
    """Update of a group of nodes; arguments as in `node_ir.update_nodes`."""
    for node in range(GROUP * group, min(GROUP * group + GROUP, inverse_mass.size)):
        update_node(forces, row_start, rows, inverse_mass, state, velocity, keep, push, node)


@njit(inline="always")
def mix_alike(forces: Singles, row_start: Ints32, rows: Ints32, tops: Ints32, spread: Singles, place: int) -> None:
    """As `node_ir.mix_alike`."""
    mix(forces, row_start, rows, tops, spread, place)
