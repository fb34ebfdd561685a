"""The rooms of the page, their addresses, and how one waits until they show what they are for."""

from __future__ import annotations

import pytest

from .._browser import MARKS, ROOT, Visit

__all__ = ["AXE", "ROOMS", "SIZES", "SLOW", "arrived", "at"]

AXE = ROOT / "service" / "viewer" / "node_modules" / "axe-core" / "axe.min.js"
SIZES = {"desktop": (1440, 900), "tablet": (1024, 768), "phone": (390, 844)}
ROOMS = {
    "gallery": "room=gallery",
    "dry": "s=0.2",
    "rot": "room=decay",
    "grow": "room=growth",
    "live": "room=growth&live=1",
    "break": "room=wood",
    "scene": "room=scene&rule=scatter&count=9",
}

# shaders are compiled and scenes drawn in software here: beside other work that takes minutes
SLOW = [*MARKS, pytest.mark.timeout(900)]


def at(studio: str, words: str) -> str:
    return f"{studio}&{words}"


def arrived(visit: Visit, room: str) -> None:
    """Wait until a room shows what it is for."""
    if room == "live":
        visit.page.get_by_role("button", name="Begin").click()
    if room == "gallery":
        visit.page.locator(".cards li").first.wait_for()
    else:
        visit.shown()
