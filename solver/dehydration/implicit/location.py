"""Where a fresh point of the fruit lies in the mesh: element and local coordinates."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Ints
from ...fem import HEX27
from ..fresh.mesh import _FACES as FACES
from ..params import DehydrationParams
from .mesh import Band, QuadraticMesh
from .upright import parametric, slanted

__all__ = ["fold", "interpolate", "locate", "nominal"]


_NUDGE = 1e-9
"""Points on a symmetry plane are looked up this far inside, so that round-off does not put them beyond it."""
_ROUND = 1e-3
"""Share of a cell, or of the flesh, by which a point may lie beyond an edge and still be on it."""


def fold(mesh: QuadraticMesh, points: Floats) -> tuple[Floats, Floats]:
    """Return points (k, 3) mirrored into the mesh's part of the fruit, and the signs (k, 3) that mirror back."""
    signs = np.ones_like(points)
    for axis in mesh.planes:
        signs[:, axis] = np.where(points[:, axis] < 0, -1.0, 1.0)
    return points * signs, signs


def _first_guess(params: DehydrationParams, mesh: QuadraticMesh, points: Floats) -> tuple[Ints, Floats]:
    towards = parametric(params, points)
    for axis in mesh.planes:
        towards[:, axis] = np.maximum(towards[:, axis], _NUDGE)
    stack, across = _on_cube(mesh, towards) if mesh.band is None else _in_band(mesh, mesh.band, towards)
    distance = np.linalg.norm(points, axis=1)
    rays = points / np.maximum(distance, 1e-300)[:, None]
    stone = params.stone_distance(rays)
    colatitude = np.arccos(np.clip(towards[:, 1], -1, 1))
    outer = np.linalg.norm(params.sarcocarp(colatitude, np.arctan2(towards[:, 2], towards[:, 0])), axis=1)
    depth = np.where(
        distance <= outer, (distance - stone) / (outer - stone), 1 + (distance - outer) / params.exocarp_thickness
    )
    layer = np.clip(np.searchsorted(mesh.breaks, depth, side="right") - 1, 0, mesh.layers - 1)
    low, high = mesh.breaks[layer], mesh.breaks[layer + 1]
    local = np.concatenate([across, (2 * (depth - low) / (high - low) - 1)[:, None]], axis=1)
    above = (mesh.breaks[0] == 0) | (depth > mesh.breaks[0] - _ROUND)
    return np.where(above, stack * mesh.layers + layer, -1), local


def _on_cube(mesh: QuadraticMesh, towards: Floats) -> tuple[Ints, Floats]:
    """Return stack (k,) and local coordinates (k, 2) across of directions (k, 3) on the parametric sphere."""
    heights = towards @ FACES[:, 0].T
    face = np.argmax(heights, axis=1)
    axes = FACES[face]
    angles = np.stack(
        [np.arctan2(np.einsum("pi,pi->p", towards, axes[:, k]), heights.max(axis=1)) for k in (1, 2)], axis=-1
    )
    n = len(mesh.quad_of[0])
    cells = (angles + np.pi / 4) * (2 * n / np.pi)
    cell = np.clip(np.floor(cells).astype(np.int64), 0, n - 1)
    return mesh.quad_of[face, cell[:, 0], cell[:, 1]], 2 * (cells - cell) - 1


def _in_band(mesh: QuadraticMesh, band: Band, towards: Floats) -> tuple[Ints, Floats]:
    """Return what `_on_cube` returns; the stack is negative beyond the band."""
    angles = np.stack(
        [np.arctan2(towards[:, 2], towards[:, 0]), np.arccos(np.clip(towards[:, 1], -1, 1))], axis=-1
    )  # fmt: skip
    begin, end = np.array([band.first, band.high]), np.array([band.last, band.low])
    count = np.array([band.cells, band.rows])
    cells = (angles - begin) / (end - begin) * count
    cell = np.clip(np.floor(cells).astype(np.int64), 0, count - 1)
    inside = ((cells > -_ROUND) & (cells < count + _ROUND)).all(axis=1)
    return np.where(inside, mesh.quad_of[0, cell[:, 0], cell[:, 1]], -1), 2 * (cells - cell) - 1


def nominal(params: DehydrationParams, mesh: QuadraticMesh, points: Floats) -> tuple[Ints, Floats]:
    """Return element (k,) and local coordinates (k, 3) of fresh points (k, 3) by direction and share of depth.

    What is carried from mesh to mesh goes by these. A coarse mesh's polynomial faces miss the fruit's surface by as
    much as a thin skin is thick (wolfberry): at their place in space, points of the skin lie in the flesh, and the
    skin between two of them comes out a quarter too thick or too thin. The element is negative beyond a patch.
    """
    straight = points if mesh.foot is None else slanted(params, points, mesh.foot)
    return _first_guess(params, mesh, straight)


def locate(params: DehydrationParams, mesh: QuadraticMesh, points: Floats) -> tuple[Ints, Floats]:
    """Return element (k,) and local coordinates (k, 3) of fresh points (k, 3) inside the mesh's part (see `fold`).

    The element is that of the point's column and depth; local coordinates then solve X(xi) = point, and may reach a
    little beyond +-1 where the polynomial faces miss the fruit's surface. The element is negative beyond a patch.
    """
    element, local = nominal(params, mesh, points)
    inside = np.flatnonzero(element >= 0)
    corners, target, at = mesh.positions[mesh.connectivity[element[inside]]], points[inside], local[inside]
    for _ in range(4):
        gap = target - np.matmul(HEX27.shape(at)[:, None], corners)[:, 0]
        jacobian = np.matmul(corners.swapaxes(1, 2), HEX27.gradients(at))
        at = np.clip(at + np.linalg.solve(jacobian, gap[..., None])[..., 0], -1.5, 1.5)
    local[inside] = at
    return element, local


def interpolate(params: DehydrationParams, mesh: QuadraticMesh, nodal: Floats, points: Floats) -> Floats:
    """Return a field of nodal values (nn, 3) at fresh points (k, 3) of the mesh's part, 0 beyond a patch.

    At the same share of depth: a thin skin's nodes must not come out in another layer (see `nominal`).
    """
    element, local = nominal(params, mesh, points)
    found, inside = np.zeros_like(points), np.flatnonzero(element >= 0)
    if not len(inside):
        return found
    shape = HEX27.shape(local[inside])[:, None]
    found[inside] = np.matmul(shape, nodal[mesh.connectivity[element[inside]]])[:, 0]
    return found
