"""A surface from elsewhere, relaxed: put on the mesh of a fruit and let go until forces balance, pattern and all.

A looked-up shape is near many equilibria and on none. Its surface is pushed on in a few increments, the inside
following with the cube of its depth and settling after each; then it is held until the inside has come to rest, and all
is free. Rest volumes stay until then: next to incompressible flesh answers a surface that is off by a thousandth with
pressures that no fruit has. The pattern stays, the residual falls a hundredfold in some hundred steps: what a run needs
many thousands for.

What is slow then is the skin: scaled by its thickness, its mass is large beside what holds a wrinkle back. Damping that
calms the inside would hold it for thousands of steps, so that it is taken away by and by. Rest volumes stay as they
are from there on: under light damping, volumes that follow the pressure feed what rings. Where they lag by more than
forces may be off, all is calmed once more.
"""

from __future__ import annotations

import time

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..arrays import Floats, Singles
from ..contract import Context, InvalidInput, Need, Unstable
from ..geometry.apart import Topology, put_apart
from ..geometry.crossings import split_quads
from .fresh.loading import Loading
from .kernel import new_state, place, positions
from .measures.descriptors import SMOOTH, Surface
from .motion import Motion
from .params import DehydrationParams
from .run import Record
from .settings import choose
from .settle import State, lagging

__all__ = ["RESIDUAL", "on_columns", "relax"]

Fixed = NDArray[np.int32]

#: Residual at which a relaxed shape counts as an equilibrium.
RESIDUAL = 5e-3
#: Increments in which a surface is pushed on, more where what they push blows up (plum 1 at s = 0.3, where folds are
#: deep); steps of the inside in each, and their damping.
_INCREMENTS, _STEPS, _DAMPING = (5, 15, 45), 20, 0.2
#: Then it is held, in turns under these dampings, the last again and again, until a turn moves nodes by less [te, rms],
#: or after so many turns. What is slow there is flesh on its way along a long fruit, which a damping of .2 holds back
#: for thousands of steps: let go before, its pressures pushed raisins (te = 0.0093, gamma = 7, s = 0.2) out of shape by
#: a seventh of what their wrinkles are high, and more. Spheres are at rest after 150 to 300 steps, raisins after 500.
_HOLDING, _STILL, _TURNS = (0.05, 0.05, 0.02), 0.02, 30
#: Damping of the turns in which what was pushed on is calmed, volumes following, and the steps of each.
_CALMING, _TURN = (0.12, 0.12, 0.12, 0.12, 0.06, 0.06), 50
#: Likewise once forces are within so many times the wanted residual: sooner, what has moved is little; later, what was
#: balanced by then is thrown back as far (at 2.0 a fruit took 200 to 300 steps more). What slid far, so that volumes
#: lag when forces balance, is calmed as at first: as briefly, or while it rings, it would be thrown back for ever.
_PRESSING, _NEAR = (0.12, 0.12, 0.12), 5.0
#: Damping of what follows: of what rings; of what is left to move once that is calm and the residual within so many
#: times the wanted one; and of shapes that still slide after so many steps. Then the steps between two looks at the
#: residual.
_FREE_DAMPING, _CALM_DAMPING, _CALM, _SLIDING_DAMPING, _PATIENCE, _LOOK = 0.02, 0.01, 2.0, 0.004, 1500, 100
#: Most steps of all; a shape that has no residual of `RESIDUAL` then says so.
_MOST = 4000
#: Levels of the mesh below the surface that move with it as they are: those of the skin.
_SKIN = 3


def relax(
    params: DehydrationParams,
    position: Floats,
    stage: float,
    need: Need,
    context: Context,
    steps: int | None = None,
) -> xr.Dataset:
    """Return what `run` returns of one stage for the equilibrium next to a surface `position` (n, 2n, 3); `moved`, how
    far relaxing moved it, rms of the radial motion over its roughness; and `residual_placed`, what it began with.

    The fresh fruit has the bumps and the pattern that a run begins with, whose shapes are no equilibria without. It
    ends when in balance, or after about so many `steps`.

    Raises:
        InvalidInput: a stage at which the driest flesh would be gone, a surface that is not on a lattice, or a pattern
            that is not there.
        Unstable: the state left the finite.
        Cancelled: the observer asked to stop.

    """
    begin = time.perf_counter()
    if position.ndim != 3 or position.shape[1:] != (2 * len(position), 3):
        raise InvalidInput(f"{position.shape} is no lattice (n, 2n, 3).", advice="Give the position of a look-up.")
    Loading(params).check(stage)
    settings = choose(params, need.quality, stage)
    motion = Motion(params, settings, context)
    sector = motion.sector
    target = on_columns(np.asarray(position, np.float64), motion.mesh.sphere.directions)
    put_apart(target, Topology.of(split_quads(motion.mesh.sphere.quads), len(target)))
    most = steps or _MOST
    state, rest, (placed, began), (residual, drift) = _put_on_and_balanced(
        motion, target[sector.own], stage, most, context
    )
    energy, least = motion.strained(state, rest, stage, "strain_energy" in need.fields)
    if least <= 0:
        raise Unstable("elements turned inside out.", advice="Run it from the start.", residual=residual)
    whole = sector.whole(motion.surface(state))
    way = drift / params.exocarp_thickness
    found = State(whole, stage, residual, way, motion.steps, least, energy, rest)
    record = Record(params, need, motion.mesh, begin)
    record.add(found, residual <= RESIDUAL)
    attrs = {"path": "relaxed", "elements": motion.elements, "residual_limit": RESIDUAL, "unit_of_length": "r1"}
    result = record.dataset({**attrs, "kappa_over_mu": settings.kappa_ratio})
    result["moved"] = ("stage", [_moved(Surface(params, motion.mesh), placed, whole)])
    result["residual_placed"] = ("stage", [began])
    return result


