"""Plasticity: strain beyond the yield is forgotten."""

from __future__ import annotations

import numpy as np

from .. import shell
from ..arrays import Floats
from .state import State

__all__ = ["forgotten"]


def forgotten(state: State, k: float, threshold: float) -> Floats:
    """Return rest metrics after plastic flow: principal stretches beyond 1 +- alpha move by k towards that bound."""
    a = shell.metric(state.x, state.mesh.triangles)
    mixed = np.linalg.solve(_matrix(state.g), _matrix(a))
    squares, vectors = np.linalg.eig(mixed)
    stretches = np.sqrt(np.maximum(squares.real, 1e-12))
    vectors = vectors.real
    beyond = stretches / np.clip(stretches, 1 - threshold, 1 + threshold)
    factors = (1 + k * (beyond - 1)) ** 2
    found = _matrix(state.g) @ (vectors * factors[:, None, :]) @ np.linalg.inv(vectors)
    changed = (beyond != 1).any(axis=1)
    g = np.stack([found[:, 0, 0], (found[:, 0, 1] + found[:, 1, 0]) / 2, found[:, 1, 1]], -1)
    return np.where(changed[:, None], g, state.g)


def _matrix(g: Floats) -> Floats:
    return np.stack([g[:, [0, 1]], g[:, [1, 2]]], axis=1)
