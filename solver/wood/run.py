"""A wood run: lay the bundle, choose a step, march or settle, and keep what is needed of each stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from ..contract import Context, Need, SolverError, Unstable
from ..meshes import Frame, changing
from .contact.listing import law
from .fibres.hewing import hewn
from .fracture import sawed
from .loads import MADE, READ, measured
from .model.bundle import lay
from .model.state import State, Wood
from .params import WoodParams
from .pieces import pieces
from .settings import choose
from .stepping.marching import explicit
from .stepping.moment import Reached
from .stepping.speeds import few_enough, slow_enough
from .stepping.stability import longest_step, touchable
from .stresses import BOND, ROD, Stresses
from .surface.skin import Skin
from .surface.solids import among, shown
from .told import idle, settled, whole

__all__ = ["run"]

#: Energy that may be missing from the balance of a sound stage, over the largest energy of the run.
_BALANCE = {"preview": 0.05, "default": 0.01, "fine": 0.003}
_MESH = frozenset({"mesh_position", "inside", "body"})
_PIECES = frozenset({"fragments", "fragment_mass", "fragment_place", "fragment_length"})


def run(params: WoodParams, need: Need, context: Context) -> xr.Dataset:
    """Return energies, counts and centre lines at the wanted times; see `solver.quantities` for units.

    Where the run blows up, it begins again with steps half as long, unless its step was given.

    Raises:
        InvalidInput: the need names a part of a fruit's surface, something is past the wood between two
            steps, or these would be too many.
        Unstable: the run blew up, with half the step as well; carries the stages before.
        NotConverged: an equilibrium was not found; carries the stages before.
        Cancelled: the observer asked to stop.

    """
    whole(need)
    begun = time.perf_counter()
    # two threads take twice as long for fronts of some hundreds, and round otherwise: the net's shares as well as steps
    with threadpool_limits(1, user_api="blas"):
        try:
            return _run(params, need, context, begun)
        except Unstable as error:
            if params.step:
                raise
            blown = error
        said = f"{blown.message.rstrip('.')}: begun again with steps half as long"
        context.report(0.0, said)
        try:
            return _run(params, need, context, begun, 0.5, said)
        except Unstable as again:
            if (again.last_stage or 0.0) < (blown.last_stage or 0.0):
                again.partial, again.last_stage = blown.partial, blown.last_stage
            raise


def _run(
    params: WoodParams, need: Need, context: Context, begun: float, shorter: float = 1.0, blown: str = ""
) -> xr.Dataset:
    """Run with steps `shorter` by a factor; begun: when all of it began; blown: what became of a run before, to be
    told.
    """
    settings = choose(params, need.quality)
    params, said, notes = settled(params, settings.vertices)
    context.report(0.0, "; ".join(notes) or "laying the bundle")
    wood = hewn(lay(params, settings.vertices), params)
    missed = idle(wood, params)
    if missed:
        context.report(0.0, "; ".join(missed))
    told = "; ".join([*notes, *missed, *([blown] if blown else [])])
    attrs = _said(wood, params, said | ({"note": told} if told else {}))
    skin = None if _MESH.isdisjoint(need.fields) else Skin(wood, params)
    strained = Stresses(params, wood, need)
    laid, wood = wood, sawed(wood)
    frames: list[Frame] = []
    balance = _BALANCE[need.quality]
    marching: Iterator[Reached]
    if params.mode == "explicit":
        contact = float(law(wood, params)[1]) if params.touching else 0.0
        longest = longest_step(wood, contact)
        dt = min(shorter * settings.courant * longest, params.step or np.inf)
        few_enough(dt, need.stages[-1], params.step)
        slow_enough(params, dt, params.length / (settings.vertices - 1))
        wood = touchable(wood, dt, contact)
        attrs |= {"step": dt, "longest_stable_step": longest}
        marching = explicit(wood, params, need.stages, dt, balance, context, shorter * settings.courant)
    else:
        from .stepping.static import static

        marching = static(wood, params, need.stages, context)
    rows: list[dict[str, Any]] = []
    try:
        for reached in marching:
            if skin is not None:
                frames.append(among(skin.frame(reached.state.wood), params, reached.time, reached.state.scratch.poses))
            rows.append(_row(reached, laid, params, need, time.perf_counter() - begun))
            rows[-1] |= strained.read(reached.state)
            context.report(reached.time / max(need.stages[-1], 1e-300), f"t = {reached.time:.4g} s settled")
    except SolverError as error:
        if rows:
            error.partial = _dataset(rows, frames, wood, params, need, attrs)
            error.last_stage = rows[-1]["stage"]
        raise
    return _dataset(rows, frames, wood, params, need, attrs)


def _said(wood: Wood, params: WoodParams, said: dict[str, Any]) -> dict[str, Any]:
    """Return what the result says of itself."""
    middle = (wood.motion.x.min(0) + wood.motion.x.max(0)) / 2
    return {
        "path": params.mode,
        "mass_scaling": params.mass_scaling,
        **said,
        "rods": len(np.unique(wood.rod[wood.rods.k > 0])),
        "vertices": wood.grid.shape[1],
        "bonds": len(wood.bonds.i),
        "metres_per_unit": 1.0,
        "up": "z",
        # what a picture should show, middle and radius: fragments fly far
        "view": [*middle, shown(params, middle)],
    }


def _turned(state: State) -> np.ndarray:
    """Return the rotation vectors (r, 3) [radian] of bodies, no longer than half a turn."""
    frames = state.scratch.poses.frame
    return np.asarray(Rotation.from_matrix(frames).as_rotvec()) if len(frames) else np.zeros((0, 3))


def _row(reached: Reached, laid: Wood, params: WoodParams, need: Need, seconds: float) -> dict[str, Any]:
    """Return what is wanted of a stage."""
    state = reached.state
    wood = state.wood
    moving, elastic, lost, work, _ = reached.energy
    ends = wood.grid[:, -1]
    weight = wood.rods.radius[np.searchsorted(wood.rod, np.arange(len(wood.grid)))] ** 2
    # fibres may run out of the wood before its end
    weight = np.where(np.isin(ends, laid.rods.b[laid.rods.k > 0]), weight, 0.0)
    found: dict[str, Any] = {
        "kinetic_energy": moving,
        "elastic_energy": elastic,
        "lost_energy": lost,
        "work": work,
        "broken_rods": state.rods,
        "broken_bonds": state.bonds,
        "impulse": state.impulse[:, :3].sum(0),
        "fracture_energy": state.spent,
        "crushing_energy": state.crushed,
        "crack_area": float(wood.bonds.area @ wood.bonds.parted),
        "body_impulse": state.impulse[:, :3].copy(),
        "body_moment": state.impulse[:, 3:].copy(),
        "body_place": state.scratch.poses.pivot.copy(),
        "body_turn": _turned(state),
        "body_velocity": state.scratch.poses.speed.copy(),
        "body_spin": state.scratch.poses.spin.copy(),
        "grip_impulse": state.gripped[:, :3].copy(),
        "grip_moment": state.gripped[:, 3:].copy(),
        "tip_position": weight @ wood.motion.x[ends] / weight.sum(),
    }
    real = laid.rods.k > 0
    if "rod_position" in need.fields:
        ends = np.stack([wood.rods.a[real], wood.rods.b[real]], 1)
        found["rod_position"] = wood.motion.x[ends].astype(need.dtype)
    if "rod_cut" in need.fields:
        found["rod_cut"] = wood.cut[real].astype(need.dtype)
    if not _PIECES.isdisjoint(need.fields):
        found |= pieces(wood, params)
    # what readings are made of goes when it has been read
    wanted = {*need.fields, *(MADE[name] for name in need.fields if name in MADE)}
    return {
        "stage": reached.time,
        "residual": reached.error,
        "converged": reached.sound,
        "iterations": state.steps,
        "seconds": seconds,
        **{name: value for name, value in found.items() if name in wanted},
    }


def _dataset(
    rows: list[dict[str, Any]],
    frames: list[Frame],
    wood: Wood,
    params: WoodParams,
    need: Need,
    attrs: dict[str, Any],
) -> xr.Dataset:
    dims = {
        "impulse": ("stage", "component"),
        "body_impulse": ("stage", "obstacle", "component"),
        "body_moment": ("stage", "obstacle", "component"),
        **dict.fromkeys(("body_place", "body_turn", "body_velocity", "body_spin"), ("stage", "obstacle", "component")),
        "grip_impulse": ("stage", "grip", "component"),
        "grip_moment": ("stage", "grip", "component"),
        **dict.fromkeys(("body_force", "body_torque", "body_shift"), ("stage", "obstacle", "component")),
        **dict.fromkeys(("grip_force", "grip_torque", "grip_shift", "grip_turn"), ("stage", "grip", "component")),
        "fragment_mass": ("stage", "fragment"),
        "fragment_place": ("stage", "fragment", "component"),
        "fragment_length": ("stage", "fragment"),
        "tip_position": ("stage", "component"),
        "rod_position": ("stage", "rod_edge", "end", "component"),
        **dict.fromkeys(("rod_cut", *ROD), ("stage", "rod_edge")),
        **dict.fromkeys(BOND, ("stage", "bond")),
        "bond_position": ("stage", "bond", "component"),
    }
    data: dict[str, Any] = {}
    for name in READ:
        if name in need.fields:
            data[name] = (dims[name], measured(name, rows, params))
    for name in rows[0]:
        if name in MADE.values() and name not in need.fields:
            continue
        values = np.array([row[name] for row in rows])
        if name != "stage":
            data[name] = (dims.get(name, ("stage",)), values.astype(np.int8) if name == "converged" else values)
    if frames:
        bare = [
            f._replace(fields={name: value for name, value in f.fields.items() if name in need.fields})
            for f in frames[: len(rows)]
        ]
        meshes = changing(bare, need.dtype)
        data |= {name: value for name, value in meshes.items() if name not in _MESH or name in need.fields}
    coords: dict[str, Any] = {"stage": np.array([row["stage"] for row in rows])}
    if any("component" in entry[0] for entry in data.values()):
        coords["component"] = ["x", "y", "z"]
    if any("rod_edge" in entry[0] for entry in data.values()):
        coords["rod"] = ("rod_edge", wood.rod[wood.rods.k > 0])
    return xr.Dataset(data, coords, attrs)
