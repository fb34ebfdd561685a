"""The section as rods' cells: a Voronoi diagram of the rods' places, bounded by the bundle's hull.

Sutherland 2012, 5.1.1, with another boundary: the thesis takes the convex hull of points set off from the outer rods;
here it is a regular polygon with exactly the area of the disk that the rods' stiffness was balanced to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Voronoi, cKDTree

from ...contract import Context
from ..fibres.timber import timber
from ..model.outline import corners, stand
from ..params import WoodParams

__all__ = ["Section", "divided", "section"]

#: Corners of the hull.
_HULL = 72
#: Corners closer than this, over the mean radius of a rod, are one: slivers would show as creases.
_CLOSE = 0.05


class Section(NamedTuple):
    """Cells of k rods: cell r has the corners `corner[start[r] : start[r + 1]]`, counter-clockwise about +x.

    Side n of the n sides runs from its corner to the next one of its cell. Where it is no part of the hull, `mate` is
    the same side in the neighbour's cell, run backwards.
    """

    points: np.ndarray  # (k, 2) rods' places: y, z [m]
    places: np.ndarray  # (g, 2) corners [m]
    start: np.ndarray  # (k + 1,)
    corner: np.ndarray  # (n,) number of the corner
    following: np.ndarray  # (n,) the next side of the cell
    owner: np.ndarray  # (n,) rod
    mate: np.ndarray  # (n,) -1: the hull
    radius: float  # of the round rod of mean area [m]


def section(params: WoodParams) -> Section:
    """Return the cells of the rods that `bundle.lay` lays: the same draws, in the same order."""
    log = timber(params)
    points = stand(log, Context.generator(params.seed)).points
    if log.outline:
        return divided(points, log.wide, corners(log))
    return divided(points, log.wide)


def divided(points: np.ndarray, radius: float, outline: np.ndarray | None = None) -> Section:
    """Return the cells of points (k, 2) within a hull of the area of the disk of `radius`; all in metres.

    outline (m, 2): another hull of this area, convex or not, corners counter-clockwise.
    """
    turn = 2 * np.pi * np.arange(_HULL) / _HULL
    reach = radius * np.sqrt(2 * np.pi / (_HULL * np.sin(2 * np.pi / _HULL)))
    hull = reach * np.column_stack([np.cos(turn), np.sin(turn)])
    if outline is not None:
        hull = outline
        reach = float(np.hypot(*outline.T).max())
    cells = [hull]
    if len(points) > 1:
        raw = _cells(points, reach)
        # a clip must be convex, what is clipped need not be: cells are, an outline may not
        inner = np.linalg.norm(hull[0] + hull[1]) / 2 if outline is None else 0.0
        cells = [c if np.hypot(*c.T).max() < inner else _clipped(hull, c) for c in raw]
    mean = radius / np.sqrt(len(points))
    places, numbers = _merged(np.concatenate(cells), _CLOSE * mean)
    rings = []
    for ring in np.split(numbers, np.cumsum([len(cell) for cell in cells])[:-1]):
        rings.append(ring[ring != np.roll(ring, 1)])
    sizes = np.array([len(ring) for ring in rings])
    start = np.concatenate([[0], np.cumsum(sizes)])
    corner = np.concatenate(rings)
    owner = np.repeat(np.arange(len(points)), sizes)
    following = np.arange(len(corner)) + 1
    following[start[1:] - 1] = start[:-1]
    count = len(places)
    forth, back = corner * count + corner[following], corner[following] * count + corner
    order = np.argsort(forth)
    found = order[np.clip(np.searchsorted(forth, back, sorter=order), 0, len(order) - 1)]
    mate = np.where(forth[found] == back, found, -1)
    return Section(points, places, start, corner, following, owner, mate, float(mean))


def _cells(points: np.ndarray, reach: float) -> list[np.ndarray]:
    """Return the corners (m, 2) of every point's cell, counter-clockwise; four points far away close the outer ones."""
    far = 50 * reach * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    diagram = Voronoi(np.concatenate([points, far]))
    cells = []
    for number, point in enumerate(points):
        corners = diagram.vertices[diagram.regions[diagram.point_region[number]]]
        away = corners - point
        cells.append(corners[np.argsort(np.arctan2(away[:, 1], away[:, 0]))])
    return cells


def _clipped(cell: np.ndarray, hull: np.ndarray) -> np.ndarray:
    """Return the common part (m, 2) of a polygon and a convex hull (Sutherland and Hodgman 1974)."""
    for first, second in zip(hull, np.roll(hull, -1, 0), strict=True):
        along = second - first
        side = along[0] * (cell[:, 1] - first[1]) - along[1] * (cell[:, 0] - first[0])
        if (side >= 0).all():
            continue
        kept = []
        for n in range(len(cell)):
            m = (n + 1) % len(cell)
            if side[n] >= 0:
                kept.append(cell[n])
            if (side[n] >= 0) != (side[m] >= 0):
                kept.append(cell[n] + side[n] / (side[n] - side[m]) * (cell[m] - cell[n]))
        cell = np.array(kept)
    return cell


def _merged(places: np.ndarray, close: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct places (g, 2) and the number (n,) of each; what is closer than `close` [m] is one."""
    pairs = cKDTree(places).query_pairs(close, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(places), len(places)))
    count, numbers = connected_components(links, directed=False)
    # of corners that become one, the outermost stays, so that the hull keeps its area
    order = np.lexsort((np.hypot(*places.T), numbers))
    last = order[np.searchsorted(numbers[order], np.arange(count), side="right") - 1]
    return places[last], numbers
