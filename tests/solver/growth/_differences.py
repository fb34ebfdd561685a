"""Derivatives by differences."""

from collections.abc import Callable

import numpy as np


def differences(
    energy: Callable[[np.ndarray], tuple[float, np.ndarray]], x: np.ndarray, step: float = 1e-6
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first (3n,) and second (3n, 3n) derivatives of an energy at x (n, 3), of values and of gradients."""
    columns, slopes = np.empty((x.size, x.size)), np.empty(x.size)
    for k in range(x.size):
        move = np.zeros(x.size)
        move[k] = step
        move = move.reshape(x.shape)
        columns[:, k] = (energy(x + move)[1] - energy(x - move)[1]).ravel() / (2 * step)
        slopes[k] = (energy(x + move)[0] - energy(x - move)[0]) / (2 * step)
    return slopes, columns
