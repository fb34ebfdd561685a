"""Results of runs in the scene: a mesh, and the caches that move it, as shape keys or by Blender's own modifier."""

from __future__ import annotations

from array import array
from typing import Any

import bpy

from .caches import Cache
from .client import Refused
from .lattice import upright

__all__ = ["cached", "keyed", "mesh_of"]


def mesh_of(name: str, text: str) -> Any:
    """Return a new object of an OBJ's vertices and faces, z up, at the 3D cursor.

    Raises:
        Refused: it has none.

    """
    positions, faces = array("f"), []
    for line in text.splitlines():
        if line.startswith("v "):
            positions.extend(map(float, line.split()[1:4]))
        elif line.startswith("f "):
            faces.append([int(word.partition("/")[0]) - 1 for word in line.split()[1:]])
    if not positions or not faces:
        raise Refused("The result holds no mesh.")
    points = upright(positions)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(points[k : k + 3]) for k in range(0, len(points), 3)], [], faces)
    mesh.validate()
    mesh.shade_smooth()
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(thing)
    thing.location = bpy.context.scene.cursor.location
    return thing


def keyed(thing: Any, cache: Cache) -> None:
    """Move an object by a cache's frames as shape keys that fade into each other.

    Raises:
        Refused: the cache is of another mesh, or the object has keys already.

    """
    _fits(thing, cache)
    if thing.data.shape_keys is not None:
        raise Refused(f"{thing.name} has shape keys already: take another object, or clear them.")
    basis = thing.shape_key_add(name="Basis", from_mix=False)
    basis.data.foreach_set("co", upright(cache.frames[0]))
    at = [cache.start + k * cache.rate for k in range(len(cache.frames))]
    for k, positions in enumerate(cache.frames):
        key = thing.shape_key_add(name=f"frame {at[k]:g}", from_mix=False)
        key.data.foreach_set("co", upright(positions))
        for frame, value in ((k - 1, 0.0), (k, 1.0), (k + 1, 0.0)):
            if 0 <= frame < len(at):
                key.value = value
                key.keyframe_insert("value", frame=at[frame])
    _straight(thing.data.shape_keys)
    scene = bpy.context.scene
    scene.frame_end = max(scene.frame_end, int(at[-1]))


def cached(thing: Any, path: str, cache: Cache) -> None:
    """Move an object by a PC2 file where it lies, with the modifier Mesh Cache.

    Raises:
        Refused: the cache is of another mesh.

    """
    _fits(thing, cache)
    modifier = thing.modifiers.new("wizen", "MESH_CACHE")
    modifier.cache_format = "PC2"
    modifier.filepath = path
    modifier.forward_axis, modifier.up_axis = "POS_Z", "NEG_Y"
    # Blender counts a file's samples as frames, whatever it says, and takes the start off what is scaled
    modifier.frame_start, modifier.frame_scale = cache.start / cache.rate, 1 / cache.rate


def _fits(thing: Any, cache: Cache) -> None:
    if thing is None or thing.type != "MESH":
        raise Refused("Choose the mesh that the cache moves.")
    count = len(thing.data.vertices)
    if count != cache.vertices:
        raise Refused(f"The cache moves {cache.vertices} vertices, and {thing.name} has {count}: take the run's mesh.")


def _straight(keys: Any) -> None:
    """Let keys fade in straight lines: of two that overlap the sum is 1 at all times."""
    action = keys.animation_data.action
    curves = getattr(action, "fcurves", None)
    if curves is None:  # Blender 5 keeps them in layers
        bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
        curves = [curve for bag in bags for curve in bag.fcurves]
    for curve in curves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
