"""Where the tangent of the smooth state turns singular, parity by parity of the fruit's symmetry planes.

Every mode of a fruit with symmetry planes is even or odd about each of them (or can be taken so); each combination is
an independent problem on the same part of the mesh with other supports on the planes.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_array
from scipy.sparse.linalg import LinearOperator, eigsh

from ...arrays import Bools, Floats
from ...linalg.multifrontal import Factor
from .hexahedron import PRESSURE, SHAPE_GRADIENTS, WEIGHTS
from .newton import Equilibrium, Model, masked

__all__ = ["Crossing", "first_crossing", "fresh_metric", "parities", "stress_stiffness", "tangent_at"]


LANCZOS_TOLERANCE = 1e-5


class Crossing(NamedTuple):
    """s at which base + (s - start) * slope turns singular, and the mode, (nf, 3) on the nodes off the stone."""

    shrinkage: float
    mode: Floats
    parity: tuple[int, ...]


def parities(model: Model) -> Iterator[tuple[tuple[int, ...], Bools]]:
    """Yield parity (+1 even, -1 odd) about each of the mesh's planes, and the components (nf, 3) left free by it."""
    mesh = model.mesh
    positions = mesh.positions[model.pattern.free >= 0]
    for parity in itertools.product((1, -1), repeat=len(mesh.planes)):
        free = np.ones(positions.shape, dtype=bool)
        for axis, sign in zip(mesh.planes, parity, strict=True):
            normal = np.arange(3) == axis
            free &= (positions[:, axis] != 0)[:, None] | (~normal if sign > 0 else normal)
        yield parity, free


def tangent_at(model: Model, state: Equilibrium) -> Floats:
    """Return the tangent at an equilibrium, (nnz, 3, 3), without supports on the planes."""
    return model.sweep(state.deformed, model.stretch(state.shrinkage), state.pressure).data


def fresh_metric(model: Model) -> Floats:
    """Return what stiffnesses are compared with: the fresh tangent with kappa = mu, (nnz, 3, 3)."""
    soft, still = (
        dataclasses.replace(model, kappa=model.mu),
        np.zeros((len(model.mesh.connectivity), PRESSURE.shape[1])),
    )
    return soft.sweep(model.mesh.positions, model.stretch(0.0), still).data


def stress_stiffness(model: Model, state: Equilibrium) -> Floats:
    """Return int (dN_a . sigma dN_b) I for the stress of a small state, over the fresh shape, (nnz, 3, 3)."""
    mesh, pattern = model.mesh, model.pattern
    stretch = model.stretch(state.shrinkage)
    data = np.zeros((len(pattern.indices), 3, 3))
    for first in range(0, len(mesh.connectivity), 256):
        part = slice(first, first + 256)
        nodes = mesh.connectivity[part]
        jacobian = np.einsum("eai,qak->eqik", mesh.positions[nodes], SHAPE_GRADIENTS)
        gradient = np.matmul(SHAPE_GRADIENTS, np.linalg.inv(jacobian))
        weight = np.linalg.det(jacobian) * WEIGHTS
        strain = np.einsum("eai,eqak->eqik", state.deformed[nodes] - mesh.positions[nodes], gradient)
        strain = (strain + strain.swapaxes(-1, -2)) / 2 - (stretch[part] - 1)[..., None] * np.eye(3)
        mean = np.trace(strain, axis1=-2, axis2=-1) / 3
        pressure = state.pressure[part] @ PRESSURE.T
        spherical = pressure - 2 * model.mu[part, None] * mean
        stress = 2 * model.mu[part, None, None, None] * strain + spherical[..., None, None] * np.eye(3)
        pulled = weight[..., None, None] * np.matmul(gradient, stress)
        element = np.matmul(
            pulled.swapaxes(1, 2).reshape(len(nodes), 27, 81),
            gradient.transpose(0, 1, 3, 2).reshape(len(nodes), 81, 27),
        )
        blocks = pattern.blocks[part]
        inside = blocks >= 0
        totals = np.bincount(blocks[inside], weights=element[inside], minlength=len(data))
        for i in range(3):
            data[:, i, i] += totals
    return data


def first_crossing(
    model: Model, base: Floats, slope: Floats, start: float, parity: tuple[int, ...], free: Bools,
    factor: Factor | None = None, guess: Floats | None = None, watch: Callable[[], None] = lambda: None,
) -> Crossing | None:  # fmt: skip
    """Return the first singular tangent of base + (s - start) slope beyond `start` in one parity, by Lanczos.

    base, slope: (nnz, 3, 3), base positive definite in this parity (its `factor` may be given). None if the slope
    softens no mode. The largest mu of -slope v = mu base v gives s = start + 1 / mu. `watch` is called before each
    product and may end the search.
    """
    pattern = model.pattern
    factor = factor or model.factor(base, free, watch)
    size = free.size

    def sparse(data: Floats) -> bsr_array:
        return bsr_array((masked(pattern, data, free), pattern.indices, pattern.indptr), shape=(size, size))

    stiff, softening = sparse(base), -sparse(slope)
    loose = free.ravel().astype(float)
    # the identity that stands on held components must not compete: project it out

    def soften(v: Floats) -> Floats:
        watch()
        softened: Floats = loose * (softening @ (loose * v.ravel()))
        return softened

    operator = LinearOperator((size, size), matvec=soften, dtype=float)
    inverse = LinearOperator((size, size), matvec=lambda v: factor.solve(v.ravel()), dtype=float)
    begin = guess.ravel() if guess is not None else np.random.default_rng(0).normal(size=size)
    values, vectors = eigsh(
        operator, k=1, M=stiff, Minv=inverse, which="LA", v0=loose * begin, tol=LANCZOS_TOLERANCE, ncv=24
    )
    if values[0] <= 0:
        return None
    return Crossing(start + 1 / float(values[0]), vectors[:, 0].reshape(-1, 3), parity)
