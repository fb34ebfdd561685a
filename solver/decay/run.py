"""A decay run: step the organisms that were asked for, and keep what is needed of each stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from ..arrays import Floats
from ..contract import Context, Need, SolverError
from ..fruit import azimuths, colatitudes, window
from .browning import browned
from .cooked import cooked
from .environment import deficit
from .fields.skin import laid
from .fields.stepping import Reached, march
from .fields.system import System
from .names import BESIDE, FIELDS, MOULD, VECTORS, completed
from .params import DecayParams
from .settings import Settings, cells_of, choose, nodes, stepped
from .surfaces.cut import left
from .surfaces.shape import Shape
from .surfaces.surface import sampler
from .told import note
from .within.inner import Held, Inner

__all__ = ["run"]

#: Map value from which a place counts as rotten or mouldy.
_SEEN = 0.1
_ROUND_OFF = 1e-10


def run(params: DecayParams, need: Need, context: Context) -> xr.Dataset:
    """Return maps and shares of the wanted days; see `solver.quantities` for units.

    Raises:
        InvalidInput: the shape is to come from a table that does not hold it.
        Unstable: no step was short enough; carries the stages before.
        NotConverged: the body found no equilibrium; carries the stages before.
        Cancelled: the observer asked to stop.

    """
    # as of growth and wood: sums in BLAS depend on the number of threads, which spin between the small ones of a body
    with threadpool_limits(1, user_api="blas"):
        return _run(params, need, context)


def _run(params: DecayParams, need: Need, context: Context) -> xr.Dataset:
    need = completed(params, need)
    params = _rest(params, need)
    settings = choose(params, need.quality)
    if params.heap is not None:
        return _heap(params, need, settings, context)
    begun = time.perf_counter()
    wanted = set(need.fields)
    attrs: dict[str, Any] = {"vertices": settings.vertices, "vapour_pressure_deficit": float(deficit(params))}
    shape = Shape(params, need, settings)
    shape.check(context)
    rows: list[dict[str, Any]] = []
    followed = set(nodes(params, need))
    days = tuple(sorted(followed | set(need.stages)))
    try:
        if not stepped(params, wanted):
            attrs["path"] = "closed-form"
            for day in days:
                if day in followed:
                    shape.follow(shape.lost(day), None, None, context)
                if day not in need.stages:
                    continue
                row = _row(day, 0, 0.0, True)
                _finish(rows, row, shape, (shape.lost(day), None, None), begun, need, context)
            return _dataset(rows, need, attrs, shape, note(params, rows))
        with_mould = bool(wanted & MOULD)
        context.report(0.0, f"laying {settings.vertices} points on the fruit")
        system = System(params, settings.cells, with_mould, shape.surface, settings.within)
        if system.joint is not None:
            shape.inner = Inner(system.joint, shape.body)
        attrs["path"] = "oven" if params.oven is not None else "rot-and-mould" if with_mould else "rot"
        for reached in _path(system, days, settings, context):
            state = reached.state.water, system.rotten(reached.state.rot), _held(system, reached, shape)
            if reached.day in followed:
                shape.follow(*state, context)
            if reached.day not in need.stages:
                continue
            missing = _missing(system, reached)
            sound = reached.error <= 1 and missing <= _ROUND_OFF
            row = _row(reached.day, reached.steps, reached.error * settings.tolerance, sound)
            if "budget_error" in wanted:
                row["budget_error"] = missing
            row |= _fields(system, reached, need, settings.cells) | _flesh(system, reached, shape.inner, need)
            _finish(rows, row, shape, state, begun, need, context)
    except SolverError as error:
        if rows:
            error.partial = _dataset(rows, need, attrs, shape, note(params, rows))
            error.last_stage = rows[-1]["stage"]
        raise
    return _dataset(rows, need, attrs, shape, note(params, rows))


def _path(system: System, days: tuple[float, ...], settings: Settings, context: Context) -> Iterator[Reached]:
    if system.params.oven is not None:
        return cooked(system, days, context)
    return march(system, days, settings.tolerance, settings.longest, context)


def _rest(params: DecayParams, need: Need) -> DecayParams:
    """Return the parameters of what cuts leave of a fruit, which is a mesh; without cuts those that are given."""
    if not params.cuts:
        return params
    rest = left(laid(params, cells_of(need.quality)), params.cuts)
    return params.model_copy(update={"mesh": rest.mesh, "weight": params.weight * rest.share})


def _heap(params: DecayParams, need: Need, settings: Settings, context: Context) -> xr.Dataset:
    """Return the stages of many fruits as those of one mesh."""
    from .heap.run import HeapRun

    context.report(0.0, "laying the fruits")
    heap = HeapRun(params, need, settings)
    attrs: dict[str, Any] = {"vertices": settings.vertices * len(heap.systems), "path": "heap"}
    attrs["vapour_pressure_deficit"] = float(deficit(params))
    rows: list[dict[str, Any]] = []
    try:
        for row in heap.rows(context):
            rows.append(row)
    except SolverError as error:
        if rows:
            error.partial = _stacked(rows, need, attrs, heap.kept)
            error.last_stage = rows[-1]["stage"]
        raise
    said = note(params, rows)
    return _stacked(rows, need, {**attrs, **({"note": said} if said else {})}, heap.kept)


def _finish(
    rows: list[dict[str, Any]],
    row: dict[str, Any],
    shape: Shape,
    state: tuple[float, Floats | None, Held | None],
    begun: float,
    need: Need,
    context: Context,
) -> None:
    """Add the stage's shape, of the water lost, the rot (v) and what the flesh holds, and seconds to its row."""
    row |= shape.at(*state, context)
    row["seconds"] = time.perf_counter() - begun
    rows.append(row)
    context.report(row["stage"] / max(need.stages[-1], 1e-9), f"day {row['stage']:.2f} settled")


