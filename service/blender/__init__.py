"""Wizen in Blender: fruits of a service's tables with sliders, jobs with progress, results as shape keys.

Nothing waits in Blender's own thread: the service is asked in threads, and a timer hands over what has come.
"""

from __future__ import annotations

import time

import bpy

from . import fruit, operators, panel
from .state import STATE, Preferences, redraw

__all__ = ["register", "unregister"]

_CLASSES = (Preferences, *operators.CLASSES, *panel.CLASSES)
#: Between two looks [s]: while there are fruits or work, and else; and between two looks at jobs.
_OFTEN, _SELDOM, _JOBS = 0.03, 0.5, 1.0
_looked = [0.0]


def _tick() -> float:
    """Hand over what has come, and ask for what the sliders say by now."""
    came = STATE.work.settle()
    fruits = fruit.follow()
    if time.monotonic() - _looked[0] > _JOBS:
        _looked[0] = time.monotonic()
        operators.poll()
    if came:
        redraw()
    return _OFTEN if fruits or STATE.work.busy else _SELDOM


def register() -> None:
    """Add the extension."""
    for one in _CLASSES:
        bpy.utils.register_class(one)
    bpy.types.WindowManager.wizen_family = bpy.props.EnumProperty(name="Family", items=operators._families)
    bpy.app.timers.register(_tick, persistent=True)


def unregister() -> None:
    """Remove it, and let nothing arrive any more."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    STATE.work.forget()
    STATE.close()
    del bpy.types.WindowManager.wizen_family
    for one in reversed(_CLASSES):
        bpy.utils.unregister_class(one)
