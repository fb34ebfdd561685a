"""Reinterpretation of float32 as int32 and back, for plain numba code."""

from __future__ import annotations

from typing import Any

import llvmlite.ir as ir
import numpy as np
from numba import njit, types
from numba.extending import intrinsic

from solver.dehydration.kernel.algebra import INVERSE_CUBE_ROOT_MAGIC

_MAGIC = np.float32(INVERSE_CUBE_ROOT_MAGIC)
_THIRD = np.float32(1 / 3)


@intrinsic
def _bits(typingctx: Any, value: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(32))

    return types.int32(types.float32), codegen


@intrinsic
def _from_bits(typingctx: Any, bits: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.FloatType())

    return types.float32(types.int32), codegen


@njit(inline="always")
def guess_inverse_cube_root(value: Any) -> Any:
    """value^(-1/3) to 3.4 % by arithmetic on the exponent bits; value float32 > 0."""
    return _from_bits(np.int32(_MAGIC - np.float32(_bits(value)) * _THIRD))  # type: ignore[call-arg]
