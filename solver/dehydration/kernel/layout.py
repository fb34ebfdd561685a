"""The kernel's data: everything that depends on the fresh mesh, in the order and alignment the sweep reads it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import get_num_threads
from numpy.typing import ArrayLike, DTypeLike

from solver.dehydration.kernel.algebra import CORE_PLANES, EXOCARP_PLANES, ONE_POINT_PLANES
from solver.dehydration.kernel.bounds import element_bounds
from solver.dehydration.kernel.coupled import columns_of, pays, weights
from solver.dehydration.kernel.fixed_point import place
from solver.dehydration.kernel.fixed_point import positions as positions_of
from solver.dehydration.kernel.masses import largest_stiffness
from solver.dehydration.kernel.metric import element_planes, one_point_planes, refuse_inverted
from solver.dehydration.kernel.strips import GROUP, LANES, Strips, assembly_rows, build_strips, group_order

from ...arrays import Array, Bools, Floats, Ints, Ints32, Singles

ALIGNMENT = 64
ROW = 3
"""Floats per force row: one corner of one lane's face."""
ALL = 1 << 30
"""More levels than any mesh has."""


def aligned_zeros(shape: tuple[int, ...], dtype: DTypeLike) -> Array:
    """C-contiguous zeros that start on a cache line."""
    item = np.dtype(dtype)
    size = int(np.prod(shape)) * item.itemsize
    raw = np.zeros(size + ALIGNMENT, dtype=np.uint8)
    start = -raw.ctypes.data % ALIGNMENT
    return raw[start : start + size].view(item).reshape(shape)


def aligned_copy(values: Array, dtype: DTypeLike) -> Array:
    """C-contiguous copy that starts on a cache line."""
    result = aligned_zeros(values.shape, dtype)
    result[...] = values
    return result


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """A mesh, ready to march. Arrays are read-only by convention and shared freely between threads.

    Node numbers are the caller's own. Lengths and moduli keep the caller's units; mass is scaled so that time is in
    critical steps.
    """

    nodes: int
    elements: int
    strips: Ints
    """(strips, 5): see `strips.Strips.table`"""
    face_offsets: Ints32
    """(faces, 4, 16): 4 * node of each corner and lane, the node's place in the flat (nn, 4) state"""
    core_planes: Singles
    """(core blocks, CORE_PLANES, 16): see `algebra` for the planes"""
    one_point_planes: Singles
    """(core blocks, ONE_POINT_PLANES, 16); no blocks if built without"""
    exocarp_planes: Singles
    """(exocarp blocks, EXOCARP_PLANES, 16)"""
    row_start: Ints32
    """(nodes + 1,): first entry of each node in ``rows``"""
    rows: Ints32
    """place of each contribution in the flat force rows, in the fixed order of summation"""
    groups: Ints32
    """(groups,): order in which groups of nodes are moved (see `strips.group_order`)"""
    inverse_mass: Singles
    """(nodes,): diagonal of the inverse of the scaled masses, 0 where fixed"""
    core_elements: Ints
    """(core blocks, 16): element of each lane; -1 where a lane only fills the vector"""
    exocarp_elements: Ints
    """(exocarp blocks, 16): likewise"""
    connectivity: Ints
    """(elements, 8)"""
    fresh: Ints32
    """(nodes, 4): fresh positions as the kernel's state (see `fixed_point`); the fourth column is unused and 0"""
    mass: Floats
    """(nodes,): diagonal of the scaled masses, of fixed nodes too"""
    pull: Floats
    """(nodes,): what stands beside the diagonal, between a node and the next; empty where nodes share no masses"""
    tops: Ints32
    """outer nodes of the columns of a skin that share their masses (see `coupled`), in the order of `groups`"""
    spread: Singles
    """(tops, 6): rows of A without its diagonal, of a column's nodes from the inside out (see `coupled`)"""
    full_levels: int
    """outermost core levels that are integrated fully even where the one-point core is asked for"""
    planes: Ints32
    """places in the flat (nn, 4) state of coordinates that stay 0: nodes on mirror planes"""

    @property
    def force_rows(self) -> int:
        """Floats of the force buffer; a row is read as four floats, so the last one needs one to spare."""
        return self.face_offsets.size * ROW + 1

    @property
    def free(self) -> Bools:
        """(nodes,) bool: nodes that move."""
        return self.inverse_mass > 0

    def nbytes(self) -> int:
        """Memory held, in bytes."""
        values = (getattr(self, name) for name in self.__slots__)
        return sum(value.nbytes for value in values if isinstance(value, np.ndarray))

    def lanes(self, core: Array, exocarp: Array) -> Array:
        """Per-lane values of core (core blocks, 16) and exocarp blocks -> one value per element, (elements,)."""
        result = np.empty(self.elements, dtype=np.result_type(core, exocarp))
        for elements, values in ((self.core_elements, core), (self.exocarp_elements, exocarp)):
            real = elements >= 0
            result[elements[real]] = values[real]
        return result


