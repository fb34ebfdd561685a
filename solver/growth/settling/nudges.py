"""What takes a perfect shape off its symmetry, in the body's own axes: turning the shape turns what comes out."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...contract import Context
from ...shell.normals import normals
from .energy import StepEnergy

__all__ = ["across", "nudged"]

#: Waves that nudge a perfect shape: height over the thickness, and waves over the shape's width.
_NUDGE, _WAVES = 0.2, (1, 2, 4)


def across(energy: StepEnergy, x: Floats, seed: int) -> Floats:
    """Return a way (n, 3) along the normals at x (n, 3), by a number per vertex from the seed; 0 where it is held."""
    found: Floats = Context.generator(seed).normal(size=len(x))[:, None] * normals(x, energy.state.mesh.triangles)
    return np.where(energy.free, found, 0.0)


def nudged(energy: StepEnergy, x: Floats, least: float, seed: int) -> Floats:
    """Return x with small waves if that lowers the energy, else x itself.

    A perfect shape sits on its symmetry, in balance but not at rest: only so it finds the way out.
    """
    found, generator = x, Context.generator(seed)
    normal = np.where(energy.free, normals(x, energy.state.mesh.triangles), 0.0)
    own = _own(x, generator)
    for waves in _WAVES:
        ways = generator.normal(size=(16, 3)) * (2 * np.pi * waves / float(np.ptp(own, axis=0).max()))
        height = np.cos(own @ ways.T + generator.uniform(0, 2 * np.pi, 16)).sum(axis=1) / 4
        way = (_NUDGE * energy.material.thickness * height)[:, None] * normal
        trial = x + energy.allowed(x, way, 1.0) * way
        value = energy(trial)[0]
        if value < least:
            found, least = trial, value
    return found


def _own(x: Floats, generator: np.random.Generator) -> Floats:
    """Return x (n, 3) in axes of the body: two sums over its vertices, by numbers of the generator, lay them.

    Principal axes would not do: those of a sphere, or of any shape with a symmetry of three or more turns, are none.
    """
    arms = x - x.mean(axis=0)
    first, second = generator.normal(size=(2, len(x))) @ arms
    a = first / np.linalg.norm(first)
    b = second - (second @ a) * a
    b /= np.linalg.norm(b)
    found: Floats = arms @ np.stack([a, b, np.cross(a, b)], axis=1)
    return found
