"""Back end A: the element algebra as 16-lane LLVM vector IR, through numba intrinsics.

LLVM splits <16 x float> into what the processor has (one AVX-512 register, two AVX, four NEON), so the same IR serves
every machine. `scalar` offers the same two functions in plain numba.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import llvmlite.ir as ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from solver.dehydration.kernel.algebra import CORE_PLANES, EXOCARP_PLANES, ONE_POINT_PLANES, Vector
from solver.dehydration.kernel.elements import core_forces, exocarp_forces, one_point_forces
from solver.dehydration.kernel.fixed_point import QUANTUM
from solver.dehydration.kernel.generate.lanes import (
    FAST,
    FOUR,
    FOUR_INT,
    INT32,
    INT64,
    WIDE,
    WIDE_INT,
    Lane,
    VectorArithmetic,
    align_stack,
    at,
    constant,
    gather_corner,
    load,
    shuffle,
    splat,
    store,
    store_rows,
)
from solver.dehydration.kernel.strips import LANES

CORNERS = 4
GROUP = 4
"""Nodes that are moved at once, and the rows that each of them has nearly everywhere."""
Face: TypeAlias = list[list[Any]]
"""[corner][component] -> vector of 16 lanes, or the stack slot of one."""


class _Sweep:
    """Code generation of one strip's walk; holds the pointers and the face carried from level to level."""

    def __init__(self, builder: Any, state: Any, offsets: Any, forces: Any, squares: Any, record: Any) -> None:
        self.builder, self.state, self.offsets = builder, state, offsets
        self.forces, self.squares, self.record = forces, squares, record
        self.face = cgutils.alloca_once(builder, INT64)
        self.position: Face = [[cgutils.alloca_once(builder, WIDE_INT) for _ in range(3)] for _ in range(CORNERS)]
        self.force: Face = [[cgutils.alloca_once(builder, WIDE) for _ in range(3)] for _ in range(CORNERS)]

    def _carry(self, slots: Face, values: Face) -> None:
        for corner, vectors in zip(slots, values, strict=True):
            for slot, vector in zip(corner, vectors, strict=True):
                self.builder.store(vector, slot)

    def _carried(self, slots: Face) -> Face:
        return [[self.builder.load(slot) for slot in corner] for corner in slots]

    def _corners(self, pointer: Any, face: Any, width: int) -> list[Any]:
        """Pointers to the corners of a face, each `width` numbers long."""
        first = at(self.builder, pointer, self.builder.mul(face, ir.Constant(INT64, CORNERS * width)))
        return [at(self.builder, first, width * corner) for corner in range(CORNERS)]

    def _gather(self, face: Any) -> Face:
        offsets = self._corners(self.offsets, face, LANES)
        return [gather_corner(self.builder, self.state, corner) for corner in offsets]

    def _store_forces(self, face: Any, forces: Face) -> None:
        for components, rows in zip(forces, self._corners(self.forces, face, 3 * LANES), strict=True):
            store_rows(self.builder, components, rows)

    def _add_squares(self, face: Any, forces: Face) -> None:
        build = self.builder
        for vectors, total in zip(forces, self._corners(self.squares, face, LANES), strict=True):
            x, y, z = (build.fmul(v, v) for v in vectors)
            store(build, build.fadd(load(build, total, WIDE), build.fadd(build.fadd(x, y), z)), total)

    def open(self, first_face: Any) -> None:
        self.builder.store(first_face, self.face)
        self._carry(self.position, self._gather(first_face))
        self._carry(self.force, [[constant(0.0)] * 3] * CORNERS)

    def close(self) -> None:
        self._store_forces(self.builder.load(self.face), self._carried(self.force))

    def element(self, forces_of: Callable[..., list[Vector]], planes: Any, theta: Any) -> None:
        """One element per lane above the carried face: write the forces of that face, carry the next."""
        build = self.builder
        face = build.load(self.face)
        next_face = build.add(face, ir.Constant(INT64, 1))
        below, above = self._carried(self.position), self._gather(next_face)
        # Only differences enter the element. Taken in integers they are exact; node 0 becomes the origin.
        origin = below[0]
        nodes = [[constant(0.0)] * 3] + [
            [
                build.fmul(build.sitofp(build.sub(v, o), WIDE), constant(QUANTUM), flags=FAST)
                for v, o in zip((above if a & 1 else below)[a >> 1], origin, strict=True)
            ]
            for a in range(1, 8)
        ]
        nodes = [[Lane(build, v) for v in vector] for vector in nodes]

        def plane(index: int) -> Lane:
            return Lane(build, load(build, at(build, planes, LANES * index), WIDE))

        nodal = forces_of(VectorArithmetic(build), nodes, plane, Lane(build, theta))
        low, high = ([[v.value for v in vector] for vector in nodal[side::2]] for side in (0, 1))
        pairs = zip(low, self._carried(self.force), strict=True)
        self._store_forces(face, [[build.fadd(p, q) for p, q in zip(*pair, strict=True)] for pair in pairs])
        with build.if_then(self.record, likely=False):
            self._add_squares(face, low)
            self._add_squares(next_face, high)
        self._carry(self.position, above)
        self._carry(self.force, high)
        build.store(next_face, self.face)


