"""Grain: stiffness and strength that vary over the section and along the rods, by a seeded smooth random field."""

from __future__ import annotations

import numpy as np

__all__ = ["Field"]

_WAVES = 64


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
