"""Which choices mean something for which format of a result: the others are refused, and not passed over."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from ..errors import InvalidQuery, Wrong

__all__ = ["check"]

_MESH = ("colour", "scale", "cut")
_TIMED = ("fps", "step")
_MAP = ("map", "size", "cut")
_ENDS = ("low", "high")

#: By format. `scale` is of files for other programs: what is read as numbers has lengths of r1, as `units` says.
_KNOWN: Mapping[str, tuple[str, ...]] = {
    "netcdf": (),
    "json": ("stage", "fields"),
    "glb": ("stage", *_MESH, "textures", "threads"),
    "obj": ("stage", *_MESH),
    "animation": ("stage", *_MESH, *_TIMED, "textures", "threads"),
    "usda": ("stage", *_MESH, *_TIMED, "threads"),
    "usdc": ("stage", *_MESH, *_TIMED, "threads"),
    "usdz": ("stage", *_MESH, *_TIMED, "textures", "threads"),
    "pc2": ("stage", "scale", "cut", "step"),
    "mdd": ("stage", "scale", "cut", *_TIMED),
    "ply": ("stage", *_MESH),
    "ply-zip": ("stage", *_MESH),
    "obj-zip": ("stage", *_MESH),
    "png": ("stage", *_MAP, *_ENDS),
    "png-zip": ("stage", *_MAP, *_ENDS),
    "exr": ("stage", *_MAP),
    "npz": ("stage",),
    "points": ("stage",),
}


def check(chosen: str, given: Collection[str], **more: object) -> None:
    """Refuse choices, and `more` that are not None, that a format does not take.

    Raises:
        InvalidQuery: with each of them, and the formats that take it.

    """
    wrong = []
    for name in sorted({*given, *(name for name, value in more.items() if value is not None)}):
        if name not in _KNOWN[chosen]:
            others = ", ".join(other for other, known in _KNOWN.items() if name in known)
            wrong.append(
                Wrong(
                    name,
                    f"means nothing for format={chosen}",
                    f"Leave {name} out, or ask for one of {others} (format=).",
                )
            )
    if wrong:
        raise InvalidQuery.of(wrong)