def _blocks(elements: Ints, planes_of: Any, planes: int, chunk: int = 256) -> Singles:
    """Planes of whole blocks, (blocks, planes, 16) float32, computed a few thousand elements at a time."""
    result: Singles = aligned_zeros((len(elements), planes, LANES), np.float32)
    for first in range(0, len(elements), chunk):
        part = elements[first : first + chunk]
        result[first : first + chunk] = planes_of(part.ravel()).reshape(planes, -1, LANES).transpose(1, 0, 2)
    return result


def _planes(
    strips: Strips, corners: Floats, shear: Floats, bulk: Floats, one_point: bool
) -> tuple[Singles, Singles, Singles]:
    """Planes of the core, of the one-point core (no blocks without it) and of the exocarp."""

    def full(exocarp: bool) -> Any:
        return lambda e: element_planes(corners[e], shear[e], bulk[e], exocarp)

    single = strips.core if one_point else strips.core[:0]
    return (
        _blocks(strips.core, full(False), CORE_PLANES),
        _blocks(single, lambda e: one_point_planes(corners[e], shear[e], bulk[e]), ONE_POINT_PLANES),
        _blocks(strips.exocarp, full(True), EXOCARP_PLANES),
    )


def _checked(
    positions: ArrayLike,
    connectivity: ArrayLike,
    is_exocarp: ArrayLike,
    mu: ArrayLike,
    kappa: ArrayLike,
    fixed: ArrayLike,
) -> Iterator[Array]:
    """Inputs as arrays of the expected type and shape; ValueError names the first that does not fit."""
    nodes, count = len(np.asarray(positions)), len(np.asarray(connectivity))
    expected: tuple[tuple[str, ArrayLike, DTypeLike, tuple[int, ...]], ...] = (
        ("positions", positions, np.float64, (nodes, 3)),
        ("connectivity", connectivity, np.int64, (count, 8)),
        ("is_exocarp", is_exocarp, np.bool_, (count,)),
        ("mu", mu, np.float64, (count,)),
        ("kappa", kappa, np.float64, (count,)),
        ("fixed", fixed, np.bool_, (nodes,)),
    )
    for name, value, dtype, shape in expected:
        array = np.ascontiguousarray(value, dtype=dtype)
        if array.shape != shape or not array.size:
            raise ValueError(f"{name} must have shape {shape} and not be empty, got {array.shape}")
        if dtype is np.float64 and not np.all(np.isfinite(array)):
            raise ValueError(f"{name} must be finite")
        if name in ("mu", "kappa") and not np.all(array > 0):
            raise ValueError(f"{name} must be positive")
        if name == "connectivity" and (array.min() < 0 or array.max() >= nodes):
            raise ValueError(f"connectivity must name nodes 0 to {nodes - 1}")
        yield array


