"""Pictures of presets that come with wizen: what a preset makes, for people who have not run it yet.

`python -m service.portraits.make` draws them; each says of which version, quality and stage it is.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

__all__ = ["DRAWN", "png", "said"]

#: Directory of the pictures, and of the index that says what they are of.
DRAWN = Path(__file__).parent / "drawn"


@cache
def _index() -> dict[str, dict[str, dict[str, Any]]]:
    try:
        found: dict[str, dict[str, dict[str, Any]]] = json.loads((DRAWN / "index.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}  # pictures are no part of what has to work
    return found


def said(solver: str) -> dict[str, dict[str, Any]]:
    """Return what is known of a solver's pictures, by preset: version, quality and stage."""
    return _index().get(solver, {})


def png(solver: str, preset: str) -> bytes | None:
    """Return a preset's picture, or nothing where there is none."""
    if preset not in said(solver):
        return None
    try:
        return (DRAWN / solver / f"{preset}.png").read_bytes()
    except OSError:
        return None
