"""Run by a Python with Blender's `bpy`: render the stages of a USD or GLB file. FILE STEM AGES PIXELS SAMPLES."""

from __future__ import annotations

import sys
from typing import Any

import bpy
from mathutils import Vector


def loaded(path: str, ages: int) -> list[tuple[int, list[Any]]]:
    """Return frame and objects to show by age."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith(".glb"):
        bpy.ops.import_scene.gltf(filepath=path)
        # the nodes of the ages take turns along the clip, each by its scale: all are shown, one is large
        last = max((action.frame_range[1] for action in bpy.data.actions), default=1.0)
        return [(round(last * (k + 0.5) / ages), list(bpy.data.objects)) for k in range(ages)]
    bpy.ops.wm.usd_import(filepath=path)
    scene = bpy.context.scene
    first, last = scene.frame_start, scene.frame_end
    shapes = list(bpy.data.objects)
    return [(round(first + (last - first) * k / max(ages - 1, 1)), shapes) for k in range(ages)]


def bounds(objects: list[Any]) -> tuple[Any, Any]:
    """Return the corners of the box about meshes as they stand."""
    graph = bpy.context.evaluated_depsgraph_get()
    points = []
    for one in objects:
        if one.type == "MESH":
            there = one.evaluated_get(graph)
            points += [there.matrix_world @ v.co for v in there.data.vertices]
    return tuple(Vector([pick(p[k] for p in points) for k in range(3)]) for pick in (min, max))


def lit(low: Any, high: Any) -> None:
    """Stand the fruit on a table in the light of a window."""
    scene, middle, size = bpy.context.scene, (low + high) / 2, (high - low).length
    bpy.ops.mesh.primitive_plane_add(size=40 * size, location=(middle.x, middle.y, low.z))
    table = bpy.data.materials.new("table")
    table.use_nodes = True
    table.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.42, 0.36, 0.30, 1)
    bpy.context.object.data.materials.append(table)
    scene.world = bpy.data.worlds.new("room")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[1].default_value = 0.7
    for name, data, way in (
        ("window", bpy.data.lights.new("window", "AREA"), (-1.2, -1.0, 1.4)),
        ("camera", bpy.data.cameras.new("camera"), (0.0, -2.0, 0.75)),
    ):
        body = bpy.data.objects.new(name, data)
        scene.collection.objects.link(body)
        body.location = middle + size * Vector(way)
        body.rotation_euler = (middle - body.location).to_track_quat("-Z", "Y").to_euler()
        if name == "camera":
            data.lens, data.clip_start, data.clip_end, scene.camera = 105, 0.01 * size, 100 * size, body
        else:
            data.energy, data.size = 65 * size * size, size


def main(path: str, stem: str, ages: str, pixels: str, samples: str) -> None:
    """Render."""
    shown = loaded(path, int(ages))
    scene = bpy.context.scene
    scene.frame_set(shown[0][0])
    lit(*bounds(shown[0][1]))
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", int(samples), True
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.resolution_x = scene.render.resolution_y = int(pixels)
    scene.view_settings.view_transform = "Standard"
    everyone = {one for _, objects in shown for one in objects}
    for k, (frame, objects) in enumerate(shown):
        if path.endswith(".glb") and k + 1 < len(shown):
            continue  # one is enough to see that it says the same
        scene.frame_set(frame)
        for one in everyone:
            one.hide_render = one not in objects
        scene.render.filepath = f"{stem}-{k}.png"
        bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
