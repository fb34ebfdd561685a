"""The time loop: damped central differences on scaled masses, and the assembled internal force.

Deterministic: every force row is written by one strip and every node sums its rows in a fixed order, so results do not
depend on the number of threads.
"""

from __future__ import annotations

import functools
import importlib
import logging
import os
from collections.abc import Callable
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numba import get_num_threads, njit, prange, set_num_threads, typeof, types
from numpy.typing import ArrayLike, DTypeLike, NDArray

from solver.dehydration.contact.contact import SLACK, measure, near
from solver.dehydration.contact.data import PAIRS, SHARES, make_contact
from solver.dehydration.contact.search import is_stale
from solver.dehydration.kernel.coupled import are_alike, mix
from solver.dehydration.kernel.fixed_point import place
from solver.dehydration.kernel.generate.digest import source_digest
from solver.dehydration.kernel.layout import ALL, ROW, Layout, aligned_zeros
from solver.dehydration.kernel.skin import Skin, approach, give, keep_apart, search, widen

from ...arrays import Array, Floats, Ints, Singles

State: TypeAlias = NDArray[np.int32]
Backend: TypeAlias = Literal["vector", "scalar"]

logger = logging.getLogger("wizen.dehydration.kernel")

# Set by `compiled` before numba compiles `advance`. They must be globals: numba pickles what a closure captures into
# the key of its cache, and an intrinsic pickles differently in every process.
strip_forces: Any = None
update_nodes: Any = None
mix_alike: Any = None

_FLAT, _INDICES = types.float32[::1], types.int32[::1]
_PLANES = types.float32[:, :, ::1]
SEARCH_EVERY = 10
"""Steps between two searches for contact pairs; a node moves about a hundredth of an element meanwhile."""
SMALL = 4000
"""Elements below which a second thread costs more than it takes over: at 2,430 a run took 1.1 times as long with it."""


def _nobody() -> Skin:
    """A skin of one quad: stands in where no contact is wanted, and gives numba the type."""
    node, below = np.zeros(1, np.float32), np.zeros((1, 2), np.float32)
    contact = make_contact(range(4), [[0, 1, 2, 3]], [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], 0.0)
    image, own = np.ones((1, 3), np.float32), np.ones(1, np.bool_)
    return Skin(contact, np.zeros(1, np.int32), image, own, node, node.reshape(1, 1), node.reshape(1, 1), node, below)


@njit(error_model="numpy")
def stay(planes: State, state: State, velocity: Singles) -> None:
    """Keep the coordinates at the places `planes` of the flat state and velocity at 0."""
    for k in range(planes.size):
        state[planes[k]] = 0
        velocity[planes[k]] = np.float32(0)


_NOBODY = _nobody()
_NOTHING: Singles = np.empty(0, np.float32)
_SIGNATURE = types.int64(
    types.int64,  # steps
    _INDICES,  # state
    _FLAT,  # velocity
    types.int64[:, ::1],  # strips
    types.int32[:, :, ::1],  # face offsets
    _PLANES,  # core
    _PLANES,  # one-point core
    _PLANES,  # exocarp
    types.int64,  # outermost core levels that are integrated fully
    _INDICES,  # row start
    _INDICES,  # rows
    _INDICES,  # groups of nodes in the order in which they are moved
    _INDICES,  # tops of columns that share their masses
    types.float32[:, ::1],  # their shares
    _FLAT,  # inverse mass
    types.float64,  # theta at the start
    types.float64,  # theta at the end
    types.float64,  # damping
    _FLAT,  # force rows
    types.boolean,  # record
    _FLAT,  # squares
    _INDICES,  # coordinates on mirror planes
    types.boolean,  # touching
    typeof(_NOBODY),
)


