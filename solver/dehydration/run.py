"""A dehydration run: walk the path, keep what is needed of each stage, and hand it over as one dataset."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import xarray as xr

from ..contract import Context, Need, SolverError
from ..fruit import azimuths, colatitudes, window
from ..geometry.crossings import split_quads
from .fresh.loading import Loading
from .fresh.mesh import FruitMesh
from .measures.delivery import Delivery
from .measures.descriptors import Descriptors, Surface
from .measures.penetration import of_quads
from .params import DehydrationParams
from .path import Path, State
from .settings import choose

__all__ = ["Record", "run"]

_FIELDS = ("position", "displacement")

#: What is measured on the lattice that the need's resolution asks for, all of it whatever the region.
_DELIVERED = ("lattice_crossings", "lattice_penetration", "lattice_evened")


class Record:
    """Collects what the need asks for, stage by stage, and nothing else."""

    def __init__(self, params: DehydrationParams, need: Need, mesh: FruitMesh, start: float | None = None) -> None:
        self._need, self._mesh = need, mesh
        self._wants_fields = any(f in need.fields for f in _FIELDS)
        self._measures_delivered = any(f in need.fields for f in _DELIVERED)
        self._descriptors = [f for f in need.fields if f in Descriptors._fields]
        self._surface = Surface(params, mesh) if self._descriptors else None
        assert need.resolution is not None  # settled
        self._inside = window(need.resolution, need.region)
        if self._wants_fields or self._measures_delivered:
            self._delivered = Delivery(params, mesh, need.resolution, need.dtype)
        self._start = time.perf_counter() if start is None else start
        self.rows: list[dict[str, Any]] = []

    def add(self, state: State, converged: bool) -> None:
        """Keep what is asked for of a stage."""
        row: dict[str, Any] = {
            "stage": state.shrinkage,
            "residual": state.residual,
            "drift": state.drift,
            "converged": converged,
            "iterations": state.steps,
            "seconds": time.perf_counter() - self._start,
        }
        nodes = state.surface
        if "mesh_position" in self._need.fields:
            row["mesh_position"] = nodes.astype(self._need.dtype)
        if self._wants_fields or self._measures_delivered:
            given = self._delivered(nodes)
            for name, field in (("displacement", given.displacement), ("position", given.position)):
                if name in self._need.fields:
                    row[name] = field[self._inside]
            row.update(_told((given.found.count, given.found.depth, given.moved), _DELIVERED, self._need))
        if self._surface is not None:
            described = self._surface.describe(nodes)
            row.update({name: getattr(described, name) for name in self._descriptors})
        if "penetration" in self._need.fields or "crossings" in self._need.fields:
            found = of_quads(nodes, self._mesh.sphere.quads)
            row.update(_told((found.count, found.depth), ("crossings", "penetration"), self._need))
        for name, value in (
            ("least_jacobian", state.least_ratio),
            ("strain_energy", state.energy),
            ("released_energy", state.released),
        ):
            if name in self._need.fields:
                row[name] = value
        self.rows.append(row)

    def dataset(self, attrs: dict[str, Any]) -> xr.Dataset:
        """Return all stages kept so far."""
        need = self._need
        assert need.resolution is not None
        data: dict[str, Any] = {}
        for name in self.rows[0]:
            if name == "stage":
                continue
            values = np.array([row[name] for row in self.rows])
            if name in _FIELDS:
                data[name] = (("stage", "colatitude", "azimuth", "component"), values)
            elif name == "mesh_position":
                data[name] = (("stage", "vertex", "component"), values)
                quads = self._mesh.sphere.quads
                # each triangle beside the other half of its quad
                halves = split_quads(quads).reshape(2, -1, 3).transpose(1, 0, 2).reshape(-1, 3)
                data["triangle"] = (("face", "corner"), halves.astype(np.int32))
                data["quad"] = (("quad_face", "quad_corner"), quads.astype(np.int32))
            elif name == "converged":
                data[name] = ("stage", values.astype(np.int8))
            else:
                data[name] = ("stage", values)
        coords: dict[str, Any] = {"stage": np.array([row["stage"] for row in self.rows])}
        if self._wants_fields:
            rows, columns = self._inside
            coords["colatitude"] = colatitudes(need.resolution)[rows]
            coords["azimuth"] = azimuths(need.resolution)[columns]
        if self._wants_fields or "mesh_position" in need.fields:
            coords["component"] = ["x", "y", "z"]
        return xr.Dataset(data, coords, attrs)


def _told(values: tuple[float, ...], names: tuple[str, ...], need: Need) -> dict[str, float]:
    """Return the values under their names, those that are asked for."""
    return {name: float(value) for name, value in zip(names, values, strict=True) if name in need.fields}


def run(params: DehydrationParams, need: Need, context: Context) -> xr.Dataset:
    """Return displacement, position and descriptors of the wanted stages; see `solver.quantities` for units.

    Raises:
        InvalidInput: a stage at which the driest flesh would be gone.
        Unstable: the state left the finite; carries the stages before.
        Cancelled: the observer asked to stop.

    """
    loading = Loading(params)
    loading.check(need.stages[0])
    loading.check(need.stages[-1])
    settings = choose(params, need.quality, need.stages[-1])
    context.report(0.0, f"meshing {settings.elements} elements")
    released, strained = ("released_energy" in need.fields, "strain_energy" in need.fields)
    path = Path(params, settings, context, with_release=released, with_energy=strained)
    record = Record(params, need, path.mesh)
    last = need.stages[-1]
    attrs = {
        "path": "march" if last > settings.start else "base-state",
        "elements": path.elements,
        "residual_limit": settings.residual,
        "drift_limit": settings.drift,
        "kappa_over_mu": settings.kappa_ratio,
        "unit_of_length": "r1",
    }
    try:
        for done, shrinkage in enumerate(need.stages, 1):
            state = path.stage(shrinkage, last)
            record.add(state, state.residual <= settings.residual and state.drift <= settings.drift)
            context.report(
                shrinkage / last if last > 0 else done / len(need.stages), f"shrinkage s = {shrinkage:.3f} settled"
            )
    except SolverError as error:
        if record.rows:
            error.partial = record.dataset(attrs)
            error.last_stage = record.rows[-1]["stage"]
        raise
    return record.dataset(attrs)
