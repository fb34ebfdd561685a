"""What the extension knows while Blender runs: the service, its families, work under way, jobs.

Classes of Blender's read their `__annotations__`, which hold calls: they are written out as what they are.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import bpy

from .client import Refused, Service
from .work import Work

__all__ = ["STATE", "Preferences", "State", "redraw"]

_LOCAL = ("127.0.0.1", "localhost", "::1")


class Preferences(bpy.types.AddonPreferences):
    """Where the service is, and with which token jobs are asked for."""

    bl_idname = __package__
    __annotations__ = {
        "address": bpy.props.StringProperty(
            name="Service", default="http://127.0.0.1:8765", description="Address of `wizen serve`"
        ),
        "token": bpy.props.StringProperty(
            name="Token", subtype="PASSWORD", description="For jobs: `wizen token create --name blender --scopes run`"
        ),
    }

    def draw(self, context: Any) -> None:
        """Show the two fields."""
        self.layout.prop(self, "address")
        self.layout.prop(self, "token")


class State:
    """One for the session."""

    def __init__(self) -> None:
        self.work = Work()
        self.maps: list[dict[str, Any]] = []
        self.solvers: dict[str, dict[str, Any]] = {}
        self.items: list[tuple[str, str, str, int, int]] = []
        self.said = self.trust = ""
        self.jobs: dict[str, dict[str, Any]] = {}
        self.asked: dict[str, tuple[Any, ...]] = {}
        self._previews: Any = None

    def service(self) -> Service:
        """Return the service that the preferences name.

        Raises:
            Refused: Blender is set to stay offline, and the service is elsewhere.

        """
        known = bpy.context.preferences.addons.get(__package__)
        address = known.preferences.address if known else "http://127.0.0.1:8765"
        token = known.preferences.token if known else ""
        if not bpy.app.online_access and urlsplit(address).hostname not in _LOCAL:
            raise Refused("Blender stays offline: allow online access in its preferences, or serve on this machine.")
        return Service(address, token)

    def begin(self, name: Any, call: Callable[[Service], Any], then: Callable[[Any], None]) -> None:
        """Ask the service in a thread; what it refuses is said in the panel."""
        try:
            service = self.service()
        except Refused as error:
            self.complain(str(error))
            return
        self.work.begin(name, lambda: call(service), then, self.complain)

    def complain(self, text: str) -> None:
        """Keep a sentence for the panel."""
        self.said = text

    def browse(self) -> None:
        """Fetch the families, their solvers and their pictures."""
        self.said = "asking the service..."
        self.begin("browse", _families, self._browsed)

    def _browsed(self, found: tuple[list[dict[str, Any]], dict[str, dict[str, Any]], dict[str, bytes]]) -> None:
        self.maps, self.solvers, pictures = found
        icons = self._icons(pictures)
        self.items = [
            (one["name"], one["name"], f"{one['solver']}: {', '.join(one['axes']) or 'one sample'}", icons[k], k)
            for k, one in enumerate(self.maps)
        ]
        self.said = f"{len(self.maps)} families"

    def _icons(self, pictures: dict[str, bytes]) -> list[int]:
        import bpy.utils.previews

        self.close()
        self._previews = bpy.utils.previews.new()
        found = []
        with tempfile.TemporaryDirectory(prefix="wizen-") as folder:
            for one in self.maps:
                path = Path(folder) / f"{one['name']}.png"
                path.write_bytes(pictures.get(one["name"], b""))
                icon = self._previews.load(one["name"], str(path), "IMAGE") if path.stat().st_size else None
                if icon is not None:
                    _ = icon.icon_size[0]  # reads the file while it is there
                found.append(icon.icon_id if icon is not None else 0)
        return found

    def family(self, name: str) -> dict[str, Any]:
        """Return a family by its name.

        Raises:
            Refused: there is none.

        """
        for one in self.maps:
            if one["name"] == name:
                return one
        raise Refused(f"There is no family {name!r}: press Browse.")

    def size(self, family: dict[str, Any]) -> float:
        """Return the length of r1 [m] of a family's fruit; 1 where any size is right."""
        sizes = self.solvers.get(family["solver"], {}).get("sizes", {})
        found = [sizes[name] for name in family["presets"] if name in sizes]
        return float(found[0]) if found else 1.0

    def close(self) -> None:
        """Let go of the pictures."""
        if self._previews is not None:
            import bpy.utils.previews

            with contextlib.suppress(KeyError):
                bpy.utils.previews.remove(self._previews)
            self._previews = None


STATE = State()


def _families(service: Service) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]], dict[str, bytes]]:
    maps = service.maps()
    solvers = {name: service.solver(name) for name in {one["solver"] for one in maps}}
    pictures = {}
    for one in maps:
        with contextlib.suppress(Refused):
            pictures[one["name"]] = service.thumbnail(one["links"]["thumbnail"])
    return maps, solvers, pictures


def redraw() -> None:
    """Have the panels drawn anew."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager else ():
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
