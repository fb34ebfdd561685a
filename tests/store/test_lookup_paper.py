"""The paper's look-up (Liu et al. 2014, Eq. 13-14) in plain numpy, which shares no code with the one that is tested.

The twin weighs the samples' displacements themselves, on their lattice and in double precision: weighing spectra is the
same, as both are linear. It knows the samples, not the table: no spectrum, no kept weights, no file.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from store.lookup import ShapeTable

from ._wrinkled import N, pattern
from .conftest import GAMMA, STAGES, TE

#: What single precision of the stored spectra leaves, of displacements up to 0.2.
_ROUNDING = 5e-7


def _rays() -> np.ndarray:
    """Return unit vectors (N, 2N, 3) at the cells' centres: colatitude from y, azimuth from x towards z."""
    theta = ((np.arange(N) + 0.5) * np.pi / N)[:, None]
    phi = (np.arange(2 * N) * np.pi / N)[None, :]
    return np.stack([np.sin(theta) * np.cos(phi), np.cos(theta) + 0 * phi, np.sin(theta) * np.sin(phi)], axis=-1)


def _sample(i: int, j: int, s: float) -> np.ndarray:
    """Return the displacement (N, 2N, 3) of a sample at a stage, as it was put into the store."""
    return (s * pattern(10 * i + j, 0.3 / TE[i], 0.9 * TE[i]) - 0.5 * s)[..., None] * _rays()


def _paper(te: float, gamma: float, s: float, m: int, eta: float) -> np.ndarray:
    """Return positions (N, 2N, 3): the m nearest weighed by distance^-eta, parameters min/max-normalised."""
    samples = list(itertools.product(range(len(TE)), range(len(GAMMA))))
    scaled = [((TE[i] - te) / (TE[-1] - TE[0]), (GAMMA[j] - gamma) / (GAMMA[-1] - GAMMA[0])) for i, j in samples]
    distance = np.hypot(*np.transpose(scaled))
    nearest = np.argsort(distance)[:m]
    if distance[nearest[0]] == 0:
        weights = np.eye(1, m)[0]
    else:
        weights = distance[nearest] ** -eta
        weights /= weights.sum()
    knots = (0.0, *STAGES)  # at s = 0 nothing has moved
    after = next(k for k in range(1, len(knots)) if s <= knots[k])
    share = (s - knots[after - 1]) / (knots[after] - knots[after - 1])
    moved = np.zeros((N, 2 * N, 3))
    for weight, number in zip(weights, nearest, strict=True):
        before, then = (_sample(*samples[number], stage) for stage in knots[after - 1 : after + 1])
        moved += weight * ((1 - share) * before + share * then)
    return (1 + te) * _rays() + moved


@pytest.mark.parametrize("m", [5, 6, 8])
@pytest.mark.parametrize(("te", "gamma", "s"), [(0.0331, 14.2, 0.17), (0.0476, 27.7, 0.3), (0.0312, 21.3, 0.04)])
def test_the_papers_method_is_the_papers(rough: ShapeTable, te: float, gamma: float, s: float, m: int) -> None:
    exact = _paper(te, gamma, s, m, 2.0)
    shape = rough.at({"te": te, "gamma": gamma}, s, resolution=N, method="idw", m=m)
    assert shape.position is not None
    np.testing.assert_allclose(shape.position, exact, atol=_ROUNDING)
    # and it is neither the nearest sample nor another power of the distance
    assert np.abs(_paper(te, gamma, s, 1, 2.0) - exact).max() > 1e2 * _ROUNDING
    assert np.abs(_paper(te, gamma, s, m, 3.0) - exact).max() > 1e2 * _ROUNDING


def test_a_sample_that_is_hit_is_given_back(rough: ShapeTable) -> None:
    shape = rough.at({"te": TE[1], "gamma": GAMMA[2]}, STAGES[1], resolution=N, method="idw")
    assert shape.position is not None
    exact = (1 + TE[1]) * _rays() + _sample(1, 2, STAGES[1])
    np.testing.assert_allclose(shape.position, exact, atol=_ROUNDING)
