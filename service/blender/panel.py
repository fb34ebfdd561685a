"""The panel beside the 3D view: families, the chosen fruit's sliders, jobs."""

from __future__ import annotations

from typing import Any

import bpy

from . import fruit
from .state import STATE

__all__ = ["CLASSES"]


class Panel(bpy.types.Panel):
    """Families, sliders, jobs."""

    bl_idname, bl_label = "VIEW3D_PT_wizen", "Wizen"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "Wizen"

    def draw(self, context: Any) -> None:
        """Draw it; nothing here waits."""
        layout = self.layout
        layout.operator("wizen.browse", icon="FILE_REFRESH")
        if STATE.items:
            layout.template_icon_view(context.window_manager, "wizen_family", show_labels=True)
            layout.operator("wizen.insert", icon="ADD").family = context.window_manager.wizen_family
        if fruit.is_fruit(context.object):
            self._sliders(layout, context.object)
        layout.operator("wizen.load", icon="IMPORT")
        for address, job in STATE.jobs.items():
            self._job(layout, address, job)
        column = layout.column(align=True)
        for line in (*_lines(STATE.trust), *_lines(STATE.said)):
            column.label(text=line)

    def _sliders(self, layout: Any, thing: Any) -> None:
        column = layout.column(align=True)
        for axis in fruit.sliders(thing):
            column.prop(thing, f'["{bpy.utils.escape_identifier(axis)}"]', text=axis, slider=True)
        column.prop(thing, '["wizen_n"]', text="colatitudes")
        layout.operator("wizen.run", icon="PLAY")

    def _job(self, layout: Any, address: str, job: dict[str, Any]) -> None:
        row = layout.row(align=True)
        row.progress(factor=job["fraction"], text=f"{job['name']}: {job['state']}")
        if job["state"] == "done":
            row.operator("wizen.fetch", text="", icon="IMPORT").address = address
        elif job["state"] not in ("failed", "cancelled"):
            row.operator("wizen.cancel", text="", icon="X").address = address


def _lines(text: str, width: int = 44) -> list[str]:
    found = [""]
    for word in text.split():
        if len(found[-1]) + len(word) > width:
            found.append("")
        found[-1] = f"{found[-1]} {word}".strip()
    return found


CLASSES = (Panel,)
