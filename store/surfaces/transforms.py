"""The transforms under `spectra`: half-cell cosine and sine series in colatitude, Fourier series in azimuth.

Synthesis, which every query needs, is by pyfftw with cached plans where it is installed, else by scipy.fft, but for the
waves in colatitude of a usual band, which are summed by matrices; the environment variable WIZEN_FFT=pyfftw|scipy|auto
chooses, and all agree to round-off. FFTW plans by estimate, not by measurement: the plan, and with it the last bit of
every result, is then the same in every process, and planning takes a millisecond.
"""

from __future__ import annotations

import os
import sys
import threading
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, NamedTuple, Self

import numpy as np

from solver.arrays import Array

from . import alone

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
#: Waves in colatitude up to which sums are matrices, measured at 32 to 512 colatitudes: in single precision they take
#: half of the transforms' time there, in double as much.
_MATRICES = 129


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
    """One planned way back, from amplitudes (count, m <= band, k) to (count, n, 2n).

    What `put` puts in stays for every run; zero before. Rows of even m hold cosine amplitudes k = 0..n-1, rows of odd m
    sine amplitudes k = 1..n, or the other way round where `swapped`. One thread at a time: take it from `borrow`.
    """

    def __init__(self, n: int, band: int, count: int, dtype: np.dtype[Any], swapped: bool, library: str) -> None:
        self._n, self._band, self._count = n, band, count
        self._dtype, self._cosine = dtype, int(swapped)
        self._library = library
        self._make = _zeros if library == "pyfftw" else np.zeros
        self._plans: list[Any] = []
        # by `put` as (count, m, k); by `run` from there
        self._is_summed = min(band + 1, n) <= _MATRICES
        self._cosines, self._sines = self._by_matrices() if self._is_summed else self._by_transforms()
        if library == "pyfftw":
            self._field: Array = _empty((count, n, 2 * n), dtype)
            # a third faster where it may spoil the lines, which are made anew by every run
            self._plans.append(_plan(self._lines, self._field, "FFTW_BACKWARD", "FFTW_DESTROY_INPUT"))
        self.nbytes = self._cosines.nbytes + self._sines.nbytes + 2 * self._lines.nbytes

    def put(self, planes: Array) -> None:
        """Take the waves m, k of spectra (count, m, k) that the lattice and the band hold."""
        n, band = self._n, planes.shape[2] - 1
        low, high = min(band, n - 1), min(band, n)
        rows = self._band + 1
        cosines, sines = self._cosines, self._sines
        of_cosines = planes[:, self._cosine : rows : 2, : low + 1]
        of_sines = planes[:, 1 - self._cosine : rows : 2, 1 : high + 1]
        if self._is_summed:
            cosines[..., : low + 1], sines[..., :high] = of_cosines, of_sines
        else:
            half = self._dtype.type(0.5)  # the transforms count every wave but the constant twice
            np.multiply(of_cosines, half, out=cosines[..., : low + 1])
            np.multiply(of_sines, half, out=sines[..., :high])
            cosines[..., 0] *= 2
            if high == n:
                sines[..., n - 1] *= 2
        if rows == n + 1:  # the last wave around
            last = cosines if n % 2 == self._cosine else sines
            last[:, -1] *= 2

    def run(self) -> Array:
        """Return the field (count, n, 2n) of what was put in, unnormalised; overwritten by the next run."""
        self._down()
        for plan in self._plans:
            plan.execute()
        if self._plans:
            return self._field
        import scipy.fft

        return scipy.fft.irfft(self._lines, 2 * self._n, axis=2, norm="forward")

    def _by_matrices(self) -> tuple[Array, Array]:
        """Prepare sums in colatitude by matrices: they take half the time of FFTW's transforms of real fields, which
        know no vectors. Memory: k (or a colatitude) by m.
        """
        n, count, dtype, waves = self._n, self._count, self._dtype, min(self._band + 1, self._n)
        self._lines: Array = self._make((count, n, n + 1), _complex(dtype))
        found = []
        self._sums: list[_Sums] = []
        for k, first in enumerate((self._cosine, 1 - self._cosine)):
            amplitudes = np.zeros((count, waves, len(range(first, self._band + 1, 2))), _complex(dtype))
            to = self._lines[..., first : self._band + 1 : 2]
            self._sums.append(_Sums.of(amplitudes, to, n, k))
            found.append(amplitudes.transpose(0, 2, 1))
        return found[0], found[1]

    def _by_transforms(self) -> tuple[Array, Array]:
        """Prepare fast transforms in colatitude. Memory: m by k (or a colatitude)."""
        dtype, first = self._dtype, self._cosine
        coefficients = self._make((self._count, self._band + 1, self._n), _complex(dtype))
        rows = self._make((self._count, self._n + 1, self._n), _complex(dtype))
        self._lines = rows.transpose(0, 2, 1)
        sides = coefficients[:, first::2], coefficients[:, 1 - first :: 2]
        parts, sums = (a.view(dtype).reshape(*a.shape, 2) for a in (coefficients, rows))
        even, odd = ((parts[:, i::2], sums[:, i : self._band + 1 : 2]) for i in (first, 1 - first))
        self._pairs = even, odd
        if self._library == "pyfftw":
            self._plans = [_plan(*even, ("FFTW_REDFT01",)), _plan(*odd, ("FFTW_RODFT01",))]
        return sides

    def _down(self) -> None:
        """Sum in colatitude, where no plan of FFTW does; waves around that there are none of are nothing."""
        if self._plans:
            self._lines[..., self._band + 1 :] = 0  # the last run has spoilt them
        if self._is_summed:
            for sums in self._sums:
                sums.run()
        elif self._library != "pyfftw":
            import scipy.fft

            for (source, target), transform in zip(self._pairs, (scipy.fft.dct, scipy.fft.dst), strict=True):
                target[...] = transform(source, 3, axis=2)


