"""What stands on a stage's surface as meshes of its own: stem and calyx at the poles, and threads as cards."""

from __future__ import annotations

from collections.abc import Sequence as Many
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.arrays import Array, Floats, Singles, Words32
from solver.contract import Part
from sweeps.pictures import colours
from sweeps.pictures.fur import ribbons
from sweeps.pictures.raster import normals

from .options import Options

if TYPE_CHECKING:
    from .view import Sequence, Surface

__all__ = ["Extra", "cards", "stems"]


class Extra(NamedTuple):
    """Vertices, colours in linear light and normals (v, 3), triangles (f, 3); seen from both sides."""

    name: str
    vertices: Singles
    triangles: Words32
    colour: Singles
    normals: Singles
    roughness: float


def cards(sequence: Sequence, surface: Surface, options: Options) -> Extra | None:
    """Return the threads on a surface as ribbons and heads; None where there are none."""
    threads = sequence.threads(surface, options.grown)
    if threads is None or not len(threads.points):
        return None
    points, faces, colour, upright = ribbons(threads)
    single = (np.asarray(part, "f4") for part in (points, np.clip(colour, 0, 1), upright))
    vertices, paint, straight = single
    return Extra("hyphae", vertices, faces.astype("u4"), paint, straight, 1.0)


def stems(sequence: Sequence, surface: Surface, options: Options) -> list[Extra]:
    """Return what stands on a surface, where all is asked for and its own colours are shown: one mesh for each name."""
    known, run = colours.looks(sequence.run), sequence.run
    if not options.full or known.parts is None or sequence.colour != "auto" or not sequence.kept:
        return []
    index = sequence.index_of(surface)
    stage = {name: run[name].values[index] for name in known.scalars if name in run}
    stage |= {name: run[name].values for name in known.constants if name in run}
    upright = surface.normals()
    found: dict[str, list[Extra]] = {}
    for part in known.parts(stage, sequence.params):
        # at a pole of the lattice, or at a vertex of a mesh
        if sequence.lattice or part.vertex is not None or part.pole < 0:
            found.setdefault(part.name, []).append(_placed(part, sequence, surface, upright))
    return [_joined(alike) for alike in found.values()]


def _joined(alike: Many[Extra]) -> Extra:
    """Return several small meshes as one."""
    first = np.cumsum([0, *(len(one.vertices) for one in alike[:-1])])
    triangles = np.concatenate([one.triangles + np.uint32(k) for one, k in zip(alike, first, strict=True)])
    vertices, colour, upright = (
        np.concatenate([getattr(one, name) for one in alike]) for name in ("vertices", "colour", "normals")
    )
    return alike[0]._replace(vertices=vertices, triangles=triangles, colour=colour, normals=upright)


def _placed(part: Part, sequence: Sequence, surface: Surface, upright: Array) -> Extra:
    """Return a part where it stands: y along the mean normal about it, as large as in the fresh fruit."""
    n = sequence.lattice
    count = 2 * n * n
    if part.pole < 0:
        foot, out = np.zeros(3), np.array([0.0, 1.0, 0.0])
    elif part.vertex is None:
        foot, out = surface.vertices[count + part.pole].astype(float), _upwards(upright, n, part.pole)
    else:
        foot, out = surface.vertices[part.vertex].astype(float), upright[part.vertex].astype(float)
    right, ahead = _across(out)
    frame = np.stack([right, out, ahead])
    points = foot + sequence.scale * (part.points @ frame)
    upright = normals(points, part.triangles)
    # tips of sepals are triangles without area, which say no side
    upright[np.linalg.norm(upright, axis=1) < 0.5] = out
    single: Many[Array] = [np.asarray(values, "f4") for values in (points, np.clip(part.colour, 0, 1), upright)]
    return Extra(part.name, single[0], np.asarray(part.triangles, "u4"), single[1], single[2], part.roughness)


def _upwards(upright: Array, n: int, pole: int) -> Floats:
    """Return the mean normal (3) of the rows next to a pole of the lattice."""
    rows = upright[: 2 * n * n].reshape(n, 2 * n, 3)
    near = rows[: max(n // 16, 1)] if pole == 0 else rows[-max(n // 16, 1) :]
    out = near.reshape(-1, 3).mean(axis=0).astype(float)
    found: Floats = out / max(float(np.linalg.norm(out)), 1e-12)
    return found


def _across(out: Floats) -> tuple[Floats, Floats]:
    """Return unit vectors along azimuth 0 and across, at right angles to a unit vector."""
    other = np.array([1.0, 0.0, 0.0]) if abs(out[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    ahead = np.cross(other, out)
    ahead /= np.linalg.norm(ahead)
    return np.cross(out, ahead), ahead
