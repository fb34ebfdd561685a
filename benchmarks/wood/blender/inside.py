"""Run by a Python with Blender's `bpy`: what is in a clip, frame by frame, as JSON on the last line. FILE STAGES."""

from __future__ import annotations

import json
import sys
from typing import Any

import bpy
import numpy as np

#: A mesh whose node is smaller than this is not the one that is shown.
_SHOWN = 0.5


def steel(mesh: Any) -> np.ndarray:
    """Return which vertices (v,) are of bodies: what a file's colours say, in which wood is redder than blue."""
    colour = mesh.color_attributes[0]
    values = np.empty(4 * len(colour.data))
    colour.data.foreach_get("color", values)
    blue = values.reshape(-1, 4)[:, 2] > values.reshape(-1, 4)[:, 0]
    if colour.domain == "POINT":
        return blue
    corner = np.empty(len(mesh.loops), np.int64)
    mesh.loops.foreach_get("vertex_index", corner)
    found = np.zeros(len(mesh.vertices), bool)
    found[corner] = blue
    return found


def parts(mesh: Any) -> tuple[int, list[tuple[int, bool]]]:
    """Return the number of vertices, and of every piece its faces and whether it is a body.

    A piece hangs together by its vertices' places: a corner of a file stands there once for each of its normals.
    """
    metal = steel(mesh)
    count = len(mesh.vertices)
    x = np.empty(3 * count)
    mesh.vertices.foreach_get("co", x)
    same = np.unique(np.round(x.reshape(-1, 3), 7), axis=0, return_inverse=True)[1].ravel()
    up = np.arange(same.max() + 1)

    def root(i: int) -> int:
        while up[i] != i:
            up[i] = up[up[i]]
            i = up[i]
        return i

    for face in mesh.polygons:
        first = root(same[face.vertices[0]])
        for v in face.vertices[1:]:
            up[root(same[v])] = first
    found: dict[int, list[Any]] = {}
    for face in mesh.polygons:
        one = found.setdefault(root(same[face.vertices[0]]), [0, bool(metal[face.vertices[0]])])
        one[0] += 1
    return count, [(n, body) for n, body in found.values()]


def main(path: str, stages: int) -> None:
    """Print what there is."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)
    scene, meshes = bpy.context.scene, [o for o in bpy.data.objects if o.type == "MESH"]
    first, last = (pick(a.frame_range[k] for a in bpy.data.actions) for k, pick in ((0, min), (1, max)))
    seen = []
    for k in range(stages):
        # nodes of the stages take turns along the clip, each by its scale
        frame = round(first + (last - first) * (k + 0.5) / stages)
        scene.frame_set(frame)
        bpy.context.view_layer.update()
        shown = [o for o in meshes if min(abs(s) for s in o.matrix_world.to_scale()) > _SHOWN]
        found = [parts(o.data) for o in shown]
        pieces = sorted((piece for _, mine in found for piece in mine), reverse=True)
        seen.append({
            "frame": frame, "meshes": len(shown), "vertices": sum(count for count, _ in found),
            "bodies": [n for n, body in pieces if body], "wood": [n for n, body in pieces if not body],
        })  # fmt: skip
    told = {
        "blender": bpy.app.version_string, "meshes": len(meshes), "frames": [float(first), float(last)], "stages": seen,
    }  # fmt: skip
    print(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
