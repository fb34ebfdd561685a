"""Runs inside of Blender's Python: the extension installed from its zip, against a service that is there.

    python inside.py ZIP ADDRESS TOKEN OUT.json

What it saw goes into OUT.json; the test judges it.
"""

from __future__ import annotations

import importlib
import json
import socket
import sys
import time
from pathlib import Path

import bpy


def installed(zipped: str):
    """Install and enable the zip as a person does in Blender's preferences."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(filepath=zipped, repo="user_default", enable_on_install=True)
    return importlib.import_module("bl_ext.user_default.wizen")


def wait(module, ready, seconds: float = 120) -> float:
    """Let the extension's timer tick until something is so; return the longest that one tick took [s]."""
    longest, end = 0.0, time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < end, module.STATE.said
        start = time.thread_time()
        module._tick()
        longest = max(longest, time.thread_time() - start)
        time.sleep(0.01)
    return longest


def positions(thing) -> list[float]:
    found = [0.0] * (3 * len(thing.data.vertices))
    thing.data.vertices.foreach_get("co", found)
    return found


def evaluated(thing) -> list[float]:
    held = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    found = [0.0] * (3 * len(held.data.vertices))
    held.data.vertices.foreach_get("co", found)
    return found


def main(zipped: str, address: str, token: str, out: str) -> None:
    seen: dict = {"version": bpy.app.version_string}
    module = installed(zipped)
    state, preferences = module.STATE, bpy.context.preferences.addons[module.__name__].preferences
    # a service that takes calls and never answers: nothing may wait for it
    with socket.create_server(("127.0.0.1", 0)) as mute:
        preferences.address = f"http://127.0.0.1:{mute.getsockname()[1]}"
        start = time.monotonic()
        bpy.ops.wizen.browse()
        for _ in range(20):
            module._tick()
        seen["mute_s"] = time.monotonic() - start
        state.work.forget()
    state.work = type(state.work)()
    preferences.address, preferences.token = address, token
    bpy.ops.wizen.browse()
    wait(module, lambda: state.maps)
    seen["families"] = [one[0] for one in state.items]
    seen["icons"] = sum(1 for one in state.items if one[3])
    bpy.ops.wizen.insert(family="raisin", n=48)
    raisin = bpy.context.object
    wait(module, lambda: not state.work.busy)
    module._tick()
    bpy.context.view_layer.update()
    seen["raisin"] = {"positions": positions(raisin), "s": raisin["s"], "metres": list(raisin.dimensions)}
    bpy.ops.wizen.insert(family="default", n=32)
    fruit = bpy.context.object
    wait(module, lambda: not state.work.busy)
    for s in (0.1, 0.15, 0.2, 0.25):
        fruit["s"] = s
        module._tick()
    fruit["te"], fruit["gamma"] = 0.034, 22.0
    seen["tick_s"] = wait(module, lambda: state.asked[fruit.name][1:] == (0.034, 22.0, 0.25) and not state.work.busy)
    module._tick()
    seen["moved"] = positions(fruit)
    seen["trust"] = state.trust
    fruit["s"], fruit.scale = 0.02, (0.5, 0.5, 0.5)
    bpy.ops.wizen.run(quality="preview", stages=2)
    wait(module, lambda: state.jobs and all(j["state"] in ("done", "failed") for j in state.jobs.values()))
    seen["jobs"] = list(state.jobs.values())
    bpy.ops.wizen.fetch(address=next(iter(state.jobs)))
    wait(module, lambda: any("run" in thing.name for thing in bpy.data.objects))
    run = next(thing for thing in bpy.data.objects if "run" in thing.name)
    seen["run"] = {"scale": list(run.scale), "skins": [m.name for m in run.data.materials]}
    seen["run"]["fruits"] = [m.name for m in fruit.data.materials]
    keys = run.data.shape_keys.key_blocks
    seen["keys"] = [key.name for key in keys]
    cache = Path(out).with_suffix(".pc2")
    cache.write_bytes(state.service().result(next(iter(state.jobs)), "pc2"))
    read = importlib.import_module("bl_ext.user_default.wizen.caches").read(cache.read_bytes())
    seen["frames"] = len(read.frames)
    bpy.context.scene.frame_set(int(read.start + read.rate))
    by_keys = evaluated(run)
    bpy.context.scene.frame_set(int(read.start))
    seen["keys_moved"] = max(abs(a - b) for a, b in zip(by_keys, evaluated(run), strict=True))
    run.shape_key_clear()
    bpy.context.view_layer.objects.active = run
    bpy.ops.wizen.load(filepath=str(cache), how="CACHE")
    bpy.context.scene.frame_set(int(read.start + read.rate))
    by_cache = evaluated(run)
    seen["keys_against_cache"] = max(abs(a - b) for a, b in zip(by_keys, by_cache, strict=True))
    fruit.select_set(True)
    bpy.context.view_layer.objects.active = fruit
    try:
        bpy.ops.wizen.load(filepath=str(cache), how="KEYS")
        seen["refused"] = ""
    except RuntimeError as error:
        seen["refused"] = str(error)
    bpy.ops.preferences.addon_disable(module=module.__name__)
    seen["gone"] = not hasattr(bpy.types, "VIEW3D_PT_wizen")
    Path(out).write_text(json.dumps(seen))


if __name__ == "__main__":
    main(*sys.argv[1:])
