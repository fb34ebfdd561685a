"""File formats of a shape: name -> `Format`, the choice between them, and `write`.

A new format is its own module with `encode(surface, about) -> bytes`, one line in `FORMATS`, and one test that reads
its output with a reader that is not ours.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import mimeparse

from ..errors import InvalidQuery, NotAcceptable, Wrong
from . import glb, metadata, npz, obj, points
from .about import About

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["FORMATS", "About", "Format", "best", "negotiate", "write"]


class Format(NamedTuple):
    """A representation: its name in `?format=`, its media type and suffix, and what it needs of the look-up."""

    name: str
    media_type: str
    suffix: str
    title: str
    fields: tuple[str, ...]
    encode: Callable[[Shape, About], bytes]


#: In order of growing preference: the last one answers those who accept anything.
FORMATS: Mapping[str, Format] = {
    f.name: f
    for f in (
        Format(
            "points", "application/vnd.wizen.points", ".wzp", "positions for live views", ("position",), points.encode
        ),
        Format("obj", "model/obj", ".obj", "Wavefront OBJ", ("position",), obj.encode),
        Format("npz", "application/x-npz", ".npz", "NumPy archive", ("position", "displacement"), npz.encode),
        Format("glb", "model/gltf-binary", ".glb", "binary glTF 2.0", ("position",), glb.encode),
        Format("json", "application/json", ".json", "numbers about the shape", (), metadata.encode),
    )
}


def negotiate(accept: str | None, explicit: str | None = None) -> Format:
    """Return the format named by `explicit`, else the best for an Accept header, q-values honoured.

    Raises:
        InvalidQuery: `explicit` names no format.
        NotAcceptable: nothing in `accept` can be had.

    """
    if explicit is not None:
        if explicit not in FORMATS:
            near = difflib.get_close_matches(explicit, list(FORMATS), n=1)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            advice = f"{hint}Formats: {', '.join(FORMATS)}."
            raise InvalidQuery.of([Wrong("format", f"there is no format {explicit!r}", advice)])
        return FORMATS[explicit]
    by_type = {f.media_type: f for f in FORMATS.values()}
    return by_type[best(accept, by_type)]


def best(accept: str | None, by_type: Mapping[str, Format]) -> str:
    """Return the media type that fits an Accept header best, the last one of equals.

    Raises:
        NotAcceptable: none does.

    """
    try:
        found = mimeparse.best_match(list(by_type), (accept or "").strip().lower() or "*/*")
    except mimeparse.MimeTypeParseException:
        found = ""
    if not found:
        listed = ", ".join(f"{media_type} (format={f.name})" for media_type, f in by_type.items())
        raise NotAcceptable(f"no representation fits Accept: {accept}.", advice=f"Ask for one of {listed}.")
    return str(found)


def write(shape: Shape, fmt: str | Format, about: About | None = None) -> bytes:
    """Return the shape as a file's bytes. `fmt` is a format or its name.

    Raises:
        InvalidQuery: there is no format of that name.

    """
    chosen = fmt if isinstance(fmt, Format) else negotiate(None, fmt)
    return chosen.encode(shape, about or About())
