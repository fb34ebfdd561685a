"""Back end A: the element algebra as 16-lane LLVM vector IR, through numba intrinsics.

LLVM splits <16 x float> into what the processor has (one AVX-512 register, two AVX, four NEON), so the same IR serves
every machine. `scalar` offers the same two functions in plain numba.
"""

from __future__ import annotations

from collections.abc import Callable
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
    splat,
    store,
    store_rows,
)
from solver.dehydration.kernel.generate.node_ir import mix_alike, update_nodes
from solver.dehydration.kernel.strips import LANES

__all__ = ["mix_alike", "strip_forces", "update_nodes"]

CORNERS = 4
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
