"""Runs inside of Blender's Python: the same camera and light on each of several files.

python render.py OUT_FOLDER FILE...
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import bpy


def studio():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples, scene.cycles.seed = "CYCLES", "CPU", 64, 1
    scene.render.resolution_x = scene.render.resolution_y = 160
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.view_settings.view_transform = "Standard"
    world = bpy.data.worlds.new("world")
    scene.world, world.use_nodes = world, True
    world.node_tree.nodes["Background"].inputs[0].default_value = (1, 1, 1, 1)
    world.node_tree.nodes["Background"].inputs[1].default_value = 0.3
    light = bpy.data.lights.new("sun", "SUN")
    light.energy = 3
    sun = bpy.data.objects.new("sun", light)
    sun.rotation_euler = (0.7, 0.3, 0)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (0, -4, 1), (math.radians(76), 0, 0)
    for thing in (sun, camera):
        scene.collection.objects.link(thing)
    scene.camera = camera
    return scene


for name in sys.argv[2:]:
    scene = studio()
    if name.endswith(".glb"):
        bpy.ops.import_scene.gltf(filepath=name)
    else:
        bpy.ops.wm.usd_import(filepath=name)
    for thing in bpy.data.objects:
        if thing.type == "MESH":
            # files say how large a fruit is in their own ways: the picture is of one size
            thing.scale = [one * 2.08 / max(thing.dimensions) for one in thing.scale]
    scene.render.filepath = str(Path(sys.argv[1]) / (Path(name).name + ".png"))
    bpy.ops.render.render(write_still=True)
