"""What stands on the surfaces of a run's stages, as triangles for pictures: threads with heads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.arrays import Array
from solver.meshes import Frame

from . import colours
from .fur import Feet, feet, grown, ribbons
from .raster import normals
from .render import More, mesh

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["on_lattices", "on_meshes"]


def on_lattices(run: xr.Dataset, places: Sequence[tuple[Array | None, Array | None]]) -> list[More | None]:
    """Return what stands on positions (n, 2n, 3) with their poles (2, 3), stage by stage; None where nothing does."""
    frames: list[tuple[Array | None, Array | None, Mapping[str, Array]]] = []
    for i, (position, poles) in enumerate(places):
        maps = {name: _flat(values) for name, values in colours.maps_of(run, i).items()}
        frames.append((*((None, None) if position is None else mesh(position, poles)), maps))
    return _threads(run, frames)


def on_meshes(run: xr.Dataset, frames: Sequence[Frame]) -> list[More | None]:
    """Return what stands on a run's meshes, stage by stage: nothing where triangles change."""
    if "stage" not in run["mesh_position"].dims:
        return [None] * len(frames)
    return _threads(run, [(f.vertices.astype(float), f.triangles.astype(np.int64), f.fields) for f in frames])


def _flat(values: Array) -> Array:
    return np.concatenate([values.ravel(), [values[0].mean(), values[-1].mean()]])


def _threads(
    run: xr.Dataset, frames: Sequence[tuple[Array | None, Array | None, Mapping[str, Any]]]
) -> list[More | None]:
    where: Feet | None = None
    found: list[More | None] = []
    for vertices, faces, fields in frames:
        fur = colours.furred(run, fields) if vertices is not None else None
        if fur is None or vertices is None or faces is None:
            found.append(None)
            continue
        if where is None:
            where = feet(vertices, faces, fur.peak)
        points, parts, paint, out = ribbons(grown(where, vertices, normals(vertices, faces), fur))
        found.append(More(points, parts, paint, out) if len(points) else None)
    return found
