"""Grain: stiffness and strength that vary over the section and along the rods, by a seeded smooth random field."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import gamma, log_ndtr

__all__ = ["Field", "weibull_modulus"]

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


@lru_cache
def weibull_modulus(variation: float) -> float:
    """Return the modulus m of a Weibull distribution with this deviation over its mean, above 0."""

    def over(m: float) -> float:
        return float(gamma(1 + 2 / m) / gamma(1 + 1 / m) ** 2 - 1 - variation**2)

    return float(brentq(over, 1.0, 2 / variation + 2))
