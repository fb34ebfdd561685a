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
from ...contract import NotConverged
from ...linalg.multifrontal import Factor
from .hexahedron import PRESSURE, SHAPE_GRADIENTS, WEIGHTS
from .newton import Equilibrium, Model

__all__ = [
    "Crossing",
    "Path",
    "Velocity",
    "along",
    "crossing",
    "fresh_metric",
    "moved_on",
    "parities",
    "stress_stiffness",
    "tangent_at",
    "velocity",
]


LANCZOS_TOLERANCE = 1e-3
"""Of the lowest stiffness, relative: a look from 3 % below the onset is off by 3e-5 of it."""
VECTORS, WARM_VECTORS = 20, 10
"""Lanczos vectors from a random start, and from another mesh's mode."""
STEP = 1e-4
"""Shrinkage to both sides of a state over which its tangent is differenced."""


class Crossing(NamedTuple):
    """s at which a tangent turns singular, and the mode, (nf, 3) on the nodes off the stone."""

    shrinkage: float
    mode: Floats
    parity: tuple[int, ...]


class Velocity(NamedTuple):
    """How a smooth state changes with s."""

    tangent: Floats
    """(nnz, 3, 3): what it moves against"""
    moved: Floats
    """(nn, 3)"""
    pressure: Floats
    """(ne, 8)"""
    factor: Factor
    """of the tangent"""


class Path(NamedTuple):
    """A smooth state and where it goes."""

    shrinkage: float
    change: Floats
    """(nnz, 3, 3): derivative by s of the tangent, which has no supports on the planes"""
    metric: Floats
    """(nnz, 3, 3), definite: the mode sought is the softest by it"""
    velocity: Velocity


def parities(model: Model) -> Iterator[tuple[tuple[int, ...], Bools]]:
    """Yield parity (+1 even, -1 odd) about each of the mesh's planes, and the components (nf, 3) left free by it.

    All even comes first. Planes that a patch does not touch are even.
    """
    mesh = model.mesh
    loose = np.repeat(~mesh.cut, mesh.levels - 1)
    positions = mesh.positions[model.pattern.free >= 0]
    signs = [(1, -1) if (positions[loose, axis] == 0).any() else (1,) for axis in mesh.planes]
    for parity in itertools.product(*signs):
        free = np.repeat(loose[:, None], 3, axis=1)
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


def moved_on(state: Equilibrium, velocity: Velocity, shrinkage: float) -> Equilibrium:
    """Return the state at another shrinkage near by, to first order."""
    way = shrinkage - state.shrinkage
    return Equilibrium(shrinkage, state.deformed + way * velocity.moved, state.pressure + way * velocity.pressure)


def velocity(model: Model, state: Equilibrium, lead: Floats, watch: Callable[[], None]) -> Velocity:
    """Return the derivatives of a state by s. lead: (nn, 3) a guess at that of the nodes, right on a patch's edge.

    Raises:
        NotConverged: the tangent is singular.

    """
    low, high = (
        model.sweep(state.deformed + step * lead, model.stretch(state.shrinkage + step)) for step in (-STEP, STEP)
    )
    at = model.sweep(state.deformed, model.stretch(state.shrinkage), state.pressure)
    drift = model.free_part(high.force - low.force).ravel() / (2 * STEP)
    lacked = np.zeros_like(lead)
    try:
        factor = model.factor(at.data, watch=watch)
    except np.linalg.LinAlgError:
        raise NotConverged("the smooth state is singular.", advice="Ask for a finer quality.") from None
    lacked[model.pattern.free >= 0] = factor.solve(-drift).reshape(-1, 3)
    gained = np.matmul(at.gain, lacked[model.mesh.connectivity].reshape(-1, 81, 1))[..., 0]
    return Velocity(at.data, lead + lacked, (high.pressure - low.pressure) / (2 * STEP) + gained, factor)


def along(model: Model, state: Equilibrium, metric: Floats, lead: Floats, watch: Callable[[], None]) -> Path:
    """Return the tangent at a state and its derivative along the states around.

    metric: of the modes (`fresh_metric`). lead: as in `velocity`. The difference is central: the volumetric part of the
    tangent, kappa B^T B with B linear in s, is quadratic, and one-sided differences would add kappa |B'|^2 times
    their step. Raises what `velocity` raises.
    """
    rate = velocity(model, state, lead, watch)
    watch()
    low, high = (tangent_at(model, moved_on(state, rate, state.shrinkage + step)) for step in (-STEP, STEP))
    return Path(state.shrinkage, (high - low) / (2 * STEP), metric, rate)


def crossing(
    model: Model, path: Path, parity: tuple[int, ...], free: Bools, factor: Factor, guess: Floats | None = None,
    watch: Callable[[], None] = lambda: None,
) -> Crossing | None:  # fmt: skip
    """Return where the softest mode of one parity loses its stiffness, by Lanczos and the mode's own line in s.

    factor: of the path's tangent with the supports `free`, positive definite. guess: (nf, 3) a mode from elsewhere.
    None if the mode stiffens along the path. The line through the mode's stiffness and its derivative errs by the
    square of the way to the onset: look from near. `watch` is called before each product and may end the search.
    """
    pattern, loose = model.pattern, free.ravel().astype(float)

    def sparse(data: Floats) -> bsr_array:
        return bsr_array((data, pattern.indices, pattern.indptr), shape=(free.size, free.size))

    stiff, metric = sparse(path.velocity.tangent), sparse(path.metric)

    def measured(v: Floats) -> Floats:
        # the identity that the factor has on held components must not compete: project it out
        watch()
        found: Floats = loose * (metric @ (loose * v.ravel()))
        return found

    def stiffness(v: Floats) -> Floats:
        found: Floats = loose * (stiff @ (loose * v.ravel())) + (1 - loose) * v.ravel()
        return found

    shape = (free.size, free.size)
    begin = np.random.default_rng(0).normal(size=free.size) if guess is None else guess.ravel()
    _, vectors = eigsh(
        LinearOperator(shape, matvec=measured, dtype=float), k=1, which="LA", v0=loose * begin,
        M=LinearOperator(shape, matvec=stiffness, dtype=float),
        Minv=LinearOperator(shape, matvec=lambda v: factor.solve(v.ravel()), dtype=float),
        tol=LANCZOS_TOLERANCE, ncv=VECTORS if guess is None else WARM_VECTORS,
    )  # fmt: skip
    mode = loose * vectors[:, 0]
    softening = float(mode @ (sparse(path.change) @ mode))
    if softening >= 0:
        return None
    return Crossing(path.shrinkage - float(mode @ (stiff @ mode)) / softening, mode.reshape(-1, 3), parity)
