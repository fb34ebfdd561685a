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

from solver.dehydration.kernel.algebra import (
    CORE_PLANES,
    EXOCARP_PLANES,
    INVERSE_CUBE_ROOT_MAGIC,
    ONE_POINT_PLANES,
    Number,
    Vector,
    refine_inverse_cube_root,
)
from solver.dehydration.kernel.elements import core_forces, exocarp_forces, one_point_forces
from solver.dehydration.kernel.fixed_point import QUANTUM
from solver.dehydration.kernel.strips import LANES

FLOAT, INT32, INT64 = ir.FloatType(), ir.IntType(32), ir.IntType(64)
FOUR, WIDE = ir.VectorType(FLOAT, 4), ir.VectorType(FLOAT, LANES)
FOUR_INT = ir.VectorType(INT32, 4)
WIDE_INT = ir.VectorType(INT32, LANES)
# "fast" without nnan and ninf: a run that blows up must end in NaN, not in undefined behaviour.
FAST = ("reassoc", "nsz", "arcp", "contract", "afn")
CORNERS = 4


class Lane:
    """Abstract number of `algebra`: 16 float32 lanes in a virtual register."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder = builder
        self.value = value

    def _operand(self, other: Lane | float) -> Any:
        return other.value if isinstance(other, Lane) else constant(other)

    def __add__(self, other: Lane | float) -> Lane:
        return Lane(self.builder, self.builder.fadd(self.value, self._operand(other), flags=FAST))

    def __sub__(self, other: Lane | float) -> Lane:
        return Lane(self.builder, self.builder.fsub(self.value, self._operand(other), flags=FAST))

    def __rsub__(self, other: float) -> Lane:
        return Lane(self.builder, self.builder.fsub(constant(other), self.value, flags=FAST))

    def __mul__(self, other: Lane | float) -> Lane:
        return Lane(self.builder, self.builder.fmul(self.value, self._operand(other), flags=FAST))

    def __truediv__(self, other: Lane | float) -> Lane:
        return Lane(self.builder, self.builder.fdiv(self.value, self._operand(other), flags=FAST))

    def __rtruediv__(self, other: float) -> Lane:
        return Lane(self.builder, self.builder.fdiv(constant(other), self.value, flags=FAST))

    __radd__ = __add__
    __rmul__ = __mul__


def constant(value: float) -> Any:
    return ir.Constant(WIDE, [float(value)] * LANES)


class VectorArithmetic:
    """`algebra.Arithmetic` on lanes."""

    def __init__(self, builder: Any) -> None:
        self.builder = builder

    def _choose(self, relation: str, a: Lane, b: Lane | float) -> Lane:
        other = b.value if isinstance(b, Lane) else constant(b)
        first = self.builder.fcmp_ordered(relation, a.value, other)
        return Lane(self.builder, self.builder.select(first, a.value, other))

    def minimum(self, a: Lane, b: Lane | float) -> Lane:
        return self._choose("<", a, b)

    def maximum(self, a: Lane, b: Lane | float) -> Lane:
        return self._choose(">", a, b)

    def inverse_cube_root(self, a: Lane) -> Number:
        build = self.builder
        bits = Lane(build, build.sitofp(build.bitcast(a.value, WIDE_INT), WIDE))
        guess = INVERSE_CUBE_ROOT_MAGIC - bits * (1 / 3)
        return refine_inverse_cube_root(a, Lane(build, build.bitcast(build.fptosi(guess.value, WIDE_INT), WIDE)))


def _shuffle(builder: Any, a: Any, b: Any, mask: Sequence[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(INT32, len(mask)), list(mask)))


def _at(builder: Any, pointer: Any, index: Any) -> Any:
    return builder.gep(pointer, [ir.Constant(INT64, index) if isinstance(index, int) else index])


def _load(builder: Any, pointer: Any, kind: Any) -> Any:
    """Unaligned vector load: as fast as an aligned one where the address is aligned, and safe where it is not."""
    loaded = builder.load(builder.bitcast(pointer, kind.as_pointer()))
    loaded.align = 4
    return loaded


def _store(builder: Any, value: Any, pointer: Any) -> None:
    builder.store(value, builder.bitcast(pointer, value.type.as_pointer())).align = 4


def _splat(builder: Any, scalar: Any, kind: Any) -> Any:
    single = builder.insert_element(ir.Constant(kind, ir.Undefined), scalar, ir.Constant(INT32, 0))
    return _shuffle(builder, single, ir.Constant(kind, ir.Undefined), [0] * kind.count)


def _transpose_masks() -> tuple[list[int], list[int], list[int], list[int]]:
    """Within each group of four lanes: interleave low and high floats of two vectors, then low and high pairs."""
    groups = range(0, LANES, 4)
    low = [i for k in groups for i in (k, LANES + k, k + 1, LANES + k + 1)]
    high = [i for k in groups for i in (k + 2, LANES + k + 2, k + 3, LANES + k + 3)]
    low_pair = [i for k in groups for i in (k, k + 1, LANES + k, LANES + k + 1)]
    high_pair = [i for k in groups for i in (k + 2, k + 3, LANES + k + 2, LANES + k + 3)]
    return low, high, low_pair, high_pair


LOW, HIGH, LOW_PAIR, HIGH_PAIR = _transpose_masks()


def _gather_corner(builder: Any, state: Any, offsets: Any) -> list[Any]:
    """x, y, z of one corner of 16 faces: 16 loads of (x, y, z, unused) and a transposition in registers."""
    rows = [
        builder.bitcast(
            _load(builder, _at(builder, state, builder.sext(builder.load(_at(builder, offsets, lane)), INT64)), FOUR_INT),
            FOUR,
        )
        for lane in range(LANES)
    ]
    quads = []
    for j in range(4):
        # Lane 4k + j goes to group k, so that the transposition within groups leaves lanes in order.
        first = _shuffle(builder, rows[j], rows[4 + j], range(8))
        second = _shuffle(builder, rows[8 + j], rows[12 + j], range(8))
        quads.append(_shuffle(builder, first, second, range(LANES)))
    xy01 = _shuffle(builder, quads[0], quads[1], LOW)
    xy23 = _shuffle(builder, quads[2], quads[3], LOW)
    z01 = _shuffle(builder, quads[0], quads[1], HIGH)
    z23 = _shuffle(builder, quads[2], quads[3], HIGH)
    components = (
        _shuffle(builder, xy01, xy23, LOW_PAIR),
        _shuffle(builder, xy01, xy23, HIGH_PAIR),
        _shuffle(builder, z01, z23, LOW_PAIR),
    )
    return [builder.bitcast(component, WIDE_INT) for component in components]


def _store_rows(builder: Any, components: Sequence[Any], rows: Any) -> None:
    """Write 16 rows of three floats from three vectors."""
    x, y, z = components
    for part in range(3):
        flat = [LANES * part + i for i in range(LANES)]
        # First weave x and y (a don't-care where z belongs), then put z in.
        woven = _shuffle(builder, x, y, [f // 3 + LANES * (f % 3 if f % 3 < 2 else 0) for f in flat])
        mask = [LANES + f // 3 if f % 3 == 2 else i for i, f in enumerate(flat)]
        _store(builder, _shuffle(builder, woven, z, mask), _at(builder, rows, LANES * part))


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
        first = _at(self.builder, pointer, self.builder.mul(face, ir.Constant(INT64, CORNERS * width)))
        return [_at(self.builder, first, width * corner) for corner in range(CORNERS)]

    def _gather(self, face: Any) -> Face:
        offsets = self._corners(self.offsets, face, LANES)
        return [_gather_corner(self.builder, self.state, corner) for corner in offsets]

    def _store_forces(self, face: Any, forces: Face) -> None:
        for components, rows in zip(forces, self._corners(self.forces, face, 3 * LANES), strict=True):
            _store_rows(self.builder, components, rows)

    def _add_squares(self, face: Any, forces: Face) -> None:
        build = self.builder
        for vectors, total in zip(forces, self._corners(self.squares, face, LANES), strict=True):
            x, y, z = (build.fmul(v, v) for v in vectors)
            _store(build, build.fadd(_load(build, total, WIDE), build.fadd(build.fadd(x, y), z)), total)

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
            return Lane(build, _load(build, _at(build, planes, LANES * index), WIDE))

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


@intrinsic  # type: ignore[untyped-decorator]
def strip_forces(
    typingctx, state, offsets, strips, strip, core, one_point, exocarp, single, theta, forces, record, squares
):
    """Element forces of one strip.

    state: (4 nn,) float32 positions. offsets: (faces, 4, 16) int32. strips: (strips, 5) int64. strip: int64.
    core, one_point, exocarp: planes, float32. single: bool, use the one-point core. theta: float32, of the core.
    forces: float32 rows, written. record: bool. squares: (faces * 64,) float32; if record, the squared nodal
    forces of each row's elements are added.
    """
    arrays = {0: state, 1: offsets, 2: strips, 4: core, 5: one_point, 6: exocarp, 9: forces, 11: squares}
    others = {3: types.int64, 7: types.boolean, 8: types.float32, 10: types.boolean}
    signature = types.void(*(arrays.get(k) or others[k] for k in range(12)))

    def codegen(context, build, signature, args):
        data = {k: context.make_array(signature.args[k])(context, build, args[k]).data for k in arrays}
        row = build.mul(args[3], ir.Constant(INT64, 5))
        first_face, first_core, cores, first_exocarp, exocarps = (
            build.load(_at(build, data[2], build.add(row, ir.Constant(INT64, column)))) for column in range(5)
        )
        one = ir.Constant(INT64, 1)
        wide_theta = _splat(build, args[8], WIDE)
        single_chosen = cgutils.as_bool_bit(build, args[7])
        sweep = _Sweep(build, data[0], data[1], data[9], data[11], cgutils.as_bool_bit(build, args[10]))

        def march(first, count, planes, size, forces_of, factor):
            with cgutils.for_range_slice(build, first, build.add(first, count), one, INT64) as (block, _):
                place = build.mul(block, ir.Constant(INT64, size * LANES))
                sweep.element(forces_of, _at(build, planes, place), factor)

        sweep.open(first_face)
        with build.if_else(single_chosen) as (then, otherwise):
            with then:
                march(first_core, cores, data[5], ONE_POINT_PLANES, one_point_forces, wide_theta)
            with otherwise:
                march(first_core, cores, data[4], CORE_PLANES, core_forces, wide_theta)
        march(first_exocarp, exocarps, data[6], EXOCARP_PLANES, exocarp_forces, constant(1.0))
        sweep.close()
        return context.get_dummy_value()

    return signature, codegen


@intrinsic  # type: ignore[untyped-decorator]
def update_node(typingctx, forces, row_start, rows, inverse_mass, state, velocity, keep, push, node):
    """Central-difference update of one node, all components at once.

    velocity <- keep * velocity - push * inverse_mass * (sum of force rows); state <- state + velocity; a node of
    inverse mass 0 stays. The fourth component stays 0.
    """
    arrays = (forces, row_start, rows, inverse_mass, state, velocity)
    signature = types.void(*arrays, types.float32, types.float32, types.int64)

    def codegen(context, build, signature, args):
        force, start, row, mass, x, v = (
            context.make_array(kind)(context, build, value).data
            for kind, value in zip(signature.args[:6], args[:6], strict=True)
        )
        keep, push, node = args[6:]
        one = ir.Constant(INT64, 1)
        first = build.sext(build.load(_at(build, start, node)), INT64)
        last = build.sext(build.load(_at(build, start, build.add(node, one))), INT64)
        total = cgutils.alloca_once_value(build, ir.Constant(FOUR, [0.0] * 4))
        with cgutils.for_range_slice(build, first, last, one, INT64) as (entry, _):
            place = build.sext(build.load(_at(build, row, entry)), INT64)
            summed = build.fadd(build.load(total), _load(build, _at(build, force, place), FOUR))
            build.store(summed, total)
        # A row is three floats: the fourth belongs to its neighbour.
        zero = ir.Constant(FOUR, [0.0] * 4)
        sum_of_rows = _shuffle(build, build.load(total), zero, [0, 1, 2, 4])
        weight = build.load(_at(build, mass, node))
        place = build.shl(node, ir.Constant(INT64, 2))
        kicked = build.fsub(
            build.fmul(_splat(build, keep, FOUR), _load(build, _at(build, v, place), FOUR), flags=FAST),
            build.fmul(_splat(build, build.fmul(push, weight), FOUR), sum_of_rows, flags=FAST),
            flags=FAST,
        )
        free = build.fcmp_ordered(">", _splat(build, weight, FOUR), zero)
        kicked = build.select(free, kicked, zero)
        _store(build, kicked, _at(build, v, place))
        # Saturating: a run that blows up stops at the edge of the range instead of being undefined.
        rint = cgutils.get_or_insert_function(build.module, ir.FunctionType(FOUR, [FOUR]), "llvm.rint.v4f32")
        saturate = cgutils.get_or_insert_function(
            build.module, ir.FunctionType(FOUR_INT, [FOUR]), "llvm.fptosi.sat.v4i32.v4f32"
        )
        quanta = build.fmul(kicked, ir.Constant(FOUR, [1 / QUANTUM] * 4), flags=FAST)
        moved = build.call(saturate, [build.call(rint, [quanta])])
        _store(build, build.add(_load(build, _at(build, x, place), FOUR_INT), moved), _at(build, x, place))
        return context.get_dummy_value()

    return signature, codegen
