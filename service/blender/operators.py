"""What the panel's buttons do: each returns at once, and what comes of it arrives later."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import bpy

from . import caches, fruit, loading
from .client import Refused, Service
from .state import STATE

__all__ = ["CLASSES", "poll"]

#: States that a job does not leave.
_ENDED = ("done", "failed", "cancelled")


def _families(self: Any, context: Any) -> list[tuple[str, str, str, int, int]]:
    return STATE.items or [("", "none yet: press Browse", "", 0, 0)]


class Browse(bpy.types.Operator):
    """Ask the service which families of shapes it has."""

    bl_idname, bl_label = "wizen.browse", "Browse"

    def execute(self, context: Any) -> set[str]:
        """Begin."""
        STATE.browse()
        return {"FINISHED"}


class Insert(bpy.types.Operator):
    """Put a fruit of a family at the 3D cursor, as large as such fruits are."""

    bl_idname, bl_label, bl_options = "wizen.insert", "Insert", {"REGISTER", "UNDO"}
    __annotations__ = {
        "family": bpy.props.EnumProperty(name="Family", items=_families),
        "n": bpy.props.IntProperty(name="Colatitudes", default=64, min=8, max=256),
    }

    def execute(self, context: Any) -> set[str]:
        """Begin."""
        return _said(self, lambda: fruit.insert(self.family, self.n))


class Run(bpy.types.Operator):
    """Have the solver run the chosen fruit, which takes minutes; needs a token."""

    bl_idname, bl_label = "wizen.run", "Run"
    __annotations__ = {
        "quality": bpy.props.EnumProperty(
            name="Quality", items=[(q, q.capitalize(), "") for q in ("preview", "default", "fine")]
        ),
        "stages": bpy.props.IntProperty(name="Stages", description="On the way", default=6, min=1, max=50),
    }

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether a fruit is chosen."""
        return fruit.is_fruit(context.object)

    def execute(self, context: Any) -> set[str]:
        """Submit."""
        thing = context.object
        solver, table, values = thing["wizen_solver"], thing["wizen_table"], fruit.values(thing)
        last, name, quality = list(values.values())[-1], thing.name, self.quality
        stages = [round(last * (k + 1) / self.stages, 6) for k in range(self.stages)]
        job = {"name": name, "state": "queued", "fraction": 0.0, "scale": tuple(thing.scale)}
        STATE.begin(
            ("run", name),
            # what the sliders leave open is the family's
            lambda service: service.submit(solver, service.parameters(solver, table, values), stages, quality),
            lambda address: STATE.jobs.update({address: job}),
        )
        return {"FINISHED"}


class Cancel(bpy.types.Operator):
    """Stop a job."""

    bl_idname, bl_label = "wizen.cancel", "Cancel"
    __annotations__ = {"address": bpy.props.StringProperty()}

    def execute(self, context: Any) -> set[str]:
        """Begin."""
        address = self.address
        STATE.begin(("cancel", address), lambda service: service.cancel(address), lambda _: None)
        return {"FINISHED"}


class Fetch(bpy.types.Operator):
    """Bring a finished job's mesh, moved by all of its stages as shape keys."""

    bl_idname, bl_label = "wizen.fetch", "Fetch"
    __annotations__ = {"address": bpy.props.StringProperty()}

    def execute(self, context: Any) -> set[str]:
        """Begin."""
        address, job = self.address, STATE.jobs.get(self.address, {"name": "run"})
        STATE.begin(("fetch", address), lambda service: _result(service, address), lambda found: _arrived(job, *found))
        return {"FINISHED"}


class Load(bpy.types.Operator):
    """Move the chosen mesh by a PC2 cache, as shape keys or from the file."""

    bl_idname, bl_label, bl_options = "wizen.load", "Load PC2", {"REGISTER", "UNDO"}
    __annotations__ = {
        "filepath": bpy.props.StringProperty(subtype="FILE_PATH"),
        "filter_glob": bpy.props.StringProperty(default="*.pc2", options={"HIDDEN"}),
        "how": bpy.props.EnumProperty(
            name="As", items=[("KEYS", "Shape keys", "In the file"), ("CACHE", "Mesh cache", "Read from the PC2")]
        ),
    }

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the file."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Load."""
        path = bpy.path.abspath(self.filepath)
        return _said(self, lambda: _load(context.object, path, self.how == "KEYS"))


def _load(thing: Any, path: str, keys: bool) -> None:
    try:
        found = caches.read(Path(path).read_bytes())
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}.") from None
    if keys:
        loading.keyed(thing, found)
    else:
        loading.cached(thing, path, found)


def _said(operator: Any, act: Any) -> set[str]:
    try:
        act()
    except Refused as error:
        operator.report({"ERROR"}, str(error))
        return {"CANCELLED"}
    return {"FINISHED"}


def _result(service: Service, address: str) -> tuple[str, caches.Cache]:
    return service.result(address, "obj").decode(), caches.read(service.result(address, "pc2"))


def _arrived(job: dict[str, Any], text: str, cache: caches.Cache) -> None:
    name = job["name"]
    try:
        thing = loading.mesh_of(f"{name} run", text)
        fruit.dress(thing, name, job.get("scale", (1.0, 1.0, 1.0)))
        loading.keyed(thing, cache)
        STATE.said = f"{name}: {len(cache.frames)} stages as shape keys"
    except Refused as error:
        STATE.complain(str(error))


def poll() -> None:
    """Ask for the state of jobs that have not ended."""
    for address, known in STATE.jobs.items():
        if known["state"] not in _ENDED:
            STATE.begin(("job", address), partial(_state, address), _heard)


def _state(address: str, service: Service) -> tuple[str, dict[str, Any]]:
    return address, service.job(address)


def _heard(found: tuple[str, dict[str, Any]]) -> None:
    address, said = found
    if address in STATE.jobs:
        progress = said.get("progress") or {}
        fraction = 1.0 if said["state"] == "done" else float(progress.get("fraction", 0.0))
        STATE.jobs[address].update(state=said["state"], fraction=fraction, message=progress.get("message", ""))
        if said.get("error"):
            STATE.complain(f"{said['error']['detail']} {said['error'].get('advice', '')}".strip())


CLASSES = (Browse, Insert, Run, Cancel, Fetch, Load)
