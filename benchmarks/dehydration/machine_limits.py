"""What this machine reaches alone: multiply-adds on one core, and bytes copied from memory and from the caches."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import llvmlite.ir as ir
import numpy as np
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

__all__ = ["machine_limits"]


@njit(fastmath=True)
def copy_array(source: Any, target: Any) -> None:
    for i in range(source.size):
        target[i] = source[i] + np.float32(1)


@intrinsic
def multiply_add(typingctx: Any, rounds: Any, start: Any) -> Any:
    """`rounds` times 16 independent multiply-adds of 16 lanes."""
    kind = ir.VectorType(ir.FloatType(), 16)

    def codegen(context: Any, build: Any, signature: Any, args: Any) -> Any:
        first = build.insert_element(ir.Constant(kind, [0.5] * 16), args[1], ir.Constant(ir.IntType(32), 0))
        slots = [cgutils.alloca_once_value(build, first) for _ in range(16)]
        one = ir.Constant(ir.IntType(64), 1)
        with cgutils.for_range_slice(build, ir.Constant(ir.IntType(64), 0), args[0], one, ir.IntType(64)):
            for k, slot in enumerate(slots):
                product = build.fmul(build.load(slot), ir.Constant(kind, [0.999 - k * 1e-3] * 16), flags=("contract",))
                build.store(build.fadd(product, ir.Constant(kind, [1e-3] * 16), flags=("contract",)), slot)
        total = build.load(slots[0])
        for slot in slots[1:]:
            total = build.fadd(total, build.load(slot))
        return build.extract_element(total, ir.Constant(ir.IntType(32), 0))

    return types.float32(types.int64, types.float32), codegen


@njit
def spin(rounds: Any, start: Any) -> Any:
    return multiply_add(rounds, start)  # type: ignore[call-arg]


def best_time(call: Callable[[], Any], turns: int = 5) -> float:
    call()
    times = []
    for _ in range(turns):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def machine_limits(working_set: int) -> dict[str, float]:
    """Peak multiply-adds and copy bandwidth, from memory and over a working set like the kernel's."""
    rounds = 5_000_000
    limits = {"gflops": rounds * 16 * 16 * 2 / best_time(lambda: spin(rounds, np.float32(1))) / 1e9}
    for name, size in (("copy_GBps_memory", 2**26), ("copy_GBps_working_set", working_set // 8)):
        source, target = np.zeros(size, np.float32), np.zeros(size, np.float32)
        repeats = max(1, 2**25 // size)

        def copy(source: Any = source, target: Any = target, repeats: int = repeats) -> None:
            for _ in range(repeats):
                copy_array(source, target)

        seconds = best_time(copy)
        # A store fetches its line first: three transfers an item.
        limits[name] = 12.0 * size * repeats / seconds / 1e9
    return limits
