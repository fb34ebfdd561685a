"""Binary glTF 2.0: one mesh with normals and latitude-longitude texture coordinates, ready for a browser or Blender."""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import mesh
from .about import GENERATOR, About, extras
from .gltf import FLOAT, INDICES, UINT, USHORT, VERTICES, Buffer, bounds, pack, skin

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["encode"]

#: The largest 16-bit index is reserved by WebGL as a restart mark.
_SHORT = 0xFFFF


def encode(shape: Shape, about: About) -> bytes:
    """Return the shape as a GLB file; the query, the stage and the units are the node's `extras`."""
    position, ends = mesh.surface(shape)
    n = position.shape[0]
    copies = mesh.seam(n)
    indices = mesh.seam_triangles(n)
    index_type = UINT
    if len(copies) < _SHORT:
        indices, index_type = indices.astype("<u2"), USHORT

    points = mesh.vertices(position, ends).take(copies, axis=0)
    upright = mesh.vertices(shape.normals, shape.pole_normals).take(copies, axis=0)
    buffer = Buffer()
    attributes = {
        "POSITION": buffer.add(points, FLOAT, "VEC3", VERTICES, bounds(points)),
        "NORMAL": buffer.add(upright, FLOAT, "VEC3", VERTICES),
        "TEXCOORD_0": buffer.add(mesh.texture(n), FLOAT, "VEC2", VERTICES),
    }
    primitive = {"attributes": attributes, "indices": buffer.add(indices.ravel(), index_type, "SCALAR", INDICES)}
    name, worn = about.solver or "shape", about.worn(shape.stage)
    document = {
        "asset": {"version": "2.0", "generator": GENERATOR},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name, "extras": extras(shape, about)}],
        "meshes": [{"name": name, "primitives": [{**primitive, "material": 0}]}],
        # without one, viewers fall back to polished metal
        "materials": [skin("skin", worn)],
    }
    return pack(document, buffer)