def _build(stamp: int) -> Callable[..., int]:
    """Compile the time loop, or load it from numba's cache. `stamp` stands for all sources that it is made of."""

    @njit(
        _SIGNATURE,
        parallel=True,
        cache=True,
        error_model="numpy",
        fastmath={"reassoc", "nsz", "arcp", "contract", "afn"},
        boundscheck=False,
    )
    def advance(
        steps: int, state: State, velocity: Singles, strips: Ints, face_offsets: State, core: Singles,
        one_point: Singles, exocarp: Singles, full: int, row_start: State, rows: State, groups: State, tops: State,
        spread: Singles, inverse_mass: Singles, theta0: float, theta1: float, damping: float, forces: Singles,
        record: bool, squares: Singles, planes: State, touching: bool, skin: Skin,
    ) -> int:  # fmt: skip
        source = stamp  # noqa: F841  a captured cell is part of numba's cache key
        keep = np.float32((1 - damping / 2) / (1 + damping / 2))
        push = np.float32(1 / (1 + damping / 2))
        contact = skin.contact
        before, searched, candidates, apart = contact.before, contact.searched, contact.pairs, contact.apart
        limits, values, weights, counts = contact.limits, contact.values, contact.weights, contact.counts
        reads, surface_nodes, extremes = contact.reads, contact.surface_nodes, contact.extremes
        skin_rows, sign, own, position, speed = skin.rows, skin.sign, skin.own, skin.position, skin.velocity
        below = skin.below
        slack, clearance = SLACK * contact.margin, contact.clearance
        for step in range(steps):
            if touching and (step % SEARCH_EVERY == 0 or is_stale(contact)) and not search(skin, state, velocity):
                return step
            theta = np.float32(theta0 + (theta1 - theta0) * (step + 1) / steps)
            for strip in prange(strips.shape[0]):
                strip_forces(
                    state, face_offsets, strips, np.int64(strip), core, one_point, exocarp, full,
                    theta, forces, record, squares,
                )  # fmt: skip
            if not record:
                for column in prange(tops.size):
                    here = np.int64(column)
                    if are_alike(row_start, tops, here):
                        mix_alike(forces, row_start, rows, tops, spread, here)
                    else:
                        mix(forces, row_start, rows, tops, spread, here)
                for turn in prange(groups.size):
                    group = np.int64(groups[turn])
                    update_nodes(forces, row_start, rows, inverse_mass, state, velocity, keep, push, group)
                # a part's nodes on a mirror plane feel half of what balances across it
                stay(planes, state, velocity)
                if touching and counts[PAIRS]:
                    for share in prange(SHARES):
                        approach(
                            skin_rows, sign, position, speed, reads, counts, before, searched, surface_nodes, extremes,
                            state, velocity, np.int64(share),
                        )  # fmt: skip
                    for pair in prange(near(contact, SHARES)):
                        measure(
                            before, searched, candidates, apart, values, weights, limits, slack, clearance,
                            np.int64(pair),
                        )  # fmt: skip
                    if keep_apart(skin, state, velocity):
                        for share in prange(SHARES):
                            give(skin_rows, own, below, speed, reads, counts, state, velocity, np.int64(share))
                    stay(planes, state, velocity)
        return steps

    compiled_loop: Callable[..., int] = advance
    return compiled_loop


@functools.cache
def compiled(backend: Backend) -> Callable[..., int]:
    """The time loop on one back end."""
    global strip_forces, update_nodes, mix_alike
    functions: Any = importlib.import_module(
        "solver.dehydration.kernel.generate." + ("vector_ir" if backend == "vector" else "scalar")
    )
    strip_forces, update_nodes, mix_alike = functions.strip_forces, functions.update_nodes, functions.mix_alike
    return _build(int(source_digest(backend)[:15], 16))


@functools.cache
def default_backend() -> Backend:
    """The back end that `march` uses: WIZEN_KERNEL if it says vector or scalar, else vector if that builds here."""
    chosen = os.environ.get("WIZEN_KERNEL", "auto")
    if chosen == "vector":
        return "vector"
    if chosen == "scalar":
        return "scalar"
    if chosen != "auto":
        raise ValueError(f"WIZEN_KERNEL must be auto, vector or scalar, not {chosen!r}")
    try:
        compiled("vector")
    except Exception as error:  # numba and llvmlite raise many kinds; any of them means "not on this machine"
        logger.warning("the vector kernel does not build here, using the scalar one: %s", error)
        return "scalar"
    return "vector"


def new_state(layout: Layout, where: ArrayLike | None = None) -> tuple[State, Singles]:
    """State and velocity at rest, both (nodes, 4), at positions `where` (nodes, 3) or at the fresh ones.

    The state is fixed point (see `fixed_point`), the velocity float32 in units of length per step.
    """
    state: State = aligned_zeros((layout.nodes, 4), np.int32)
    state[...] = layout.fresh
    if where is not None:
        place(state, where)
    return state, aligned_zeros((layout.nodes, 4), np.float32)


