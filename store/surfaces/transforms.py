"""The transforms under `spectra`: half-cell cosine and sine series in colatitude, Fourier series in azimuth.

Synthesis, which every query needs, is by pyfftw with cached plans where it is installed, else by scipy.fft; the
environment variable WIZEN_FFT=pyfftw|scipy|auto chooses, and both agree to round-off. FFTW plans by estimate, not by
measurement: the plan, and with it the last bit of every result, is then the same in every process, and planning takes
a millisecond.
"""

from __future__ import annotations

import os
import sys
import threading
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from solver.arrays import Array

# pyfftw would import all of dask and scipy's older transforms, for interfaces that are not used here: up to a second
_hidden = [name for name in ("dask", "scipy.fftpack", "scipy.fft") if name not in sys.modules]
sys.modules.update(dict.fromkeys(_hidden))  # type: ignore[arg-type]
try:
    import pyfftw
except ImportError:
    pyfftw = None
finally:
    for _name in _hidden:
        del sys.modules[_name]

__all__ = ["Synthesis", "analyse", "backend", "borrow"]


#: Bytes of idle plans that are kept, over all shapes; a plan for 256 x 512 x 3 in float32 holds 4 MB.
_IDLE = 128 << 20


def backend() -> str:
    """Return the name of the library that does the transforms: pyfftw or scipy.

    Raises:
        ValueError: WIZEN_FFT is not one of auto, pyfftw, scipy.
        ImportError: WIZEN_FFT=pyfftw, and it is not installed.

    """
    asked = os.environ.get("WIZEN_FFT", "auto")
    if asked not in ("auto", "pyfftw", "scipy"):
        raise ValueError(f"WIZEN_FFT={asked} is not one of auto, pyfftw, scipy")
    if asked == "pyfftw" and pyfftw is None:
        raise ImportError("WIZEN_FFT=pyfftw, but pyfftw is not installed: install it, or set WIZEN_FFT=auto")
    return "pyfftw" if asked != "scipy" and pyfftw is not None else "scipy"


def analyse(field: Array) -> Array:
    """Transform fields (count, n, 2n), unnormalised, to (count, n + 1, n): azimuthal wavenumber m, then colatitude.

    Rows of even m hold cosine sums k = 0..n-1 (DCT-II), rows of odd m sine sums k = 1..n (DST-II). Always by scipy:
    it is off the path of queries, and a table's digest must not depend on what else is installed.
    """
    import scipy.fft

    count, n, _ = field.shape
    rows = np.ascontiguousarray(scipy.fft.rfft(field, axis=2).transpose(0, 2, 1))
    parts = rows.view(field.dtype).reshape(count, n + 1, n, 2)
    parts[:, 0::2] = scipy.fft.dct(parts[:, 0::2], 2, axis=2)
    parts[:, 1::2] = scipy.fft.dst(parts[:, 1::2], 2, axis=2)
    return rows


class Synthesis:
    """One planned way back, (count, m <= band, k) to (count, n, 2n); `coefficients` is its input, reused by every run.

    Rows of even m hold cosine coefficients k = 0..n-1, rows of odd m sine coefficients k = 1..n, or the other way
    round where `swapped`; what the caller does not fill stays zero. One thread at a time: take it from `borrow`.
    """

    def __init__(self, n: int, band: int, count: int, dtype: np.dtype[Any], swapped: bool, library: str) -> None:
        self._n = n
        self._library = library
        make = _zeros if library == "pyfftw" else np.zeros
        self.coefficients: Array = make((count, band + 1, n), _complex(dtype))
        self._rows: Array = make((count, n + 1, n), _complex(dtype))
        lines, sums = (a.view(dtype).reshape(*a.shape, 2) for a in (self.coefficients, self._rows))
        even, odd = ((lines[:, first::2], sums[:, first : band + 1 : 2]) for first in (0, 1))
        self._cosines, self._sines = (odd, even) if swapped else (even, odd)
        self._plans: list[Any] = []
        self.nbytes = self.coefficients.nbytes + 2 * self._rows.nbytes
        if library == "pyfftw":
            self._field: Array = _empty((count, n, 2 * n), dtype)
            self._plans = [
                _plan(*self._cosines, ("FFTW_REDFT01",)),
                _plan(*self._sines, ("FFTW_RODFT01",)),
                _plan(self._rows.transpose(0, 2, 1), self._field, "FFTW_BACKWARD"),
            ]

    def run(self) -> Array:
        """Return the field (count, n, 2n) of `coefficients`, unnormalised; overwritten by the next run."""
        if self._library == "pyfftw":
            for plan in self._plans:
                plan.execute()
            return self._field
        import scipy.fft

        for (source, target), transform in ((self._cosines, scipy.fft.dct), (self._sines, scipy.fft.dst)):
            target[...] = transform(source, 3, axis=2)
        return scipy.fft.irfft(self._rows, 2 * self._n, axis=1, norm="forward").transpose(0, 2, 1)


_free: OrderedDict[tuple[Any, ...], list[Synthesis]] = OrderedDict()
_guard = threading.Lock()


@contextmanager
def borrow(n: int, band: int, count: int, dtype: np.dtype[Any], swapped: bool = False) -> Iterator[Synthesis]:
    """Lend a plan to this thread alone. Plans that are not lent are kept for the next borrower, the last used first."""
    library = backend()
    kind = (n, band, count, dtype.str, swapped, library)
    with _guard:
        idle = _free.get(kind)
        plan = idle.pop() if idle else None
    if plan is None:
        plan = Synthesis(n, band, count, dtype, swapped, library)
    try:
        yield plan
    finally:
        with _guard:
            _free.setdefault(kind, []).append(plan)
            _free.move_to_end(kind)
            while sum(plan.nbytes for plans in _free.values() for plan in plans) > _IDLE:
                oldest = next(iter(_free))
                del _free[oldest][:1]
                if not _free[oldest]:
                    del _free[oldest]


def _complex(dtype: np.dtype[Any]) -> np.dtype[Any]:
    return np.dtype(np.complex64) if dtype == np.float32 else np.dtype(np.complex128)


def _empty(shape: tuple[int, ...], dtype: np.dtype[Any]) -> Array:
    found: Array = pyfftw.empty_aligned(shape, dtype)
    return found


def _zeros(shape: tuple[int, ...], dtype: np.dtype[Any]) -> Array:
    found: Array = pyfftw.zeros_aligned(shape, dtype)
    return found


_planning = threading.Lock()


def _plan(source: Array, target: Array, direction: str | tuple[str]) -> Any:
    with _planning:  # FFTW's planner is not thread-safe, its plans are
        return pyfftw.FFTW(source, target, axes=(2,), direction=direction, flags=("FFTW_ESTIMATE",), threads=1)