@intrinsic
def strip_forces(
    typingctx: Any,
    state: Any,
    offsets: Any,
    strips: Any,
    strip: Any,
    core: Any,
    one_point: Any,
    exocarp: Any,
    full: Any,
    theta: Any,
    forces: Any,
    record: Any,
    squares: Any,
) -> Any:
    """Element forces of one strip.

    state: (4 nn,) float32 positions. offsets: (faces, 4, 16) int32. strips: (strips, 5) int64. strip: int64.
    core, one_point, exocarp: planes, float32. full: int64, outermost core levels that are integrated fully; those below
    take one point. theta: float32, of the core.
    forces: float32 rows, written. record: bool. squares: (faces * 64,) float32; if record, the squared nodal
    forces of each row's elements are added.
    """
    arrays = {0: state, 1: offsets, 2: strips, 4: core, 5: one_point, 6: exocarp, 9: forces, 11: squares}
    others = {3: types.int64, 7: types.int64, 8: types.float32, 10: types.boolean}
    signature = types.void(*(arrays.get(k) or others[k] for k in range(12)))

    def codegen(context: Any, build: Any, signature: Any, args: Any) -> Any:
        align_stack(build)
        data = {k: context.make_array(signature.args[k])(context, build, args[k]).data for k in arrays}
        row = build.mul(args[3], ir.Constant(INT64, 5))
        first_face, first_core, cores, first_exocarp, exocarps = (
            build.load(at(build, data[2], build.add(row, ir.Constant(INT64, column)))) for column in range(5)
        )
        one = ir.Constant(INT64, 1)
        wide_theta = splat(build, args[8], WIDE)
        many = build.icmp_signed("<", args[7], cores)
        deep = build.select(many, build.sub(cores, args[7]), ir.Constant(INT64, 0))
        sweep = _Sweep(build, data[0], data[1], data[9], data[11], cgutils.as_bool_bit(build, args[10]))

        def march(first: Any, count: Any, planes: Any, size: Any, forces_of: Any, factor: Any) -> Any:
            with cgutils.for_range_slice(build, first, build.add(first, count), one, INT64) as (block, _):
                place = build.mul(block, ir.Constant(INT64, size * LANES))
                sweep.element(forces_of, at(build, planes, place), factor)

        sweep.open(first_face)
        march(first_core, deep, data[5], ONE_POINT_PLANES, one_point_forces, wide_theta)
        march(build.add(first_core, deep), build.sub(cores, deep), data[4], CORE_PLANES, core_forces, wide_theta)
        march(first_exocarp, exocarps, data[6], EXOCARP_PLANES, exocarp_forces, constant(1.0))
        sweep.close()
        return context.get_dummy_value()

    return signature, codegen


def _sum_of_rows(build: Any, force: Any, places: Sequence[Any]) -> Any:
    """Sum of force rows of one node, in their order, from zero; four floats, of which the last is a neighbour's."""
    total = ir.Constant(FOUR, [0.0] * 4)
    for place in places:
        total = build.fadd(total, load(build, at(build, force, place), FOUR))
    return total


def _move(build: Any, total: Any, weight: Any, pushed: Any, keep: Any, x: Any, v: Any) -> None:
    """Move nodes, four numbers each, by their summed forces; weight, pushed: inverse mass, and push times it."""
    kind, count = total.type, total.type.count
    zero = ir.Constant(kind, [0.0] * count)
    # A row is three floats: the fourth belongs to its neighbour.
    force = shuffle(build, total, zero, [k if k % 4 < 3 else count for k in range(count)])
    kicked = build.fsub(
        build.fmul(splat(build, keep, kind), load(build, v, kind), flags=FAST),
        build.fmul(pushed, force, flags=FAST),
        flags=FAST,
    )
    kicked = build.select(build.fcmp_ordered(">", weight, zero), kicked, zero)
    store(build, kicked, v)
    # Saturating: a run that blows up stops at the edge of the range instead of being undefined.
    whole, name = ir.VectorType(INT32, count), f"v{count}f32"
    rint = cgutils.get_or_insert_function(build.module, ir.FunctionType(kind, [kind]), f"llvm.rint.{name}")
    saturate = cgutils.get_or_insert_function(
        build.module, ir.FunctionType(whole, [kind]), f"llvm.fptosi.sat.v{count}i32.{name}"
    )
    quanta = build.fmul(kicked, ir.Constant(kind, [1 / QUANTUM] * count), flags=FAST)
    moved = build.call(saturate, [build.call(rint, [quanta])])
    store(build, build.add(load(build, x, whole), moved), x)


