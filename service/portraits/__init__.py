"""Pictures that come with wizen: of presets, for people who have not run them yet, and of the package's own tables.

`python -m benchmarks.portraits` draws them; a preset's says of which version, quality and stage it is, and a table's
bears the beginning of the digest of what it shows.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

__all__ = ["DRAWN", "of_table", "png", "said", "table_file"]

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


def table_file(digest: str) -> Path:
    """Return where the picture of a table's generation is, if it has one."""
    return DRAWN / "tables" / f"{digest[:12]}.png"


def of_table(digest: str) -> bytes | None:
    """Return the picture of a table's generation, or nothing where none comes with wizen."""
    try:
        return table_file(digest).read_bytes()
    except OSError:
        return None
