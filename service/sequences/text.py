"""One stage as PLY (binary) or OBJ (text), and all of them as a zip with a table of the stages.

PLY: colours as 8-bit sRGB, fields of the vertices as further float properties, texture coordinates of a mesh that came
with some as `texcoord` of the faces, six numbers each, v upwards. OBJ: colours after the position (as
Blender and MeshLab read them, sRGB from 0 to 1), texture coordinates where there are any, no normals; a triangle is in
the groups (`g`) that its corners belong to by more than half, on the mean, and of the material (`usemtl`) that it had.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import orjson

from sweeps.pictures import colours

from ..formats.about import GENERATOR
from .options import Options

if TYPE_CHECKING:
    from .view import Sequence, Surface

__all__ = ["obj", "obj_zip", "ply", "ply_zip"]

#: What zip writes as the date of every file: equal results give equal bytes.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def ply(sequence: Sequence, options: Options) -> bytes:
    """Return the one stage of a sequence as a binary little-endian PLY file."""
    return _ply(sequence, next(iter(sequence)))


def obj(sequence: Sequence, options: Options) -> bytes:
    """Return the one stage of a sequence as an OBJ file."""
    return _obj(sequence, next(iter(sequence)))


def _ply(sequence: Sequence, surface: Surface) -> bytes:
    columns: list[tuple[str, str, np.ndarray]] = [
        (axis, "float", surface.vertices[:, k]) for k, axis in enumerate("xyz")
    ]
    normals = surface.normals()
    columns += [(axis, "float", normals[:, k]) for k, axis in enumerate(("nx", "ny", "nz"))]
    if surface.colour is not None:
        shown = colours.encoded(surface.colour)
        columns += [(name, "uchar", shown[:, k]) for k, name in enumerate(("red", "green", "blue"))]
    # what colours are made of is there already
    taken = {name for name, _, _ in columns}
    columns += [(name, "float", values) for name, values in surface.fields.items() if name not in taken]
    rows = np.empty(len(surface.vertices), [(n, "<f4" if kind == "float" else "u1") for n, kind, _ in columns])
    for name, _, values in columns:
        rows[name] = values
    # those of a mesh that came with some; a lattice's follow from its vertices
    seam = surface.seam or (None if sequence.lattice else sequence.seam)
    parts = [("count", "u1"), ("corner", "<i4", 3)] + ([] if seam is None else [("six", "u1"), ("uv", "<f4", 6)])
    faces = np.empty(len(surface.triangles), parts)
    faces["count"], faces["corner"] = 3, surface.triangles
    if seam is not None:
        faces["six"], faces["uv"] = 6, (seam.uv * [1, -1] + [0, 1])[seam.triangles].reshape(-1, 6)
    head = ["ply", "format binary_little_endian 1.0"]
    head += [f"comment {line}" for line in _said(sequence, surface)]
    head += [f"element vertex {len(rows)}", *(f"property {kind} {name}" for name, kind, _ in columns)]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    head += ["end_header", ""] if seam is None else ["property list uchar float texcoord", "end_header", ""]
    return "\n".join(head).encode("ascii", "replace") + rows.tobytes() + faces.tobytes()


def _obj(sequence: Sequence, surface: Surface) -> bytes:
    parts = ["".join(f"# {line}\n" for line in _said(sequence, surface)).encode()]
    parts.append(f"o {sequence.about['solver'] or 'result'}\n".encode())
    points = surface.vertices
    if surface.colour is not None:
        points = np.column_stack([points, (colours.encoded(surface.colour) / 255).astype("f4")])
    parts.append(_rows(b"v", points))
    corners = surface.triangles.astype(np.int64) + 1
    seam = surface.seam or sequence.seam
    if seam is not None:
        parts.append(_rows(b"vt", np.column_stack([seam.uv[:, 0], 1 - seam.uv[:, 1]])))
        corners = np.stack([corners, seam.triangles.astype(np.int64) + 1], axis=-1).reshape(-1, 6)
    line = b"f %d %d %d\n" if seam is None else b"f %d/%d %d/%d %d/%d\n"
    for head, some in _parted(sequence, surface):
        parts.append(head)
        parts.append((line * len(corners[some])) % tuple(corners[some].ravel().tolist()))
    return b"".join(parts)


def _parted(sequence: Sequence, surface: Surface) -> Iterator[tuple[bytes, slice]]:
    """Yield which triangles in a row are in the same groups and of one material, and the lines that say in which."""
    count = len(surface.triangles)
    names, owned = sequence.named(surface)
    inside = np.empty((count, 0), bool)
    if surface.groups:
        inside = np.stack([surface.fields[name] for name in surface.groups], -1)[surface.triangles].mean(axis=1) > 0.5
    alike = np.column_stack([inside, owned])
    starts = np.flatnonzero((alike[1:] != alike[:-1]).any(axis=1)) + 1
    for begin, end in pairwise([0, *starts.tolist(), count]):
        found = [name for name, there in zip(surface.groups, inside[begin], strict=True) if there]
        group = f"g {' '.join(found) or 'off'}\n" if surface.groups else ""
        # a name ends with its line
        worn = f"usemtl {' '.join(names[owned[begin]].split()) or 'skin'}\n" if names else ""
        yield (group + worn).encode(), slice(begin, end)


def _said(sequence: Sequence, surface: Surface) -> list[str]:
    about = sequence.about
    return [
        GENERATOR,
        f"solver {about['solver']}, stage {surface.stage:g} {about['stages']['units']}",
        f"lengths in units of {about['units']['length']}; y is up",
    ]


def _rows(word: bytes, array: np.ndarray) -> bytes:
    """Return one line per row; orjson writes the shortest digits that read back as the same number."""
    if not len(array):
        return b""
    rows = orjson.dumps(np.ascontiguousarray(array), option=orjson.OPT_SERIALIZE_NUMPY)[2:-2]
    return word + b" " + rows.replace(b"],[", b"\n" + word + b" ").replace(b",", b" ") + b"\n"


def _zipped(suffix: str, encode: Callable[[Sequence, Surface], bytes], sequence: Sequence, options: Options) -> bytes:
    """Return a zip of one file per stage, `stage_0001` onwards, and `stages.json`, which says what they are."""
    out = io.BytesIO()
    names = [f"stage_{number + 1:04d}.{suffix}" for number in range(len(sequence))]
    about = {**sequence.about, "generator": GENERATOR, "files": dict(zip(names, sequence.stages, strict=True))}
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(zipfile.ZipInfo("stages.json", _EPOCH), json.dumps(about, indent=1))
        for name, surface in zip(names, sequence, strict=True):
            info = zipfile.ZipInfo(name, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, encode(sequence, surface))
    return out.getvalue()


ply_zip, obj_zip = partial(_zipped, "ply", _ply), partial(_zipped, "obj", _obj)
