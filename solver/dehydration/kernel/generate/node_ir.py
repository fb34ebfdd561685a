"""Back end A's update of the nodes: four at once where each of them has four force rows, as nearly all have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import llvmlite.ir as ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from solver.dehydration.kernel.fixed_point import QUANTUM
from solver.dehydration.kernel.generate.lanes import FAST, FOUR, FOUR_INT, INT32, INT64, at, load, shuffle, splat, store
from solver.dehydration.kernel.strips import GROUP, LANES


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
    rint = cgutils.get_or_insert_function(build.module, ir.FunctionType(kind, [kind]), f"llvm.rint.v{count}f32")
    quanta = build.call(rint, [build.fmul(kicked, ir.Constant(kind, [1 / QUANTUM] * count), flags=FAST)])
    store(build, build.add(load(build, x, ir.VectorType(INT32, count)), _saturated(build, quanta)), x)


def _saturated(build: Any, value: Any) -> Any:
    """Nearest integers in range, 0 of what is not a number, as llvm.fptosi.sat, which LLVM would do lane by lane.

    Saturating: a run that blows up stops at the edge of the range instead of being undefined.
    """
    count = value.type.count
    whole = ir.VectorType(INT32, count)

    def every(number: float) -> Any:
        return ir.Constant(value.type, [number] * count)

    inside = build.fcmp_ordered("<", value, every(2.0**31))
    bounded = build.select(inside, value, every(0.0))
    bounded = build.select(build.fcmp_ordered(">", bounded, every(-(2.0**31))), bounded, every(-(2.0**31)))
    beyond = build.select(
        build.fcmp_unordered("uno", value, value),
        ir.Constant(whole, [0] * count),
        ir.Constant(whole, [2**31 - 1] * count),
    )
    return build.select(inside, build.fptosi(bounded, whole), beyond)


class _Nodes:
    """Code generation of a group's update; holds the pointers and the two factors."""

    def __init__(self, builder: Any, pointers: Sequence[Any], keep: Any, push: Any) -> None:
        self.builder, self.keep, self.push = builder, keep, push
        self.force, self.start, self.row, self.mass, self.state, self.velocity = pointers

    def _here(self, node: Any) -> tuple[Any, Any]:
        place = self.builder.shl(node, ir.Constant(INT64, 2))
        return at(self.builder, self.state, place), at(self.builder, self.velocity, place)

    def alike(self, begin: Any) -> Any:
        """Whether all nodes of the group have GROUP rows."""
        build = self.builder
        starts = load(build, at(build, self.start, begin), FOUR_INT)
        following = load(build, at(build, self.start, build.add(begin, ir.Constant(INT64, 1))), FOUR_INT)
        same = build.icmp_signed("==", build.sub(following, starts), ir.Constant(FOUR_INT, [GROUP] * GROUP))
        return build.icmp_unsigned("==", build.bitcast(same, ir.IntType(GROUP)), ir.IntType(GROUP)(-1))

    def one_by_one(self, begin: Any, end: Any) -> None:
        """Move nodes of any number of rows."""
        build, one = self.builder, ir.Constant(INT64, 1)
        with cgutils.for_range_slice(build, begin, end, one, INT64) as (node, _):
            first = build.sext(build.load(at(build, self.start, node)), INT64)
            last = build.sext(build.load(at(build, self.start, build.add(node, one))), INT64)
            total = cgutils.alloca_once(build, FOUR)
            build.store(ir.Constant(FOUR, [0.0] * 4), total)
            with cgutils.for_range_slice(build, first, last, one, INT64) as (entry, _):
                place = build.sext(build.load(at(build, self.row, entry)), INT64)
                build.store(build.fadd(build.load(total), load(build, at(build, self.force, place), FOUR)), total)
            weight = build.load(at(build, self.mass, node))
            pushed = splat(build, build.fmul(self.push, weight), FOUR)
            _move(build, build.load(total), splat(build, weight, FOUR), pushed, self.keep, *self._here(node))

    def at_once(self, begin: Any) -> None:
        """Move a group that is `alike`."""
        build = self.builder
        entries = at(build, self.row, build.sext(build.load(at(build, self.start, begin)), INT64))
        places = [build.sext(build.load(at(build, entries, k)), INT64) for k in range(GROUP * GROUP)]
        sums = [_sum_of_rows(build, self.force, places[GROUP * k : GROUP * (k + 1)]) for k in range(GROUP)]
        low, high = (shuffle(build, sums[k], sums[k + 1], range(8)) for k in (0, 2))
        weights = load(build, at(build, self.mass, begin), FOUR)
        spread = [k // 4 for k in range(LANES)]
        pushed = shuffle(build, build.fmul(splat(build, self.push, FOUR), weights), weights, spread)
        total = shuffle(build, low, high, range(LANES))
        _move(build, total, shuffle(build, weights, weights, spread), pushed, self.keep, *self._here(begin))


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
    inverse mass 0 stays. The fourth component stays 0.
    """
    arrays = (forces, row_start, rows, inverse_mass, state, velocity)
    signature = types.void(*arrays, types.float32, types.float32, types.int64)

    def codegen(context: Any, build: Any, signature: Any, args: Any) -> Any:
        views = [context.make_array(k)(context, build, v) for k, v in zip(signature.args[:6], args[:6], strict=True)]
        nodes = _Nodes(build, [view.data for view in views], *args[6:8])
        count = build.extract_value(views[3].shape, 0)
        begin = build.mul(args[8], ir.Constant(INT64, GROUP))
        beyond = build.add(begin, ir.Constant(INT64, GROUP))
        with build.if_else(build.icmp_signed("<=", beyond, count), likely=True) as (inside, at_the_end):
            with inside, build.if_else(nodes.alike(begin), likely=True) as (alike, mixed):
                with alike:
                    nodes.at_once(begin)
                with mixed:
                    nodes.one_by_one(begin, beyond)
            with at_the_end:
                nodes.one_by_one(begin, count)
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def mix_alike(typingctx: Any, forces: Any, row_start: Any, rows: Any, tops: Any, spread: Any, place: Any) -> Any:
    """`coupled.mix` of a column of which each of the three nodes has GROUP rows."""
    arrays = (forces, row_start, rows, tops, spread)
    signature = types.void(*arrays, types.int64)

    def codegen(context: Any, build: Any, signature: Any, args: Any) -> Any:
        views = [context.make_array(k)(context, build, v) for k, v in zip(signature.args[:5], args[:5], strict=True)]
        force, start, row, top, share = (view.data for view in views)
        low = build.sub(build.sext(build.load(at(build, top, args[5])), INT64), ir.Constant(INT64, 2))
        entries = at(build, row, build.sext(build.load(at(build, start, low)), INT64))
        places = [build.sext(build.load(at(build, entries, k)), INT64) for k in range(3 * GROUP)]
        sums = [_sum_of_rows(build, force, places[GROUP * k : GROUP * (k + 1)]) for k in range(3)]
        shares = at(build, share, build.mul(args[5], ir.Constant(INT64, 6)))
        for k, (one, other) in enumerate(((1, 2), (0, 2), (0, 1))):
            a, b = (splat(build, build.load(at(build, shares, 2 * k + i)), FOUR) for i in range(2))
            first = at(build, force, places[GROUP * k])
            gained = build.fadd(
                build.fmul(a, sums[one], flags=FAST), build.fmul(b, sums[other], flags=FAST), flags=FAST
            )
            mixed = build.fadd(load(build, first, FOUR), gained, flags=FAST)
            # the fourth is a neighbour's, which another thread may be adding to
            for i in range(3):
                build.store(build.extract_element(mixed, INT32(i)), at(build, first, i))
        return context.get_dummy_value()

    return signature, codegen
