"""Products of wrinkles by band, against quadrature over the sphere; a table that holds them, against one without."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import sph_harm_y

from solver.dehydration import SOLVER
from solver.fruit import directions, lattice
from solver.registry import surface
from store import tables
from store.blending.methods.bands import Bands
from store.blending.methods.products import Products, all_of
from store.generations import generation
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import harmonics, spectra

from .conftest import GAMMA, TE, fill

BAND, COUNT, STAGES = 12, 4, 3
#: Degree and order of waves; the first are the fruit's shape.
MODES = ((1, 0), (2, 1), (3, 2), (5, 1), (6, 0), (9, 4), (12, 7))


@pytest.fixture(scope="module")
def amplitudes() -> np.ndarray:
    """Amplitudes (sample, stage, component, mode) of waves."""
    return np.random.default_rng(5).standard_normal((COUNT, STAGES, 3, len(MODES)))


@pytest.fixture(scope="module")
def stored(amplitudes: np.ndarray) -> np.ndarray:
    theta, phi = lattice(BAND)
    waves = np.array([sph_harm_y(degree, order, theta, phi).real for degree, order in MODES])
    found = spectra.spectrum(np.tensordot(amplitudes, waves, 1))
    return np.ascontiguousarray(found).view(float).reshape(*found.shape, 2)


def mean_products(amplitudes: np.ndarray, bands: Bands) -> np.ndarray:
    """Return products (T, T, bands) of amplitudes (T, component, mode), by Gauss's quadrature over the sphere."""
    x, w = np.polynomial.legendre.leggauss(2 * BAND)
    phi = np.arange(4 * BAND) * np.pi / (2 * BAND)
    theta, phi = np.meshgrid(np.arccos(x), phi, indexing="ij")
    weight = np.broadcast_to(w[:, None], theta.shape) / (2 * theta.shape[1])
    found = np.zeros((len(amplitudes), len(amplitudes), len(bands.first)))
    ends = [*bands.first.tolist(), BAND + 1]
    for b in range(len(bands.first)):
        fields = sum(
            amplitudes[..., k, None, None] * sph_harm_y(degree, order, theta, phi).real
            for k, (degree, order) in enumerate(MODES)
            if ends[b] <= degree < ends[b + 1]
        )
        if isinstance(fields, np.ndarray):
            found[..., b] = np.einsum("actp,bctp,tp->ab", fields, fields, weight)
    return found


@pytest.mark.parametrize("stages", [(0,), (2,), (0, 1), (1, 2)])
@pytest.mark.parametrize("is_known", [False, True])
def test_products_are_means_over_the_sphere(
    stored: np.ndarray, amplitudes: np.ndarray, stages: tuple[int, ...], is_known: bool
) -> None:
    bands, samples = Bands(BAND), (2, 0, 3)
    products = Products(stored, bands, all_of(stored, bands) if is_known else None)
    terms = np.array([amplitudes[i, j] for i in samples for j in stages])
    wanted = mean_products(terms, bands)
    assert np.abs(wanted).max() > 0.1
    np.testing.assert_allclose(products.of(samples, stages), wanted, atol=1e-12)


def test_stages_apart_are_not_taken_for_neighbours(stored: np.ndarray, amplitudes: np.ndarray) -> None:
    bands = Bands(BAND)
    products = Products(stored, bands, all_of(stored, bands))
    terms = np.array([amplitudes[1, 0], amplitudes[1, 2]])
    np.testing.assert_allclose(products.of((1,), (0, 2)), mean_products(terms, bands), atol=1e-12)


@pytest.mark.parametrize("is_known", [False, True])
def test_likeness_is_a_correlation_of_wrinkles(stored: np.ndarray, amplitudes: np.ndarray, is_known: bool) -> None:
    bands = Bands(BAND)
    products = Products(stored, bands, all_of(stored, bands) if is_known else None)
    gram = mean_products(amplitudes[:, 1], bands).sum(axis=-1)
    wanted = np.mean([gram[0, k] / np.sqrt(gram[0, 0] * gram[k, k]) for k in (1, 3)])
    assert products.likeness(0, (1, 3), 1) == pytest.approx(wanted, abs=1e-12)
    assert products.likeness(0, (), 1) == 0


def test_what_has_no_wrinkles_is_like_nothing_and_differs_from_nothing() -> None:
    theta, phi = lattice(BAND)
    round_ones = spectra.spectrum(np.moveaxis(directions(theta, phi), -1, 0))
    stored = np.repeat(np.ascontiguousarray(round_ones).view(float).reshape(1, 1, *round_ones.shape, 2), 2, axis=0)
    assert Products(stored, Bands(BAND)).likeness(0, (1,), 0) is None


def test_low_harmonics_are_those_of_all(stored: np.ndarray) -> None:
    waves = stored[1].view(complex)[..., 0]
    np.testing.assert_allclose(harmonics.low(waves), harmonics.degrees(waves)[..., :3, :3], atol=1e-14)


def test_a_table_answers_as_one_that_holds_no_products(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(store, te=TE, gamma=GAMMA)
    tables.build(store, SOLVER)
    table = ShapeTable.open(store, surfaces=surface)
    held = table._blender._products._known
    assert held is not None
    assert held.shape == (2, 3, 9, 9, len(Bands(16).first))
    wanted = table.at({"te": 0.034, "gamma": 17.0}, 0.17)
    read = generation.read
    monkeypatch.setattr(generation, "read", lambda path: {k: v for k, v in read(path).items() if k != "band_products"})
    before = ShapeTable.open(store, surfaces=surface)
    assert before._blender._products._known is None
    found = before.at({"te": 0.034, "gamma": 17.0}, 0.17)
    assert found.position is not None
    assert wanted.position is not None
    np.testing.assert_allclose(found.position, wanted.position, atol=2e-6)