def _row(day: float, steps: int, residual: float, converged: bool) -> dict[str, Any]:
    return {"stage": day, "residual": residual, "converged": converged, "iterations": steps}


def _fields(system: System, reached: Reached, need: Need, cells: int) -> dict[str, Any]:
    """Return maps on the lattice and shares of the area, those that were asked for."""
    surface, wanted = system.surface, set(need.fields)
    rot = system.rotten(reached.state.rot)
    maps = {"rot": rot, "substrate": reached.state.rot.n[: len(rot)], "rot_age": system.age(reached.state, reached.day)}
    found = {"rotten_share": surface.mean(rot >= _SEEN), "mean_rot": surface.mean(rot)}
    if system.mould is not None and reached.state.mould is not None:
        state = reached.state.mould
        mould = system.mould.share(state)
        maps |= {
            "mould": mould,
            "mould_active": np.minimum(state.u / system.mould.rates.theta, 1.0),
            "nutrient": state.n,
        }
        found |= {
            "mouldy_share": surface.mean(mould >= _SEEN),
            "mean_mould": surface.mean(mould),
            "mean_nutrient": surface.mean(state.n),
        }
    row: dict[str, Any] = {name: value for name, value in found.items() if name in wanted}
    if reached.state.roasted is not None:
        maps["roasted"] = reached.state.roasted.brown
        wanted |= {"roasted"} if wanted & {"rot"} else set()
    if wanted & set(maps):
        if system.imported:
            row |= _bared(system, reached.day)
            return row | {name: maps[name].astype(need.dtype) for name in sorted(wanted & set(maps))}
        assert need.resolution is not None  # settled
        inside = window(need.resolution, need.region)
        sample = sampler(cells, need.resolution)
        for name in sorted(wanted & set(maps)):
            field = (sample @ maps[name]).reshape(need.resolution, -1)
            row[name] = field[inside].astype(need.dtype)
    return row


