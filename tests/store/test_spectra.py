from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import sph_harm_y

from solver.fruit import colatitudes, lattice
from store.surfaces import spectra, transforms

from .conftest import ROOT

LIBRARIES = ["scipy", "pyfftw"]
DEGREE = 12


def harmonics(theta: Any, phi: Any, seed: int = 3) -> np.ndarray:
    """Return a random vector field (..., 3) of all real spherical harmonics up to DEGREE, in closed form."""
    rng = np.random.default_rng(seed)
    total = np.zeros((*np.broadcast_shapes(np.shape(theta), np.shape(phi)), 3))
    for degree in range(DEGREE + 1):
        for order in range(degree + 1):
            wave = sph_harm_y(degree, order, theta, phi)[..., None]
            total += rng.standard_normal(3) * wave.real + rng.standard_normal(3) * wave.imag
    return total


@pytest.fixture(params=LIBRARIES, autouse=True)
def library(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "pyfftw":
        pytest.importorskip("pyfftw")
    monkeypatch.setenv("WIZEN_FFT", request.param)
    return request.param


@pytest.mark.parametrize("n", [4, 5, 7, 16, 33])
@pytest.mark.parametrize(("dtype", "error"), [(np.float32, 3e-6), (np.float64, 1e-14)])
def test_round_trip_of_any_field(n: int, dtype: type, error: float) -> None:
    field = np.random.default_rng(n).standard_normal((2, n, 2 * n, 3)).astype(dtype)
    waves = spectra.spectrum(field)
    assert waves.shape == (2, n + 1, n + 1, 3)
    assert waves.dtype == (np.complex64 if dtype is np.float32 else np.complex128)
    back = spectra.synthesize(waves, n)
    assert back.dtype == dtype
    assert back.flags.c_contiguous
    np.testing.assert_allclose(back, field, atol=error)
    np.testing.assert_allclose(spectra.synthesize(waves[..., 1], n), field[..., 1], atol=error)
    np.testing.assert_allclose(spectra.spectrum(field[..., 1]), waves[..., 1], atol=error)


@pytest.mark.parametrize("n", [13, 14, 31])
@pytest.mark.parametrize("source", [13, 16, 17])
def test_resampling_a_band_limited_field_is_exact(source: int, n: int) -> None:
    waves = spectra.spectrum(harmonics(*lattice(source)))
    np.testing.assert_allclose(spectra.synthesize(waves, n), harmonics(*lattice(n)), atol=2e-13)
    cut = spectra.truncate(waves, DEGREE)
    assert cut.shape == (DEGREE + 1, DEGREE + 1, 3)
    np.testing.assert_allclose(spectra.synthesize(cut, n), harmonics(*lattice(n)), atol=2e-13)
    assert np.abs(waves[DEGREE + 1 :]).max() < 1e-14
    assert np.abs(waves[:, DEGREE + 1 :]).max() < 1e-14


def test_poles() -> None:
    waves = spectra.spectrum(harmonics(*lattice(16)))
    truth = harmonics(np.array([0.0, np.pi]), np.zeros(2))
    np.testing.assert_allclose(spectra.poles(waves), truth, atol=1e-13)
    np.testing.assert_allclose(spectra.poles(waves[..., 2]), truth[..., 2], atol=1e-13)
    np.testing.assert_allclose(spectra.poles(np.stack([waves, 2 * waves]))[1], 2 * truth, atol=1e-13)


def test_gradient() -> None:
    theta, phi = lattice(24)
    step = 1e-5
    south, east = spectra.gradient(spectra.spectrum(harmonics(*lattice(16))), 24)
    by_theta = (harmonics(theta + step, phi) - harmonics(theta - step, phi)) / (2 * step)
    by_phi = (harmonics(theta, phi + step) - harmonics(theta, phi - step)) / (2 * step)
    np.testing.assert_allclose(south, by_theta, atol=2e-7)
    np.testing.assert_allclose(east, by_phi, atol=2e-7)
    scalar = spectra.gradient(spectra.spectrum(harmonics(*lattice(16))[..., 0]), 24)
    np.testing.assert_allclose(scalar[0], south[..., 0], atol=1e-12)


def test_parseval() -> None:
    n = 16
    field = np.random.default_rng(0).standard_normal((n, 2 * n))
    waves = spectra.spectrum(field)
    # mean squares of the basis: exp(i m phi) with its conjugate counts twice, cos and sin one half, but the constant
    # and the waves of the lattice's own period differ
    by_m = np.full(n + 1, 2.0)
    by_m[0], by_m[n] = 1.0, 4.0
    by_k = np.full((n + 1, n + 1), 0.5)
    by_k[0::2, 0] = 1.0
    by_k[1::2, n] = 1.0
    power = (np.abs(waves) ** 2 * by_k * by_m[:, None]).sum()
    assert power == pytest.approx((field**2).mean(), rel=1e-13)


def test_is_half_of_the_doubled_field_s_transform() -> None:
    # the definition, the slow way: continue over the pole, take the 2-D FFT, read off amplitudes
    n = 8
    field = np.random.default_rng(0).standard_normal((n, 2 * n))
    doubled = np.concatenate([field, np.roll(field, n, axis=1)[::-1]])
    full = np.fft.rfft2(doubled) / doubled.size
    k = np.arange(2 * n)
    full *= np.exp(-1j * np.pi * np.where(k > n, k - 2 * n, k) * 0.5 / n)[:, None]  # colatitudes start half a cell in
    waves = spectra.spectrum(field)
    np.testing.assert_allclose(waves[0:n:2, 1:n], 2 * full[1:n, 0:n:2].T, atol=1e-14)
    np.testing.assert_allclose(waves[1:n:2, 1:n], 2j * full[1:n, 1:n:2].T, atol=1e-14)
    assert waves.nbytes / full.nbytes == pytest.approx((n + 1) / (2 * n))


def test_libraries_agree(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    waves = spectra.spectrum(np.random.default_rng(0).standard_normal((9, 18, 3)))
    ours = spectra.synthesize(waves, 20)
    monkeypatch.setenv("WIZEN_FFT", "scipy")
    np.testing.assert_allclose(spectra.synthesize(waves, 20), ours, atol=1e-14)


def test_truncation_never_folds_back() -> None:
    rng = np.random.default_rng(0)
    waves = rng.standard_normal((17, 17)) + 1j * rng.standard_normal((17, 17))
    low = spectra.truncate(waves, 5)
    np.testing.assert_allclose(spectra.synthesize(waves, 6), spectra.synthesize(spectra.truncate(waves, 6), 6))
    assert spectra.truncate(waves, 99).shape == waves.shape
    assert spectra.synthesize(low, 40).std() < spectra.synthesize(waves, 40).std()


@settings(max_examples=25, deadline=None, derandomize=True)  # the first one plans its transforms
@given(st.integers(4, 20), st.integers(1, 40), st.integers(0, 2**31))
def test_linear_in_the_field(n: int, resolution: int, seed: int) -> None:
    a, b = np.random.default_rng(seed).standard_normal((2, n, 2 * n))
    mixed = spectra.synthesize(0.3 * spectra.spectrum(a) - 2 * spectra.spectrum(b), resolution)
    np.testing.assert_allclose(mixed, spectra.synthesize(spectra.spectrum(0.3 * a - 2 * b), resolution), atol=1e-12)


def test_threads_do_not_share_a_plan() -> None:
    fields = np.random.default_rng(0).standard_normal((32, 12, 24, 3))
    waves = [spectra.spectrum(field) for field in fields]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(20):
            for back, field in zip(pool.map(lambda w: spectra.synthesize(w, 12), waves), fields, strict=True):
                np.testing.assert_allclose(back, field, atol=1e-13)


def test_idle_plans_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transforms, "_IDLE", 100_000)
    waves = spectra.spectrum(np.ones((8, 16)))
    for n in range(8, 40):
        np.testing.assert_allclose(spectra.synthesize(waves, n), 1.0)
    assert sum(plan.nbytes for plans in transforms._free.values() for plan in plans) <= 100_000


def test_wrong_shapes_are_refused() -> None:
    for shape in [(8,), (8, 15), (8, 15, 3)]:
        with pytest.raises(ValueError, match="lattice"):
            spectra.spectrum(np.zeros(shape))
    with pytest.raises(ValueError, match="spectrum"):
        spectra.synthesize(np.zeros((4, 5), complex), 8)
    with pytest.raises(ValueError, match="at least one"):
        spectra.synthesize(np.zeros((5, 5), complex), 0)
    with pytest.raises(ValueError, match="ambiguous"):
        spectra.truncate(np.zeros((5, 5, 3), complex), 2)


def test_unknown_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WIZEN_FFT", "fftpack")
    with pytest.raises(ValueError, match="WIZEN_FFT"):
        transforms.backend()


WITHOUT = """
import sys
sys.modules["pyfftw"] = None
import numpy as np
from store.surfaces import spectra, transforms
field = np.random.default_rng(0).standard_normal((8, 16))
assert np.allclose(spectra.synthesize(spectra.spectrum(field), 8), field)
print(transforms.backend())
"""


def test_works_without_pyfftw(library: str) -> None:
    if library == "pyfftw":
        pytest.skip("the same for both")
    environment = {"PYTHONPATH": str(ROOT)}
    result = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, env=environment)
    assert result.stdout.strip() == "scipy", result.stderr


