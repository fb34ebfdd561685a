"""BLAS and LAPACK in place, with other threads let in meanwhile, which scipy's own wrappers of them do not do.

All matrices are in Fortran's order. Whatever calls these on two threads at once keeps BLAS to one thread itself.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

from scipy.linalg import cython_blas, cython_lapack

from ..arrays import Floats

__all__ = ["cholesky", "right_solve", "take_square"]

_NAME = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(("PyCapsule_GetName", ctypes.pythonapi))
_POINTER = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)


def _routine(library: object, name: str, arguments: int) -> Callable[..., None]:
    capsule = library.__pyx_capi__[name]  # type: ignore[attr-defined]
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arguments)(_POINTER(capsule, _NAME(capsule)))


_DPOTRF = _routine(cython_lapack, "dpotrf", 5)
_DTRSM = _routine(cython_blas, "dtrsm", 11)
_DSYRK = _routine(cython_blas, "dsyrk", 10)


def _one(number: float) -> ctypes.Array[ctypes.c_double]:
    return (ctypes.c_double * 1)(number)


def _whole(number: int) -> ctypes.Array[ctypes.c_int]:
    return (ctypes.c_int * 1)(number)


def cholesky(a: Floats) -> bool:
    """Write the factor L of a (n, n), lower triangle, over it; returns whether a is not positive definite."""
    n, info = _whole(len(a)), _whole(0)
    _DPOTRF(b"L", n, a.ctypes.data, n, info)
    return bool(info[0])


def right_solve(lower: Floats, b: Floats) -> None:
    """Write b L^-T over b (m, n); lower (n, n): L."""
    m, n = (_whole(size) for size in b.shape)
    _DTRSM(b"R", b"L", b"T", b"N", m, n, _one(1.0), lower.ctypes.data, n, b.ctypes.data, m)


def take_square(b: Floats, c: Floats) -> None:
    """Take b b^T (m, m) from the lower triangle of c; b (m, n)."""
    m, n = (_whole(size) for size in b.shape)
    _DSYRK(b"L", b"N", m, n, _one(-1.0), b.ctypes.data, m, _one(1.0), c.ctypes.data, m)
