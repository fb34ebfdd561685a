"""A growth run: reach the wanted growth times and keep what is needed of each."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from .. import shell
from ..contract import Context, InvalidInput, Need, SolverError
from ..geometry.crossings import crossings
from ..linalg import definite
from ..meshes import Frame, changing
from .engine import Engine
from .looks import CHANNELS
from .own.textured import named, textured
from .params import GrowthParams
from .settings import choose
from .settling.energy import elastic
from .settling.stage import residual
from .shown import shown
from .state import State
from .told import check_near, note

__all__ = ["run"]

_MESH = frozenset({"mesh_position", "elastic_strain", "sheet_thickness", *CHANNELS})


def run(params: GrowthParams, need: Need, context: Context) -> xr.Dataset:
    """Return meshes and numbers of the wanted growth times; see `solver.quantities` for units.

    `crossings` is always among them, counted on positions as they are handed over. Where parts pass through each other,
    as they may with contact = 0, `note` says so, beside what was known before (`told`).

    Raises:
        InvalidInput: a region, which a mesh of its own has not, or a factor that is not installed.
        InvalidGeometry: a mesh too far from the origin for the precision of its positions.
        NotConverged, Unstable: with the stages before.
        Cancelled: the observer asked to stop.

    """
    if need.region is not None:
        raise InvalidInput("growth has no lattice to cut a region from.", advice="Ask without a region.")
    definite.chosen()
    check_near(params, need.dtype)
    # sums in BLAS depend on the number of threads, and buckling makes much of little
    with threadpool_limits(1, user_api="blas"):
        return _run(params, need, context)


def _run(params: GrowthParams, need: Need, context: Context) -> xr.Dataset:
    settings = choose(need.quality)
    begun = time.perf_counter()
    engine = Engine(params, settings.vertices, settings.tolerance, history=False)
    rows: list[dict[str, Any]] = []
    frames: list[Frame] = []
    states: list[State] = []
    try:
        for stage in need.stages:
            state = engine.reach(stage, context)
            rows.append(_row(state, params, need, settings.tolerance, stage, time.perf_counter() - begun))
            if _MESH & set(need.fields):
                fields = shown(state, params, need.fields)
                states.append(state)
                frames.append(Frame(state.x, state.mesh.triangles, fields))
            context.report(stage / max(need.stages[-1], 1e-9), f"growth time {stage:g} settled")
    except SolverError as error:
        error.partial = _dataset(rows, frames, states, need, params) if rows else None
        error.last_stage = rows[-1]["stage"] if rows else None
        raise
    return _dataset(rows, frames, states, need, params)


def _row(
    state: State, params: GrowthParams, need: Need, tolerance: float, stage: float, seconds: float
) -> dict[str, Any]:
    material = shell.Material(params.thickness, params.poisson)
    left = residual(state, params)
    row: dict[str, Any] = {
        "stage": stage,
        "converged": left <= tolerance and state.minimum,
        "residual": left,
        "iterations": state.iterations,
        "seconds": seconds,
        "crossings": crossings(state.x.astype(need.dtype), state.mesh.triangles).count,
    }
    if "rest_area" in need.fields:
        row["rest_area"] = float(shell.areas(state.g).sum())
    if "mesh_area" in need.fields:
        row["mesh_area"] = float(shell.areas(shell.metric(state.x, state.mesh.triangles)).sum())
    if "stored_energy" in need.fields:
        row["stored_energy"] = elastic(state, material, params.bending)
    return row


def _dataset(
    rows: list[dict[str, Any]], frames: list[Frame], states: list[State], need: Need, params: GrowthParams
) -> xr.Dataset:
    data: dict[str, Any] = {}
    for name in rows[0]:
        values = np.array([row[name] for row in rows])
        if name != "stage":
            data[name] = ("stage", values.astype(np.int8) if name == "converged" else values)
    coords: dict[str, Any] = {"stage": np.array([row["stage"] for row in rows])}
    if frames:
        data |= changing(frames[: len(rows)], need.dtype) | textured(states[: len(rows)])
        coords["component"] = ["x", "y", "z"]
    attrs = {"path": params.solver, "factor": definite.chosen(), "up": "z"} | (named(params.mesh) if frames else {})
    said = note(params, need.quality, need.dtype)
    through = [row for row in rows if row["crossings"]]
    if through:
        worst = max(through, key=lambda row: int(row["crossings"]))
        crossed = (
            f"The sheet passes through itself at {len(through)} of {len(rows)} stages, at growth time "
            f"{worst['stage']:g} in {worst['crossings']} pairs of triangles. {_advice(params)}"
        )
        said = f"{said} {crossed}".strip()
    return xr.Dataset(data, coords, attrs | ({"note": said} if said else {}))


def _advice(params: GrowthParams) -> str:
    if params.contact == 0:
        return "With contact = 0 it may: leave `contact` out, and parts keep the thickness apart."
    return "Ask for float64 positions, or for a larger `contact`."
