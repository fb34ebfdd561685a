"""Shapes of a scene over time, and those that the asker has already.

A curve of stages is a morph target for each knot after the first, and weights that fade in straight lines from knot to
knot: what the table gives between two knots is not asked for. A mesh that is known already is left out of the file: in
its place stands one flat triangle, and its etag says which it is.
"""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.arrays import Array, Floats

from ..formats.about import GENERATOR
from .kinds import Kind

if TYPE_CHECKING:
    from .glb import _File
    from .meshes import Packed

__all__ = ["FPS", "etag", "known_vertices", "target_views", "weights"]

#: Frames of a second, where a format counts frames.
FPS = 24.0
_BYTE, _SHORT, _FLOAT = 5120, 5122, 5126
#: A target: what is added to positions and to normals, padded to four bytes, and to colours where they change.
_PARTS = [("position", "<i2", 4), ("normal", "i1", 4), ("colour", "i1", 4)]
_TARGET, _FADING = np.dtype(_PARTS[:2]), np.dtype(_PARTS)


def etag(kind: Kind, n: int) -> str:
    """Return what names the mesh of a kind at a level: what it is made of, so that it need not be made."""
    said = {
        "by": GENERATOR,
        **kind.made_of(n),
    }
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()[:16]


def known_vertices(vertex: np.dtype[Any]) -> Array:
    """Return the vertices of the triangle that stands for a mesh which the asker has."""
    return np.zeros(3, vertex)


def target_views(file: _File, base: Packed, later: list[Packed], fades: bool) -> list[dict[str, int]]:
    """Append the morph targets of a mesh and return them, as steps of the quantised base; `fades`: of colours too."""
    found = []
    for one in later:
        steps = np.zeros(len(base.vertices), _FADING if fades else _TARGET)
        gone = one.vertices["position"].astype(int) - base.vertices["position"]
        turned = one.vertices["normal"].astype(int) - base.vertices["normal"]
        # normalised bytes end at 1, and a normal that turns over goes 2: of such a target they are floats, apart
        far = bool(np.abs(turned).max() > 127)
        steps["position"] = np.clip(gone, -32767, 32767)
        steps["normal"] = 0 if far else turned
        if fades:
            changed = one.vertices["colour"].astype(float) - base.vertices["colour"]
            steps["colour"] = np.round(changed * (127 / 255))
        view = file.view(steps, "ATTRIBUTES", 34962)
        low, high = (getattr(steps["position"][:, :3], which)(axis=0).tolist() for which in ("min", "max"))
        found.append(
            {
                "POSITION": file.accessor(view, _SHORT, "VEC3", len(steps), 0, min=low, max=high),
                "NORMAL": _whole(file, turned[:, :3]) if far else _bytes(file, view, len(steps)),
            }
        )
        if fades:
            found[-1]["COLOR_0"] = file.accessor(view, _BYTE, "VEC4", len(steps), 12, normalized=True)
    return found


def _bytes(file: _File, view: int, count: int) -> int:
    return file.accessor(view, _BYTE, "VEC3", count, 8, normalized=True)


def _whole(file: _File, turned: Array) -> int:
    view = file.view((turned / 127).astype("<f4"), "ATTRIBUTES", 34962)
    return file.accessor(view, _FLOAT, "VEC3", len(turned))


def weights(file: _File, nodes: list[tuple[int, Kind]]) -> list[dict[str, Any]]:
    """Return the animation of nodes whose kinds have curves, as glTF lists it; none without."""
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    ready: dict[tuple[tuple[float, float], ...], int] = {}
    for node, kind in nodes:
        if kind.curve not in ready:
            times = np.array([at for at, _ in kind.curve], "<f4")
            values: Floats = np.eye(len(times))[:, 1:]
            source = file.view(times, "ATTRIBUTES", None), file.view(values.astype("<f4").ravel(), "ATTRIBUTES", None)
            first, last = [float(times[0])], [float(times[-1])]
            ready[kind.curve] = len(samplers)
            samplers.append(
                {
                    "input": file.accessor(source[0], _FLOAT, "SCALAR", len(times), min=first, max=last),
                    "output": file.accessor(source[1], _FLOAT, "SCALAR", values.size),
                    "interpolation": "LINEAR",
                }
            )
        channels.append({"sampler": ready[kind.curve], "target": {"node": node, "path": "weights"}})
    return [{"name": "stages", "samplers": samplers, "channels": channels}] if channels else []
