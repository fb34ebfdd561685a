"""The weights of `thin` and `lean` written out plainly, by code that shares nothing with the look-up: SciPy's
thin-plate splines and root of an equation, and correlations of patterns on their lattice.
"""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
from scipy.fft import dct
from scipy.interpolate import RBFInterpolator
from scipy.optimize import brentq

from ._wrinkled import N, own
from .conftest import GAMMA, TE

NODES = tuple(itertools.product(range(len(TE)), range(len(GAMMA))))


def bilinear(te: float, gamma: float) -> np.ndarray:
    """Return the weights (9,) of the nodes, linear in both logarithms."""
    sides = [
        [np.interp(np.log(x), np.log(axis), row) for row in np.eye(len(axis))] for axis, x in ((TE, te), (GAMMA, gamma))
    ]
    return np.multiply.outer(np.array(sides[0]), np.array(sides[1])).ravel()


def spline(te: float, gamma: float) -> np.ndarray:
    """Return the weights (9,) of the thin-plate spline through all nodes."""
    spans = [(np.log(axis[0]), np.log(axis[-1] / axis[0])) for axis in (TE, GAMMA)]
    places = [
        [(np.log(x) - low) / span for x, (low, span) in zip((TE[i], GAMMA[j]), spans, strict=True)] for i, j in NODES
    ]
    at = [(np.log(x) - low) / span for x, (low, span) in zip((te, gamma), spans, strict=True)]
    return np.asarray(RBFInterpolator(np.array(places), np.eye(9), kernel="thin_plate_spline", degree=1)([at])[0])


@cache
def agreement(i: int, j: int, shared: float) -> float:
    """Return how far a node's pattern is like its neighbours': nothing up to a correlation of .5, all from .8 on."""

    def dot(a: np.ndarray, b: np.ndarray) -> float:
        # over colatitude as a series of cosines, of which every one is integrated
        series = dct((a * b).mean(axis=1), type=2) / N
        return float(series[0] + sum(2 * series[k] / (1 - k * k) for k in range(2, N, 2)))

    def like(a: np.ndarray, b: np.ndarray) -> float:
        return dot(a, b) / float(np.sqrt(dot(a, a) * dot(b, b)))

    beside = [(k, m) for k, m in NODES if abs(k - i) + abs(m - j) == 1]
    mean = np.mean([like(own(i, j, shared), own(k, m, shared)) for k, m in beside])
    x = np.clip((mean - 0.5) / 0.3, 0, 1)
    return float(3 * x**2 - 2 * x**3)


def leant(weights: np.ndarray, alike: float) -> np.ndarray:
    """Return weights that are multiplied and lowered, all by the same, until those above zero sum to 1."""
    steep = weights * (5 - 4 * alike)
    found: np.ndarray = np.maximum(steep - brentq(lambda off: np.maximum(steep - off, 0).sum() - 1, -1, 5), 0)
    return found


def mixture(te: float, gamma: float, shared: float, lean: bool = False) -> tuple[np.ndarray, float]:
    """Return the weights (9,) of the nodes, and the part that the spline has in them."""
    plain, thin = bilinear(te, gamma), spline(te, gamma)
    assert np.abs(thin).sum() < 2  # all nodes take part, and nothing fades
    part = sum(w * agreement(*node, shared) for w, node in zip(plain, NODES, strict=True) if w)
    rest = leant(plain, part) if lean else plain
    return (1 - part) * rest + part * thin, float(part)