def test_half_cell_offset() -> None:
    theta = colatitudes(10)[:, None] * np.ones(20)
    waves = spectra.spectrum(np.cos(3 * theta))
    expected = np.zeros((11, 11))
    expected[0, 3] = 1
    np.testing.assert_allclose(waves, expected, atol=1e-15)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("n", "band"), [(4, 4), (5, 3), (16, 16), (33, 12), (33, 33), (40, 64)])
@pytest.mark.parametrize(("dtype", "error"), [(np.float32, 1e-5), (np.float64, 1e-13)])
def test_matrices_and_transforms_are_the_same_series(
    n: int, band: int, swapped: bool, dtype: type, error: float, library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few waves are summed by matrices, many by fast transforms: against the series written out."""
    rng, held = np.random.default_rng(n), min(band, n)
    waves = (rng.standard_normal((2, band + 1, band + 1)) + 1j * rng.standard_normal((2, band + 1, band + 1))).astype(
        np.complex64 if dtype is np.float32 else complex
    )
    theta, phi = (np.arange(n) + 0.5) * np.pi / n, np.arange(2 * n) * np.pi / n
    series = np.zeros((2, n, 2 * n))
    for order in range(held + 1):
        of_cosines = order % 2 == int(swapped)
        k = np.arange(min(held, n - 1) + 1) if of_cosines else np.arange(1, held + 1)
        down = (np.cos if of_cosines else np.sin)(np.outer(theta, k)) @ waves[:, order, k].T  # (n, 2)
        twice = 1 if order == 0 else 2
        series += twice * np.real(np.einsum("tc,p->ctp", down, np.exp(1j * order * phi)))
    found = []
    for most in (0, 10**9):
        monkeypatch.setattr(transforms, "_MATRICES", most)
        plan = transforms.Synthesis(n, held, 2, np.dtype(dtype), swapped, library)
        for _ in range(2):  # what was put in stays
            plan.put(waves)
            field = plan.run()
        found.append(field.copy())
        np.testing.assert_allclose(found[-1], series, atol=error * np.abs(series).max())
    np.testing.assert_allclose(found[0], found[1], atol=error * np.abs(series).max())
