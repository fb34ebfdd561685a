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
    """Return what stands at the poles of a fruit's lattice, where all is asked for and its own colours are shown."""
    known = colours.looks(sequence.run)
    if not options.full or known.parts is None or not sequence.lattice or sequence.colour != "auto":
        return []
    index = sequence.index_of(surface)
    stage = {name: sequence.run[name].values[index] for name in known.scalars if name in sequence.run}
    return [_placed(part, sequence, surface) for part in known.parts(stage, sequence.params)]


def _placed(part: Part, sequence: Sequence, surface: Surface) -> Extra:
    """Return a part at its pole: y along the mean normal about it, as large as in the fresh fruit."""
    n = sequence.lattice
    count = 2 * n * n
    out, right, ahead = _frame(surface.normals(), n, part.pole)
    frame = np.stack([right, out, ahead])
    foot = surface.vertices[count + part.pole].astype(float)
    points = foot + sequence.scale * (part.points @ frame)
    upright = normals(points, part.triangles)
    single: Many[Array] = [np.asarray(values, "f4") for values in (points, np.clip(part.colour, 0, 1), upright)]
    return Extra(part.name, single[0], np.asarray(part.triangles, "u4"), single[1], single[2], part.roughness)


def _frame(upright: Array, n: int, pole: int) -> tuple[Floats, Floats, Floats]:
    """Return unit vectors: the mean normal of the rows next to a pole, along azimuth 0, and across both."""
    rows = upright[: 2 * n * n].reshape(n, 2 * n, 3)
    near = rows[: max(n // 16, 1)] if pole == 0 else rows[-max(n // 16, 1) :]
    out = near.reshape(-1, 3).mean(axis=0).astype(float)
    out /= max(float(np.linalg.norm(out)), 1e-12)
    other = np.array([1.0, 0.0, 0.0]) if abs(out[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    ahead = np.cross(other, out)
    ahead /= np.linalg.norm(ahead)
    return out, np.cross(out, ahead), ahead