def _bared(system: System, day: float) -> dict[str, Any]:
    """Return where a cut fruit is bare flesh, and how brown that is."""
    if not system.skin.bare.any():
        return {}
    bare = system.skin.bare.astype(float)
    return {"flesh": bare, "browned": bare * browned(system.params, day)}


def _missing(system: System, reached: Reached) -> float:
    """Return the larger of what is missing of the organisms' budgets."""
    layers = zip((system.rot, system.mould), reached.state[:2], strict=True)
    return max(layer.budget_error(grown) for layer, grown in layers if layer is not None and grown is not None)


def _held(system: System, reached: Reached, shape: Shape) -> Held | None:
    """Return what a body that moves holds of flesh that has its own fields."""
    if shape.inner is None or shape.body is None or reached.state.wet is None:
        return None
    return shape.inner.held(system.rot.share(reached.state.rot), reached.state.wet)


def _flesh(system: System, reached: Reached, inner: Inner | None, need: Need) -> dict[str, Any]:
    """Return the wanted fields of the flesh that has its own."""
    wet = reached.state.wet
    if inner is None or wet is None:
        return {}
    # a core neither rots nor feeds, and keeps its water
    fields = {
        "flesh_rot": (system.rot.share(reached.state.rot), 0.0),
        "flesh_nutrient": (reached.state.rot.n, 0.0),
        "flesh_water": (wet, 1.0),
    }
    if reached.state.roasted is not None:
        fields["flesh_temperature"] = (reached.state.roasted.warm, 0.0)
    wanted = {*need.fields, *(("flesh_temperature",) if "flesh_rot" in need.fields else ())}
    return {name: inner.of(*field).astype(need.dtype) for name, field in fields.items() if name in wanted}


def _dataset(rows: list[dict[str, Any]], need: Need, attrs: dict[str, Any], shape: Shape, said: str) -> xr.Dataset:
    assert need.resolution is not None
    attrs = {**attrs, **({"note": said} if said else {})}
    data: dict[str, Any] = {}
    if "triangle" in need.fields:
        data["triangle"] = (("face", "corner"), shape.triangles)
        data |= shape.textured
        attrs = {**attrs, **shape.materials}
    if "flesh_cell" in need.fields and shape.inner is not None:
        data["flesh_cell"] = (("flesh_tetrahedron", "flesh_corner"), shape.inner.cells)
    return _stacked(rows, need, attrs, data)


def _stacked(rows: list[dict[str, Any]], need: Need, attrs: dict[str, Any], data: dict[str, Any]) -> xr.Dataset:
    """Return rows as variables along the stages, beside `data`."""
    for name in rows[0]:
        values = np.array([row[name] for row in rows])
        if name == "mesh_position":
            data[name] = (("stage", "vertex", "component"), values)
        elif name == "flesh_position":
            data[name] = (("stage", "flesh_point", "component"), values)
        elif name.startswith("flesh_"):
            data[name] = (("stage", "flesh_point"), values)
        elif name.startswith("fruit_"):
            data[name] = (("stage", "fruit_number"), values)
        elif name in VECTORS:
            data[name] = (("stage", "colatitude", "azimuth", "component"), values)
        elif name in (*FIELDS, *BESIDE) and values.ndim == 2:
            data[name] = (("stage", "vertex"), values)
        elif name in (*FIELDS, "roasted"):
            data[name] = (("stage", "colatitude", "azimuth"), values)
        elif name != "stage":
            data[name] = ("stage", values.astype(np.int8) if name == "converged" else values)
    coords: dict[str, Any] = {"stage": np.array([row["stage"] for row in rows])}
    if any(name in FIELDS and data[name][1].ndim > 2 for name in data):
        assert need.resolution is not None  # settled
        down, along = window(need.resolution, need.region)
        coords["colatitude"] = colatitudes(need.resolution)[down]
        coords["azimuth"] = azimuths(need.resolution)[along]
    if not data.keys().isdisjoint({*VECTORS, "mesh_position", "flesh_position"}):
        coords["component"] = ["x", "y", "z"]
    return xr.Dataset(data, coords, attrs)
