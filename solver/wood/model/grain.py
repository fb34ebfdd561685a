"""Grain: stiffness and strength that vary, by a seeded smooth random field, by growth rings and by rays."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import gamma, log_ndtr

from ..parts import Grain

__all__ = ["Field", "rayed", "ringed", "weibull_modulus"]

_WAVES = 64
#: A deviation that is none.
_EVEN = 1e-6


class Field:
    """A Gaussian field of mean 0 and variance 1 by random cosines (Rahimi and Recht 2007, Eq. 1 of their sec. 3).

    It can be asked at any point, so that strength is known anywhere along a rod and not only at its vertices.
    """

    def __init__(self, along: float, across: float, generator: np.random.Generator) -> None:
        """Draw a field with the correlation lengths `along` the grain and `across` it [m]."""
        scale = np.array([along, across, across])
        self._waves = generator.normal(size=(3, _WAVES)) / scale[:, None]
        self._phases = generator.uniform(0, 2 * np.pi, _WAVES)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the field (...) at points (..., 3) [m] of the straight bundle."""
        found: np.ndarray = np.sqrt(2 / _WAVES) * np.cos(points @ self._waves + self._phases).sum(-1)
        return found

    def factor(self, points: np.ndarray, variation: float) -> np.ndarray:
        """Return a positive factor (...) of mean 1 and relative deviation about `variation`."""
        if variation == 0:
            return np.ones(points.shape[:-1])
        return np.exp(variation * self(points) - variation**2 / 2)

    def strength(self, points: np.ndarray, variation: float) -> np.ndarray:
        """Return a positive factor (...) of mean 1 and relative deviation `variation`, distributed after Weibull.

        The least of a rod's strengths falls with its length, as a chain's by its links (Weibull 1939): n correlation
        lengths bear n^(-1 / m) of what one does, m the modulus.
        """
        if variation < _EVEN:
            return np.ones(points.shape[:-1])
        m = weibull_modulus(variation)
        found: np.ndarray = (-log_ndtr(-self(points))) ** (1 / m) / gamma(1 + 1 / m)
        return found


def ringed(grain: Grain, points: np.ndarray, wide: np.ndarray | float) -> np.ndarray:
    """Return the stiffness (n,) of wood at points (n, 2) [m] of the section over the mean: late wood has more.

    It is the mean over `wide` [m] to both sides of the distance to the pith: rods that are wider than a ring do not see
    it. A ring ends with its late wood.
    """
    if grain.rings == 0:
        return np.ones(len(points))
    away = np.linalg.norm(points - np.array(grain.pith), axis=1) / grain.rings
    half = np.maximum(np.asarray(wide) / grain.rings, 1e-9)

    def before(x: np.ndarray) -> np.ndarray:
        # late wood between the pith and x rings from it; before the pith there is none
        whole = np.floor(np.maximum(x, 0.0))
        found: np.ndarray = grain.late * whole + np.maximum(np.maximum(x, 0.0) - whole - (1 - grain.late), 0.0)
        return found

    low, high = np.maximum(away - half, 0.0), away + half
    late = (before(high) - before(low)) / (high - low)
    found: np.ndarray = (1 + (grain.contrast - 1) * late) / (1 + (grain.contrast - 1) * grain.late)
    return found


def rayed(grain: Grain, points: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Return what bonds at points (n, 2) [m] of the section bear over others, as `way` (n, 2) they join rods.

    A crack along a ray parts what is joined around the pith. It bears 1 - `rays` of one that follows a ring.
    """
    out = points - np.array(grain.pith)
    size = np.linalg.norm(out, axis=1) * np.linalg.norm(way, axis=1)
    around = (out[:, 0] * way[:, 1] - out[:, 1] * way[:, 0]) / np.maximum(size, 1e-300)
    found: np.ndarray = 1 - grain.rays * around**2
    return found


@lru_cache
def weibull_modulus(variation: float) -> float:
    """Return the modulus m of a Weibull distribution with this deviation over its mean, above 0."""

    def over(m: float) -> float:
        return float(gamma(1 + 2 / m) / gamma(1 + 1 / m) ** 2 - 1 - variation**2)

    return float(brentq(over, 1.0, 2 / variation + 2))
