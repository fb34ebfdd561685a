"""The look-up against its own formulas written out plainly: a mean in double precision, fields on lattices, no kept
products, no matrices in place of transforms. Weights, fits and transforms are tested elsewhere; a twin that shares no
code with the look-up is in test_lookup_paper.py.
"""

from __future__ import annotations

import numpy as np
import pytest

from solver.fruit import lattice
from store.blending import methods
from store.blending.blend import complex_view
from store.blending.methods import bands, cells, envelope, poles
from store.lookup import ShapeTable
from store.surfaces import harmonics, spectra

from ._thin import NODES, mixture
from .conftest import GAMMA, TE

QUERY, STAGE = {"te": 0.033, "gamma": 14.0}, 0.17


def squares(waves: np.ndarray) -> np.ndarray:
    """Return the mean square of the wrinkles around each place of the coarse lattice."""
    return np.asarray(cells._local(waves[None], harmonics.degrees(waves)[None, ..., :3, :3])[0, 0])


def _bands(waves: np.ndarray, targets: bands.Targets) -> np.ndarray:
    """Return the power by band."""
    return np.asarray(bands.add_up(harmonics.power(harmonics.degrees(waves)).sum(axis=0), targets.bands))


def plain(table: ShapeTable, n: int, shared: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (n, 2n, 3) and poles (2, 3) of the default method."""
    samples, stored, blender = table._samples, table._spectra, table._blender
    assert samples is not None
    stages, (own, part) = table._bracket(STAGE), mixture(QUERY["te"], QUERY["gamma"], shared, lean=True)
    places = {tuple(table.sample(i).values()): i for i in range(len(NODES))}
    numbered = [(places[TE[i], GAMMA[j]], w) for (i, j), w in zip(NODES, own, strict=True) if w]
    taken, weights = np.array([i for i, _ in numbered]), np.array([w for _, w in numbered])
    terms = [(i, j, w * t) for i, w in numbered for j, t in stages.items()]
    assert len(terms) == (18 if shared else 4)  # all nodes, or the nearer corners that are left, at two stages
    full = sum(w * complex_view(stored[i, j]).astype(complex) for i, j, w in terms)
    assert isinstance(full, np.ndarray)
    targets = bands.Targets(blender.power, samples)
    mean = _bands(full, targets)
    point = samples.scale(np.array(list(QUERY.values())))
    whole = targets.gains(point, taken, np.stack([weights, weights], axis=1), stages, mean)
    sizes = [np.sqrt(_bands(complex_view(stored[i, j]).astype(complex), targets)) for i, j, _ in terms]
    amplitude = np.asarray(sum(w * size for (_, _, w), size in zip(terms, sizes, strict=True)))
    kept = np.sqrt((amplitude**2).sum() / mean.sum())
    assert kept > 1.006  # from there on all that is lost is given back
    faint = 1e-3 * mean.mean() + 1e-10
    gains = whole ** (1 - part) * ((amplitude**2 + faint) / (mean + faint)) ** (part / 2)

    cut = slice(min(n, table.resolution) + 1)
    waves = full[:, cut, cut].copy()
    sharp = np.clip(1 + bands._unleak(targets.bands.highest) @ (gains - 1), 0.25, 4)
    modes = np.arange(waves.shape[-1])
    degree = np.log(np.maximum(np.hypot(modes[:, None], modes), 1))
    knots = [np.log(2.9), *targets.bands.centres, np.log(3.0 * modes[-1] + 3)]
    poles.multiply(waves, np.interp(degree, knots, [1, *sharp, sharp[-1]]), targets.highest)

    local = squares(full)
    local_sizes = [np.sqrt(squares(complex_view(stored[i, j]).astype(complex))) for i, j, _ in terms]
    wanted = sum(w * amplitude for (_, _, w), amplitude in zip(terms, local_sizes, strict=True))
    settled = envelope.Total(float((gains**2 * mean).sum()), float((whole**2 * mean).sum()))
    ratio = envelope.factor(local, np.asarray(wanted), settled)
    wave = spectra.spectrum(ratio)
    low = harmonics.degrees(full)[..., :3, :3]
    envelope.take_low(waves, low)
    shape = np.zeros_like(waves)
    envelope.take_low(shape, -low)

    u = spectra.synthesize(waves, n) * spectra.synthesize(wave, n) + spectra.synthesize(shape, n)
    start = table.fresh(QUERY)
    ends = spectra.poles(waves) * spectra.poles(wave) + spectra.poles(shape)
    fresh = start.points(np.array([0.0, np.pi]), np.zeros(2))
    return start.points(*lattice(n)) + np.moveaxis(u, 0, -1), fresh + ends.T


@pytest.mark.parametrize("n", [8, 12, 32, 64, 90])
@pytest.mark.parametrize("shared", [0.0, 0.8])
def test_the_default_is_what_it_is_said_to_be(rough: ShapeTable, alike: ShapeTable, n: int, shared: float) -> None:
    table = alike if shared else rough
    shape = table.at(QUERY, STAGE, resolution=n)
    position, ends = plain(table, n, shared)
    assert shape.method == methods.DEFAULT
    assert shape.position is not None
    assert shape.poles is not None
    assert np.ptp(np.linalg.norm(position, axis=-1)) > 0.01
    np.testing.assert_allclose(shape.position, position, atol=1e-6)
    np.testing.assert_allclose(shape.poles, ends, atol=1e-6)