def _balance(
    motion: Motion, state: Fixed, velocity: Singles, rest: Floats, stage: float, most: int, context: Context
) -> tuple[Floats, float, float]:
    """Let a state go until forces balance, `most` steps in all; return rest volumes, the residual, lag of the volumes
    included, and the drift [r1] of the surface in 200 steps. State and velocity change in place.
    """
    for calming in _CALMING:
        rest = motion.advance(state, velocity, rest, _TURN, stage, stage, calming)
    force, lag, drift, is_pressed, damping = np.inf, np.inf, np.inf, False, _FREE_DAMPING
    # however few steps are left, it is looked at once
    while (motion.steps < most or np.isinf(force)) and max(force, lag) > RESIDUAL:
        # what has moved since has other pressures
        if force <= (1.0 if is_pressed else _NEAR) * RESIDUAL:
            for pressing in _CALMING if is_pressed else _PRESSING:
                rest = motion.advance(state, velocity, rest, _TURN, stage, stage, pressing)
            is_pressed = True
        before = motion.surface(state)
        if motion.steps >= _PATIENCE:
            damping = _SLIDING_DAMPING
        motion.run(state, velocity, rest, _LOOK, stage, stage, damping)
        force = motion.residual(state, rest, stage, damping)
        lag = lagging(motion.rests(state, rest, stage) / rest)
        drift = 200 / _LOOK * float(np.sqrt(np.square(motion.surface(state) - before).sum(axis=1).mean()))
        if is_pressed and force <= _CALM * RESIDUAL:
            damping = _CALM_DAMPING
        context.report(motion.steps / most, f"residual {max(force, lag):.1e}")
    return rest, max(force, lag), drift


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


def _put_on_and_balanced(
    motion: Motion, target: Floats, stage: float, most: int, context: Context
) -> tuple[Fixed, Floats, tuple[Floats, float], tuple[float, float]]:
    """Put the surface nodes of the part on `target` (nc, 3), in as few increments as hold, and let all go.

    Returns the state, its rest volumes, the whole surface and the residual it began with, the last residual and drift.
    """
    masses = motion.masses
    for increments in _INCREMENTS:
        context.report(0.0, f"put on in {increments} increments, and held until its inside is at rest")
        try:
            state, velocity, rest = _put_on(motion, target, stage, increments)
            begun = motion.sector.whole(motion.surface(state)), motion.residual(state, rest, stage, _FREE_DAMPING)
            rest, *found = _balance(motion, state, velocity, rest, stage, most, context)
        except Unstable:
            if increments == _INCREMENTS[-1]:
                raise
            motion.masses, motion.steps = masses, 0
        else:
            return state, rest, begun, (found[0], found[1])
    raise AssertionError("unreachable")


def _put_on(motion: Motion, target: Floats, stage: float, increments: int) -> tuple[Fixed, Singles, Floats]:
    """Return state, velocity and rest volumes with the surface nodes of the part at `target` (nc, 3), at rest.

    Raises:
        Unstable: what was pushed left the finite.

    """
    mesh = motion.sector.mesh
    smooth = motion.drive.smooth(stage)
    columns = smooth.reshape(len(mesh.rays), mesh.levels, 3)
    state, velocity = new_state(motion.layout, smooth)
    distance = np.linalg.norm(columns, axis=-1)
    share = ((distance - distance[:, :1]) / (distance[:, -1:] - distance[:, :1])) ** 3
    share[:, mesh.levels - _SKIN :] = 1.0
    way = (target - columns[:, -1])[:, None] / increments * share[..., None]
    step = np.zeros_like(state)
    place(step, way.reshape(-1, 3))
    for _ in range(increments):
        state += step
        motion.settle_inside(state, velocity, motion.rest, _STEPS, stage, _DAMPING)
    _hold(motion, state, velocity, stage)
    velocity[:] = 0
    return state, velocity, motion.rest


def _hold(motion: Motion, state: Fixed, velocity: Singles, stage: float) -> None:
    """Let the inside come to rest under a surface that stays. State and velocity change in place."""
    for turn in range(_TURNS):
        before = positions(state)
        damping = _HOLDING[min(turn, len(_HOLDING) - 1)]
        motion.settle_inside(state, velocity, motion.rest, _TURN, stage, damping)
        way = float(np.sqrt(np.square(positions(state) - before).sum(axis=1).mean()))
        if way <= _STILL * motion.params.exocarp_thickness:
            return


def _moved(surface: Surface, before: Floats, after: Floats) -> float:
    """Return the rms of the nodes' radial motion over what their wrinkles are high: not over how far a fruit is from a
    sphere, which of a raisin is thirteen times as much at s = 0.2.
    """
    way = np.linalg.norm(after, axis=1) - np.linalg.norm(before, axis=1)
    return float(np.std(way) / max(surface.roughness(before), SMOOTH))