class _Half(NamedTuple):
    """A matrix (blocks, rows, waves) from `waves` (count, waves, columns) of one parity to half of the colatitudes:
    `lines` (count, blocks, rows, columns), of which `values` (count, rows, m) is the complex view.
    """

    matrix: Array
    waves: Array
    lines: Array
    values: Array


class _Sums(NamedTuple):
    """Sums in colatitude of waves that are the same on both hemispheres (`even`) and of those that change their sign
    (`odd`): each is done on the northern one alone, and the southern one is their difference.
    """

    even: _Half
    odd: _Half
    north: Array
    south: Array

    @classmethod
    def of(cls, amplitudes: Array, to: Array, n: int, first: int) -> Self:
        """Prepare sums of amplitudes (count, k, m) of cosines (`first` 0) or sines (1) into `to` (count, n, m)."""
        count, waves, columns = amplitudes.shape
        half, kind = -(-n // 2), amplitudes.real.dtype
        parts = amplitudes.view(kind)

        def of(parity: int) -> _Half:
            matrix = _blocks(n, waves, first, parity, kind.str, 2 * columns)
            lines = np.empty((count, *matrix.shape[:2], 2 * columns), kind)
            values = lines.view(amplitudes.dtype).reshape(count, matrix.shape[0] * matrix.shape[1], columns)[:, :half]
            return _Half(matrix, parts[:, None, parity::2], lines, values)

        return cls(of(0), of(1), to[:, :half], to[:, ::-1][:, : n // 2])

    def run(self) -> None:
        """Sum."""
        for half in (self.even, self.odd):
            np.matmul(half.matrix, half.waves, out=half.lines)
        even, odd, south = self.even.values, self.odd.values, self.south.shape[1]
        np.add(even, odd, out=self.north)
        np.subtract(even[:, :south], odd[:, :south], out=self.south)


@lru_cache(maxsize=128)
def _blocks(n: int, waves: int, first: int, parity: int, dtype: str, columns: int) -> Array:
    """Return the matrix (blocks, rows, waves) from every other amplitude to the northern half of the colatitudes, the
    equator among them, zero beyond: of cosines with `first` 0, k = 0.., of sines with 1, k = 1.., beginning with the
    first (`parity` 0) or the second.

    Products with `columns` are so small by block that BLAS does not divide them among threads, which in a busy server
    would wait for each other.
    """
    k, half = np.arange(waves)[parity::2] + first, -(-n // 2)
    angle = np.outer((np.arange(half) + 0.5) * np.pi / n, k)
    blocks = -(-half * len(k) * columns // alone.MOST) or 1
    rows = -(-half // blocks)
    found = np.zeros((blocks * rows, len(k)), dtype)
    found[:half] = np.sin(angle) if first else np.cos(angle)
    found.flags.writeable = False
    return found.reshape(blocks, rows, len(k))


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


def _plan(source: Array, target: Array, direction: str | tuple[str], *flags: str) -> Any:
    with _planning:  # FFTW's planner is not thread-safe, its plans are
        return pyfftw.FFTW(source, target, axes=(2,), direction=direction, flags=("FFTW_ESTIMATE", *flags), threads=1)
