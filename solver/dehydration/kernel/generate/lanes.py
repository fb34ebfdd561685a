"""Vectors of LLVM IR as abstract numbers, and moving them between memory and lanes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import llvmlite.ir as ir
from numba.core import cgutils

from solver.dehydration.kernel.algebra import INVERSE_CUBE_ROOT_MAGIC, Number, refine_inverse_cube_root
from solver.dehydration.kernel.strips import LANES

FLOAT, INT32, INT64 = ir.FloatType(), ir.IntType(32), ir.IntType(64)
FOUR, WIDE = ir.VectorType(FLOAT, 4), ir.VectorType(FLOAT, LANES)
FOUR_INT = ir.VectorType(INT32, 4)
WIDE_INT = ir.VectorType(INT32, LANES)
# "fast" without nnan and ninf: a run that blows up must end in NaN, not in undefined behaviour.
FAST = ("reassoc", "nsz", "arcp", "contract", "afn")


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
    """The value in every lane."""
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
        """The smaller of two in each lane."""
        return self._choose("<", a, b)

    def maximum(self, a: Lane, b: Lane | float) -> Lane:
        """The larger of two in each lane."""
        return self._choose(">", a, b)

    def inverse_cube_root(self, a: Lane) -> Number:
        """a^(-1/3), from arithmetic on the exponent bits."""
        build = self.builder
        bits = Lane(build, build.sitofp(build.bitcast(a.value, WIDE_INT), WIDE))
        guess = INVERSE_CUBE_ROOT_MAGIC - bits * (1 / 3)
        return refine_inverse_cube_root(a, Lane(build, build.bitcast(build.fptosi(guess.value, WIDE_INT), WIDE)))


def shuffle(builder: Any, a: Any, b: Any, mask: Sequence[int]) -> Any:
    """Lanes of a and b (numbered on) in the order of the mask."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(INT32, len(mask)), list(mask)))


def at(builder: Any, pointer: Any, index: Any) -> Any:
    """Pointer to item `index`, an int or an i64."""
    return builder.gep(pointer, [ir.Constant(INT64, index) if isinstance(index, int) else index])


def load(builder: Any, pointer: Any, kind: Any) -> Any:
    """Unaligned vector load: as fast as an aligned one where the address is aligned, and safe where it is not."""
    loaded = builder.load(builder.bitcast(pointer, kind.as_pointer()))
    loaded.align = 4
    return loaded


def store(builder: Any, value: Any, pointer: Any) -> None:
    """Unaligned vector store."""
    builder.store(value, builder.bitcast(pointer, value.type.as_pointer())).align = 4


def align_stack(builder: Any) -> None:
    """Make the function keep its stack on cache lines.

    An element holds more than there are registers. LLVM finds out that it has to spill vectors when it is too late to
    align the frame, and then each of them lies across two lines. A variable that wants a line of its own says so early;
    assembly of no instructions keeps it from being optimised away.
    """
    slot = cgutils.alloca_once(builder, WIDE)
    slot.align = 4 * LANES
    keep = ir.FunctionType(ir.VoidType(), [slot.type])
    builder.asm(keep, "", "r", [slot], side_effect=True)


def splat(builder: Any, scalar: Any, kind: Any) -> Any:
    """The scalar in every lane of a vector of that kind."""
    single = builder.insert_element(ir.Constant(kind, ir.Undefined), scalar, ir.Constant(INT32, 0))
    return shuffle(builder, single, ir.Constant(kind, ir.Undefined), [0] * kind.count)


def _transpose_masks() -> tuple[list[int], list[int], list[int], list[int]]:
    """Within each group of four lanes: interleave low and high floats of two vectors, then low and high pairs."""
    groups = range(0, LANES, 4)
    low = [i for k in groups for i in (k, LANES + k, k + 1, LANES + k + 1)]
    high = [i for k in groups for i in (k + 2, LANES + k + 2, k + 3, LANES + k + 3)]
    low_pair = [i for k in groups for i in (k, k + 1, LANES + k, LANES + k + 1)]
    high_pair = [i for k in groups for i in (k + 2, k + 3, LANES + k + 2, LANES + k + 3)]
    return low, high, low_pair, high_pair


LOW, HIGH, LOW_PAIR, HIGH_PAIR = _transpose_masks()


def gather_corner(builder: Any, state: Any, offsets: Any) -> list[Any]:
    """x, y, z of one corner of 16 faces: 16 loads of (x, y, z, unused) and a transposition in registers."""
    rows = [
        builder.bitcast(
            load(builder, at(builder, state, builder.sext(builder.load(at(builder, offsets, lane)), INT64)), FOUR_INT),
            FOUR,
        )
        for lane in range(LANES)
    ]
    quads = []
    for j in range(4):
        # Lane 4k + j goes to group k, so that the transposition within groups leaves lanes in order.
        first = shuffle(builder, rows[j], rows[4 + j], range(8))
        second = shuffle(builder, rows[8 + j], rows[12 + j], range(8))
        quads.append(shuffle(builder, first, second, range(LANES)))
    xy01 = shuffle(builder, quads[0], quads[1], LOW)
    xy23 = shuffle(builder, quads[2], quads[3], LOW)
    z01 = shuffle(builder, quads[0], quads[1], HIGH)
    z23 = shuffle(builder, quads[2], quads[3], HIGH)
    components = (
        shuffle(builder, xy01, xy23, LOW_PAIR),
        shuffle(builder, xy01, xy23, HIGH_PAIR),
        shuffle(builder, z01, z23, LOW_PAIR),
    )
    return [builder.bitcast(component, WIDE_INT) for component in components]


def store_rows(builder: Any, components: Sequence[Any], rows: Any) -> None:
    """Write 16 rows of three floats from three vectors."""
    x, y, z = components
    for part in range(3):
        flat = [LANES * part + i for i in range(LANES)]
        # First weave x and y (a don't-care where z belongs), then put z in.
        woven = shuffle(builder, x, y, [f // 3 + LANES * (f % 3 if f % 3 < 2 else 0) for f in flat])
        mask = [LANES + f // 3 if f % 3 == 2 else i for i, f in enumerate(flat)]
        store(builder, shuffle(builder, woven, z, mask), at(builder, rows, LANES * part))