def _flat(name: str, values: Array, dtype: DTypeLike, layout: Layout) -> Array:
    if values.shape != (layout.nodes, 4) or values.dtype != dtype or not values.flags.c_contiguous:
        raise ValueError(f"{name} must be C-contiguous {np.dtype(dtype)} of shape {(layout.nodes, 4)}")
    return values.reshape(-1)


def _arrays(layout: Layout, one_point: bool) -> tuple[Any, ...]:
    if one_point and len(layout.one_point_planes) != len(layout.core_planes):
        raise ValueError("this layout was built without the one-point core; build it with one_point=True")
    return (
        layout.strips, layout.face_offsets, layout.core_planes, layout.one_point_planes, layout.exocarp_planes,
        layout.full_levels if one_point else ALL, layout.row_start, layout.rows,
        layout.groups, layout.tops, layout.spread, layout.inverse_mass,
    )  # fmt: skip


def march(
    layout: Layout,
    state: State,
    velocity: Singles,
    steps: int,
    *,
    theta: tuple[float, float],
    damping: float,
    one_point: bool = False,
    skin: Skin | None = None,
    backend: Backend | None = None,
) -> Skin | None:
    """Advance `state` and `velocity` in place by `steps` critical time steps.

    state: (nodes, 4) int32 positions. velocity: (nodes, 4) float32, displacement per step. theta: shrinkage of the
    core at the start and the end, linear between; the last step sees the end value. damping: per step (alpha of
    m a + alpha m v = -f), 0 for none. one_point: use the one-point core element below the layout's
    `full_levels`. skin: self-contact, or None.
    Returns the skin to use in the next call (it grows when more pairs touch than it has room for).
    A run that blows up leaves positions out of reach and raises nothing: the caller looks.
    """
    if steps < 0:
        raise ValueError("steps must not be negative")
    forces = aligned_zeros((layout.force_rows,), np.float32)
    run = compiled(backend or default_backend())
    begin, end = theta
    left = steps
    threads = get_num_threads()
    set_num_threads(threads if layout.elements >= SMALL else 1)
    try:
        while left:
            made = run(
                left, _flat("state", state, np.int32, layout), _flat("velocity", velocity, np.float32, layout),
                *_arrays(layout, one_point), begin, end, damping, forces, False, _NOTHING, layout.planes,
                skin is not None, skin or _NOBODY,
            )  # fmt: skip
            begin += (end - begin) * made / left
            left -= made
            if left and skin is not None:
                skin = widen(skin)
    finally:
        set_num_threads(threads)
    return skin


class InternalForce(NamedTuple):
    """Assembled internal force, the derivative of the strain energy by the positions."""

    nodal: Floats
    """(nodes, 3), of fixed nodes too (their reaction)"""
    norm: float
    """Euclidean norm over the free nodes"""
    scale: float
    """root of the sum, over all elements, of their squared nodal forces at free nodes"""


@njit(cache=True, error_model="numpy")
def _sum_rows(row_start: State, rows: State, forces: Singles, squares: Singles, nodal: Floats, total: Floats) -> None:
    """Assemble force rows (float32) and their squares into (nodes, 3) and (nodes,) float64."""
    for node in range(len(row_start) - 1):
        for entry in range(row_start[node], row_start[node + 1]):
            row = rows[entry]
            for i in range(3):
                nodal[node, i] += forces[row + i]
            total[node] += squares[row // 3]


def internal_force(
    layout: Layout, state: State, theta: float, *, one_point: bool = False, backend: Backend | None = None
) -> InternalForce:
    """Internal force at `state`: element forces in float32 as `march` computes them, summed in float64."""
    forces = aligned_zeros((layout.force_rows,), np.float32)
    squares = aligned_zeros((layout.force_rows // ROW,), np.float32)
    compiled(backend or default_backend())(
        1, _flat("state", state, np.int32, layout), _NOTHING, *_arrays(layout, one_point),
        theta, theta, 0.0, forces, True, squares, layout.planes, False, _NOBODY,
    )  # fmt: skip
    nodal, total = np.zeros((layout.nodes, 3)), np.zeros(layout.nodes)
    _sum_rows(layout.row_start, layout.rows, forces, squares, nodal, total)
    free = layout.free
    return InternalForce(nodal, float(np.sqrt(np.square(nodal[free]).sum())), float(np.sqrt(total[free].sum())))
