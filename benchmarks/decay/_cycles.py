"""Run by a Python with Blender's `bpy`: render USD or GLB files. STEM PIXELS SAMPLES AGES FILE [FILE ...].

A GLB holds all stages, of which the last is rendered; of USD there is a file for each. Cycles of bpy 5.0.1 aborts on
these files (it asks for 2^64 bytes): take 4.5, which renders them. Blender reads curves and
points of a USD file but not the materials that are bound to them: here they get one that does what those say.
"""

from __future__ import annotations

import sys
from typing import Any

import bpy
from mathutils import Vector


def loaded(path: str, ages: int) -> tuple[Any, Any]:
    """Load a file, go to the frame that is to be shown, and return the box about the fruit in its first one."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    if path.endswith(".glb"):
        bpy.ops.import_scene.gltf(filepath=path)
        scene.frame_set(0)
        box = bounds()
        # the nodes of the ages take turns along the clip, each by its scale: all are shown, one is large
        last = max((action.frame_range[1] for action in bpy.data.actions), default=1.0)
        scene.frame_set(round(last * (ages - 0.5) / ages))
        return box
    bpy.ops.wm.usd_import(filepath=path)
    scene.frame_set(scene.frame_start)
    for one in bpy.data.objects:
        if one.type in ("CURVES", "POINTCLOUD"):
            one.data.materials.append(felt(one.name == "heads"))
    return bounds()


def felt(dark: bool) -> Any:
    """Return what is bound to threads and heads in the file."""
    material = bpy.data.materials.new("felt")
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 1.0
    shader.inputs["Specular IOR Level"].default_value = 0.1
    if dark:
        shader.inputs["Base Color"].default_value = (0.03, 0.03, 0.03, 1)
        return material
    colour = material.node_tree.nodes.new("ShaderNodeAttribute")
    colour.attribute_name = "displayColor"
    material.node_tree.links.new(colour.outputs["Color"], shader.inputs["Base Color"])
    return material


def bounds() -> tuple[Any, Any]:
    """Return the corners of the box about the fruit as it stands, without stem and threads."""
    graph = bpy.context.evaluated_depsgraph_get()
    points = []
    for one in bpy.data.objects:
        if one.type == "MESH" and one.name not in ("stem", "calyx"):
            there = one.evaluated_get(graph)
            kinds = [material.name for material in there.data.materials]
            skin = {v for face in there.data.polygons if not _small(kinds, face.material_index) for v in face.vertices}
            points += [there.matrix_world @ there.data.vertices[v].co for v in skin]
    return tuple(Vector([pick(p[k] for p in points) for k in range(3)]) for pick in (min, max))


def _small(kinds: list[str], number: int) -> bool:
    """Return whether a material is that of what stands on the fruit: a GLB's stage is one mesh of many materials."""
    return number < len(kinds) and kinds[number].startswith(("stem", "calyx", "hyphae"))


def lit(low: Any, high: Any, floor: float) -> None:
    """Stand the fruit on a table in the light of a window; low, high: the box that the camera sees."""
    scene, middle, size = bpy.context.scene, (low + high) / 2, (high - low).length
    bpy.ops.mesh.primitive_plane_add(size=40 * size, location=(middle.x, middle.y, floor))
    table = bpy.data.materials.new("table")
    table.use_nodes = True
    table.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.42, 0.36, 0.30, 1)
    bpy.context.object.data.materials.append(table)
    scene.world = bpy.data.worlds.new("room")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[1].default_value = 0.7
    for name, data, way in (
        ("window", bpy.data.lights.new("window", "AREA"), (-1.2, -1.0, 1.4)),
        ("camera", bpy.data.cameras.new("camera"), (0.0, -2.1, 0.8)),
    ):
        body = bpy.data.objects.new(name, data)
        scene.collection.objects.link(body)
        body.location = middle + size * Vector(way)
        body.rotation_euler = (middle - body.location).to_track_quat("-Z", "Y").to_euler()
        if name == "camera":
            data.lens, data.shift_y, data.clip_start, data.clip_end, scene.camera = (
                96,
                0.03,
                0.01 * size,
                100 * size,
                body,
            )
        else:
            data.energy, data.size = 65 * size * size, size


def main(stem: str, pixels: str, samples: str, ages: str, *paths: str) -> None:
    """Render each file, with the camera as it stands for the first."""
    box: tuple[Any, Any] | None = None
    for k, path in enumerate(paths):
        found = loaded(path, int(ages))
        box = box or found
        lit(*(found if path.endswith(".glb") else box), bounds()[0].z)
        scene = bpy.context.scene
        scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", int(samples), True
        scene.render.threads_mode, scene.render.threads = "FIXED", 1
        scene.render.resolution_x = scene.render.resolution_y = int(pixels)
        scene.view_settings.view_transform = "Standard"
        scene.render.filepath = f"{stem}-{k}.png"
        bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