def build_layout(
    positions: ArrayLike,
    connectivity: ArrayLike,
    is_exocarp: ArrayLike,
    mu: ArrayLike,
    kappa: ArrayLike,
    fixed: ArrayLike,
    *,
    safety: float = 1.5,
    one_point: bool = True,
    full_levels: int = 0,
    mirrored: ArrayLike = (),
) -> Layout:
    """Prepare a mesh for `march`.

    positions: (nn, 3) fresh positions, within +-3.9. connectivity: (ne, 8), local bits xi = 4, eta = 2, zeta = 1 with
    zeta radial, right-handed. is_exocarp: (ne,). mu, kappa: (ne,) shear and bulk modulus, one unit of stress for both.
    fixed: (nn,) nodes that never move (the stone). safety: factor on the scaled masses against stiffening while the
    fruit deforms; the critical time step is at least sqrt(safety) at rest and a unit step is marched. Swelling to
    theta > 1 stiffens by theta: multiply safety by it. one_point: prepare the one-point core element as well.
    full_levels: see `Layout`. mirrored: numbers 3 node + axis of coordinates that stay 0. A thin skin of two layers
    whose columns are three nodes in a row shares its masses, see `coupled`.

    Raises ValueError with what to change for inputs that are not a mesh.
    """
    corners_at, connect, skin, shear, bulk, held = _checked(positions, connectivity, is_exocarp, mu, kappa, fixed)
    nodes, strips = len(corners_at), build_strips(connect, skin)
    if strips.faces.size * ROW >= 2**31 or nodes * 4 >= 2**31:
        raise ValueError(f"{len(connect)} elements are too many for 32-bit offsets")

    # Metric and masses are of positions as the kernel holds them, so that the fresh state is free of stress.
    fresh = aligned_zeros((nodes, 4), np.int32)
    place(fresh, corners_at)
    corners = positions_of(fresh)[connect]
    refuse_inverted(corners)
    core_planes, single_planes, exocarp_planes = _planes(strips, corners, shear, bulk, one_point)
    row_start, rows = assembly_rows(strips, nodes)
    bounds, outer = _bounds(fresh, connect, corners, skin, shear, bulk)
    groups = group_order(row_start, rows, strips, get_num_threads())
    tops = _in_turn(outer, groups)
    return Layout(
        nodes=nodes,
        elements=len(connect),
        strips=aligned_copy(strips.table, np.int64),
        face_offsets=aligned_copy(4 * strips.faces, np.int32),
        core_planes=core_planes,
        one_point_planes=single_planes,
        exocarp_planes=exocarp_planes,
        row_start=aligned_copy(row_start, np.int32),
        rows=aligned_copy(ROW * rows, np.int32),
        groups=aligned_copy(groups, np.int32),
        tops=tops,
        core_elements=np.where(strips.core_real, strips.core, -1),
        exocarp_elements=np.where(strips.exocarp_real, strips.exocarp, -1),
        connectivity=connect,
        fresh=fresh,
        **weights(connect, skin, held, tops, bounds, safety)._asdict(),
        full_levels=full_levels,
        planes=_places(mirrored),
    )


def _bounds(
    fresh: Ints32, connect: Ints, corners: Floats, skin: Bools, shear: Floats, bulk: Floats
) -> tuple[Floats, Ints]:
    """Upper bounds (3, ne) as of `reweigh.stiffness_bounds`, whichever way the core is integrated, and the outer nodes
    of columns that share their masses.
    """
    bounds = np.zeros((3, len(connect)))
    for exocarp in (False, True):
        chosen = skin == exocarp
        bounds[0, chosen] = largest_stiffness(corners[chosen], shear[chosen], bulk[chosen], exocarp)
    tops = columns_of(connect, skin)
    if len(tops):
        bounds[1:] = element_bounds(fresh, connect, skin, shear, bulk, -np.inf, split=True)[1:]
    return bounds, tops if len(tops) and pays(bounds, skin) else tops[:0]


def _in_turn(tops: Ints, groups: Ints) -> Ints32:
    """The outer nodes of columns, sorted by when their groups are moved: by the thread that has pushed them, mostly."""
    turn = np.empty(len(groups), np.int64)
    turn[groups] = np.arange(len(groups)) * get_num_threads() // max(len(groups), 1)
    return tops[np.argsort(turn[tops // GROUP], kind="stable")].astype(np.int32)


def _places(mirrored: ArrayLike) -> Ints32:
    """Places in a state of four numbers per node of coordinates 3 node + axis."""
    chosen = np.asarray(mirrored, np.int64)
    return (chosen // 3 * 4 + chosen % 3).astype(np.int32)
