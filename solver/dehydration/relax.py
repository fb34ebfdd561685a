"""A surface from elsewhere, relaxed: put on the mesh of a fruit and let go until forces balance, pattern and all.

A looked-up shape is near many equilibria and on none. Its surface is pushed on in small increments, the inside
following with the cube of its depth and settling after each; then all is free. The pattern stays, the residual falls a
hundredfold in some hundred steps: what a run needs many thousands for.
"""

from __future__ import annotations

import time

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..arrays import Floats
from ..contract import Context, InvalidInput, Need, Unstable
from ..geometry.apart import Topology, put_apart
from ..geometry.crossings import split_quads
from .fresh.loading import Loading
from .kernel import new_state, place
from .motion import Motion
from .params import DehydrationParams
from .run import Record
from .settings import choose
from .settle import State

__all__ = ["RESIDUAL", "on_columns", "relax"]

#: Residual at which a relaxed shape counts as an equilibrium.
RESIDUAL = 5e-3
#: Increments in which a surface is pushed on, steps of the inside after each, and their damping.
_INCREMENTS, _STEPS, _DAMPING = 40, 15, 0.2
#: Steps in which what was pushed on is calmed, the volumes' updates after it, and the steps between looks afterwards.
_CALM, _PRESSINGS, _LOOK = 300, 2, 100
#: Damping while calming, and of what follows.
_CALM_DAMPING, _FREE_DAMPING = 0.06, 0.03
#: Most steps of all; a shape that has no residual of `RESIDUAL` then says so.
_MOST = 4000
#: Levels of the mesh below the surface that move with it as they are: those of the skin.
_SKIN = 3


def relax(params: DehydrationParams, position: Floats, stage: float, need: Need, context: Context) -> xr.Dataset:
    """Return what `run` returns of one stage for the equilibrium next to a surface `position` (n, 2n, 3), and `moved`:
    how far relaxing moved it, rms of the radial motion over its roughness.

    The bumps and the pattern that runs begin with are left out: the surface has its own.

    Raises:
        InvalidInput: a stage at which the driest flesh would be gone, or a surface that is not on a lattice.
        Unstable: the state left the finite.
        Cancelled: the observer asked to stop.

    """
    begin = time.perf_counter()
    if position.ndim != 3 or position.shape[1:] != (2 * len(position), 3):
        raise InvalidInput(f"{position.shape} is no lattice (n, 2n, 3).", advice="Give the position of a look-up.")
    Loading(params).check(stage)
    smooth = params.model_copy(update={"imperfection": 0.0, "pattern": None})
    settings = choose(smooth, need.quality, stage)
    motion = Motion(smooth, settings, context)
    sector = motion.sector
    target = on_columns(np.asarray(position, np.float64), motion.mesh.sphere.directions)
    put_apart(target, Topology.of(split_quads(motion.mesh.sphere.quads), len(target)))
    state, velocity = _put_on(motion, target[sector.own], stage)
    placed = sector.whole(motion.surface(state))
    motion.run(state, velocity, motion.rest, _CALM, stage, stage, _CALM_DAMPING)
    rest, residual = motion.rest, np.inf
    for _ in range(_PRESSINGS):
        rest = motion.advance(state, velocity, rest, _LOOK, stage, stage, 2 * _CALM_DAMPING)
    while motion.steps < _MOST:
        before = motion.surface(state)
        motion.run(state, velocity, rest, _LOOK, stage, stage, _FREE_DAMPING)
        residual = motion.residual(state, rest, stage, _FREE_DAMPING)
        drift = float(np.sqrt(np.square(motion.surface(state) - before).sum(axis=1).mean()))
        context.report(motion.steps / _MOST, f"residual {residual:.1e}")
        if residual <= RESIDUAL:
            break
    report = motion.report(state, rest, stage)
    least = float(report.least_ratio.min())
    if least <= 0:
        raise Unstable("elements turned inside out.", advice="Run it: `exact=run`.", residual=residual)
    whole = sector.whole(motion.surface(state))
    energy = sector.copies * float(report.energy.sum())
    found = State(whole, stage, residual, drift / params.exocarp_thickness, motion.steps, least, energy)
    record = Record(params, need, motion.mesh, begin)
    record.add(found, residual <= RESIDUAL)
    attrs = {"path": "relaxed", "elements": motion.elements, "residual_limit": RESIDUAL, "unit_of_length": "r1"}
    result = record.dataset({**attrs, "kappa_over_mu": settings.kappa_ratio})
    result["moved"] = ("stage", [_moved(placed, whole)])
    return result


def on_columns(position: Floats, directions: Floats) -> Floats:
    """Return a lattice surface (n, 2n, 3) at directions (nc, 3) of the parametric sphere, linear between its points."""
    n = len(position)
    theta = np.arccos(np.clip(directions[:, 1], -1, 1))
    phi = np.arctan2(directions[:, 2], directions[:, 0]) % (2 * np.pi)
    # a row's neighbour across the pole is itself, half a turn on
    lines = np.concatenate([np.roll(position[:1], n, axis=1), position, np.roll(position[-1:], n, axis=1)])
    row, column = theta / np.pi * n + 0.5, phi / np.pi * n
    i, j = np.minimum(row.astype(int), n), column.astype(int)
    a, b = (row - i)[:, None], (column - j)[:, None]
    j, k = j % (2 * n), (j + 1) % (2 * n)
    found: Floats = (1 - a) * ((1 - b) * lines[i, j] + b * lines[i, k])
    found += a * ((1 - b) * lines[i + 1, j] + b * lines[i + 1, k])
    return found


def _put_on(motion: Motion, target: Floats, stage: float) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return state and velocity with the surface nodes of the part at `target` (nc, 3), at rest."""
    mesh = motion.sector.mesh
    smooth = motion.drive.smooth(stage)
    columns = smooth.reshape(len(mesh.rays), mesh.levels, 3)
    state, velocity = new_state(motion.layout, smooth)
    distance = np.linalg.norm(columns, axis=-1)
    share = ((distance - distance[:, :1]) / (distance[:, -1:] - distance[:, :1])) ** 3
    share[:, mesh.levels - _SKIN :] = 1.0
    way = (target - columns[:, -1])[:, None] / _INCREMENTS * share[..., None]
    step = np.zeros_like(state)
    place(step, way.reshape(-1, 3))
    for _ in range(_INCREMENTS):
        state += step
        held = state[mesh.surface_nodes].copy()
        for _ in range(3):
            motion.run(state, velocity, motion.rest, _STEPS // 3, stage, stage, _DAMPING)
            state[mesh.surface_nodes] = held
            velocity[mesh.surface_nodes] = 0
    velocity[:] = 0
    return state, velocity


def _moved(before: Floats, after: Floats) -> float:
    radii = [np.linalg.norm(nodes, axis=1) for nodes in (before, after)]
    first, last = (radius - radius.mean() for radius in radii)
    return float(np.sqrt(np.square(last - first).mean()) / max(float(first.std()), 1e-12))
