"""Triangle meshes in results: one convention for every solver whose surface is not the fruit's lattice.

A mesh that keeps its triangles holds `mesh_position(stage, vertex, component)` and `triangle(face, corner)`; other
fields of its vertices are `(stage, vertex)`. A mesh that changes them is a contiguous ragged array (CF 1.11, 9.3.3):
the vertices of all stages end to end in `mesh_position(vertex, component)`, likewise `triangle(face, corner)`, whose
numbers count from the first vertex of their own stage, with `vertex_count(stage)` and `face_count(stage)`; other
fields of its vertices are `(vertex)`. Triangles turn counter-clockwise seen from outside. The length of a unit in
metres stands in `attrs["metres_per_unit"]` where it is known. A mesh that keeps its triangles may come with texture
coordinates of their corners, `texture_coordinate(texture_vertex, uv)` with v upwards and `texture_triangle(face,
corner)`, and with `face_material(face)`, numbers of the names in `attrs["materials"]`, a JSON list. One that changes
its triangles has them end to end as well, with `texture_count(stage)`; its texture triangles count from the first
texture vertex of their own stage. Either may have `group_weight(vertex, group)`, weights of the vertices in groups that
`attrs["groups"]` names, a JSON list; of one that changes its triangles they too stand end to end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

__all__ = ["Frame", "changing", "frame"]


class Frame(NamedTuple):
    """The mesh of one stage: vertices (v, 3), triangles (f, 3) int32, and fields of the vertices (v,) or (v, k)."""

    vertices: np.ndarray
    triangles: np.ndarray
    fields: Mapping[str, np.ndarray]


def changing(frames: Sequence[Frame], dtype: str = "float32") -> dict[str, Any]:
    """Return the variables of stages that have triangles of their own, for `xr.Dataset`."""
    data: dict[str, Any] = {
        "mesh_position": (("vertex", "component"), np.concatenate([f.vertices for f in frames]).astype(dtype)),
        "triangle": (("face", "corner"), np.concatenate([f.triangles for f in frames]).astype(np.int32)),
        "vertex_count": ("stage", np.array([len(f.vertices) for f in frames], np.int32)),
        "face_count": ("stage", np.array([len(f.triangles) for f in frames], np.int32)),
    }
    for name in frames[0].fields:
        data[name] = (("vertex",), np.concatenate([f.fields[name] for f in frames]).astype(dtype))
    return data


def frame(result: xr.Dataset, index: int) -> Frame:
    """Return the mesh of stage number `index` of a result.

    Raises:
        KeyError: the result holds no mesh.
        IndexError: it has no such stage.

    """
    points, triangles = result["mesh_position"], result["triangle"].values
    if not -result.sizes["stage"] <= index < result.sizes["stage"]:
        raise IndexError(f"the result has {result.sizes['stage']} stages, not stage number {index}")
    along: dict[str, Any]
    own: tuple[str, ...]
    if "stage" in points.dims:
        along, own = {"stage": index}, ("stage", "vertex")
    else:
        index %= result.sizes["stage"]
        vertices = np.concatenate([[0], np.cumsum(result["vertex_count"].values)])
        faces = np.concatenate([[0], np.cumsum(result["face_count"].values)])
        triangles = triangles[faces[index] : faces[index + 1]]
        along, own = {"vertex": slice(vertices[index], vertices[index + 1])}, ("vertex",)
    fields = {
        str(name): variable.isel(along).values
        for name, variable in result.data_vars.items()
        if variable.dims[: len(own)] == own and name != "mesh_position"
    }
    return Frame(points.isel(along).values, triangles, fields)
