"""Texture coordinates of meshes: those that a mesh came with, or such as xatlas lays out; and fields drawn on them.
And the groups that a mesh came with.

A texel has the value at its middle, linear on the triangle that covers it. What lies between the charts takes the
nearest texel's, so that nothing of the background bleeds in where a picture is filtered or made smaller.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.arrays import Array
from sweeps.errors import installing

from ..errors import Unavailable
from .seam import Seam

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Texels", "drawn", "groups", "laid", "materials", "own", "texels"]

#: What vertices of PLY files have.
_TAKEN = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue")


def own(run: xr.Dataset, index: int = 0) -> Seam | None:
    """Return the texture coordinates that a result's mesh has, at a stage where triangles change; None if none."""
    if "texture_coordinate" not in run:
        return None
    uv, corners = run["texture_coordinate"].values.astype(float), run["texture_triangle"].values.astype(np.int64)
    triangles = run["triangle"].values.astype(np.int64)
    if "texture_count" in run:
        faces, rows = (_part(run[name].values, index) for name in ("face_count", "texture_count"))
        uv, corners, triangles = uv[rows], corners[faces], triangles[faces]
    copies = np.full(len(uv), -1)
    copies[corners] = triangles
    if (copies[corners] == triangles).all() and (copies >= 0).all():
        return Seam(uv * [1, -1] + [0, 1], copies, corners.astype("u4"))
    # a pair of numbers that several vertices share is one for each of them
    pairs, back = np.unique(np.stack([corners.ravel(), triangles.ravel()], axis=1), axis=0, return_inverse=True)
    return Seam(uv[pairs[:, 0]] * [1, -1] + [0, 1], pairs[:, 1], back.reshape(-1, 3).astype("u4"))


def materials(run: xr.Dataset, index: int) -> Array | None:
    """Return numbers of the materials (f,) of a stage's triangles, where those change; None where they have none."""
    if "face_material" not in run:
        return None
    return np.asarray(run["face_material"].values[_part(run["face_count"].values, index)])


def groups(run: xr.Dataset, index: int, taken: Collection[str]) -> dict[str, Array]:
    """Return weights (v) of a stage's vertices in the groups that its mesh came with, by names that files can hold.

    taken: names of fields; a group of such a name, or of one that files have for something else, gets a longer one.
    """
    if "group_weight" not in run:
        return {}
    weights = np.asarray(run["group_weight"].values, "f4")
    if "vertex_count" in run:
        weights = weights[_part(run["vertex_count"].values, index)]
    names = (re.sub(r"\W", "_", name, flags=re.ASCII) for name in json.loads(run.attrs["groups"]))
    taken = {*taken, *_TAKEN}
    return {f"group_{n}" if n in taken or n[0].isdigit() else n: weights[:, k] for k, n in enumerate(names)}


def _part(counts: Array, index: int) -> slice:
    """Return which rows are a stage's, of arrays that hold all stages end to end."""
    end = int(counts[: index + 1].sum())
    return slice(end - int(counts[index]), end)


def laid(run: xr.Dataset) -> xr.Dataset:
    """Return a result with texture coordinates laid out by xatlas on its first stage.

    Raises:
        Unavailable: xatlas is not installed.

    """
    try:
        import xatlas
    except ImportError:
        raise Unavailable(
            "this mesh has no texture coordinates, and laying them out needs the package xatlas.",
            advice=installing("unwrap"),
        ) from None
    points = np.ascontiguousarray(run["mesh_position"].values[0], np.float32)
    copies, corners, uv = xatlas.parametrize(points, np.ascontiguousarray(run["triangle"].values, np.uint32))
    same = np.array_equal(copies[corners], run["triangle"].values)
    assert same, "xatlas keeps the order of triangles and of their corners"
    return run.assign(
        texture_coordinate=(("texture_vertex", "uv"), uv.astype(float)),
        texture_triangle=(("face", "corner"), corners.astype(np.int32)),
    )


class Texels(NamedTuple):
    """What covers a picture: numbers of pixels (p), triangles (p), shares of their corners (p, 3), and of each pixel
    the row and the column of the nearest covered one.
    """

    pixel: Array
    face: Array
    shares: Array
    near: tuple[Array, Array]


def texels(seam: Seam, size: int) -> Texels:
    """Return what covers a picture (size, size)."""
    from scipy import ndimage

    from sweeps.pictures.raster import rasterise

    # textures repeat: what lies beyond the unit square is drawn in it
    uv = seam.uv - np.floor(seam.uv[seam.triangles].mean(axis=(0, 1)))
    faces = seam.triangles.astype(np.int64)
    pixel, face, shares, _ = rasterise(uv * size, np.zeros(len(uv)), faces, size, both=True)
    bare = np.ones(size * size, np.bool_)
    bare[pixel] = False
    near = ndimage.distance_transform_edt(bare.reshape(size, size), return_distances=False, return_indices=True)
    return Texels(pixel, face, shares.astype(np.float32), (near[0], near[1]))


def drawn(seam: Seam, where: Texels, values: Array, size: int) -> Array:
    """Return a field of the vertices (v) or (v, c) as a picture (size, size) or (size, size, c), float32."""
    corners = np.asarray(values, np.float32)[seam.copies[seam.triangles[where.face]]]
    flat = np.zeros((size * size, *np.shape(values)[1:]), np.float32)
    flat[where.pixel] = np.einsum("pk,pk...->p...", where.shares, corners)
    return np.asarray(flat.reshape(size, size, *flat.shape[1:])[where.near])