@intrinsic
def update_nodes(
    typingctx: Any,
    forces: Any,
    row_start: Any,
    rows: Any,
    inverse_mass: Any,
    state: Any,
    velocity: Any,
    keep: Any,
    push: Any,
    group: Any,
) -> Any:
    """Central-difference update of the nodes GROUP * group and on, GROUP of them where there are as many.

    velocity <- keep * velocity - push * inverse_mass * (sum of force rows); state <- state + velocity; a node of
    inverse mass 0 stays. The fourth component stays 0. Nodes of four rows each, as nearly all are, go at once.
    """
    arrays = (forces, row_start, rows, inverse_mass, state, velocity)
    signature = types.void(*arrays, types.float32, types.float32, types.int64)

    def codegen(context: Any, build: Any, signature: Any, args: Any) -> Any:
        views = [
            context.make_array(kind)(context, build, value)
            for kind, value in zip(signature.args[:6], args[:6], strict=True)
        ]
        force, start, row, mass, x, v = (view.data for view in views)
        keep, push, group = args[6:]
        one, usual = ir.Constant(INT64, 1), ir.Constant(FOUR_INT, [GROUP] * GROUP)
        count = build.extract_value(views[3].shape, 0)
        begin = build.mul(group, ir.Constant(INT64, GROUP))
        beyond = build.add(begin, ir.Constant(INT64, GROUP))
        whole = build.icmp_signed("<=", beyond, count)

        def one_by_one() -> None:
            end = build.select(whole, beyond, count)
            with cgutils.for_range_slice(build, begin, end, one, INT64) as (node, _):
                first = build.sext(build.load(at(build, start, node)), INT64)
                last = build.sext(build.load(at(build, start, build.add(node, one))), INT64)
                total = cgutils.alloca_once(build, FOUR)
                build.store(ir.Constant(FOUR, [0.0] * 4), total)
                with cgutils.for_range_slice(build, first, last, one, INT64) as (entry, _):
                    place = build.sext(build.load(at(build, row, entry)), INT64)
                    build.store(build.fadd(build.load(total), load(build, at(build, force, place), FOUR)), total)
                weight = build.load(at(build, mass, node))
                place = build.shl(node, ir.Constant(INT64, 2))
                pushed = splat(build, build.fmul(push, weight), FOUR)
                here = at(build, x, place), at(build, v, place)
                _move(build, build.load(total), splat(build, weight, FOUR), pushed, keep, *here)

        def at_once() -> None:
            entries = at(build, row, build.sext(build.load(at(build, start, begin)), INT64))
            places = [build.sext(build.load(at(build, entries, k)), INT64) for k in range(GROUP * GROUP)]
            sums = [_sum_of_rows(build, force, places[GROUP * k : GROUP * (k + 1)]) for k in range(GROUP)]
            halves = [shuffle(build, *sums[k : k + 2], range(8)) for k in (0, 2)]
            weights = load(build, at(build, mass, begin), FOUR)
            spread = [k // 4 for k in range(LANES)]
            pushed = shuffle(build, build.fmul(splat(build, push, FOUR), weights), weights, spread)
            place = build.shl(begin, ir.Constant(INT64, 2))
            total = shuffle(build, *halves, range(LANES))
            here = at(build, x, place), at(build, v, place)
            _move(build, total, shuffle(build, weights, weights, spread), pushed, keep, *here)

        with build.if_else(whole, likely=True) as (inside, at_the_end):
            with inside:
                starts = load(build, at(build, start, begin), FOUR_INT)
                following = load(build, at(build, start, build.add(begin, one)), FOUR_INT)
                same = build.icmp_signed("==", build.sub(following, starts), usual)
                every = build.icmp_unsigned("==", build.bitcast(same, ir.IntType(GROUP)), ir.IntType(GROUP)(-1))
                with build.if_else(every, likely=True) as (alike, mixed):
                    with alike:
                        at_once()
                    with mixed:
                        one_by_one()
            with at_the_end:
                one_by_one()
        return context.get_dummy_value()

    return signature, codegen
