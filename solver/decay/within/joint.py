"""Skin and flesh as one medium: the surface's vertices stand for the outermost flesh, tetrahedra for the rest.

All of it is one graph of points that have a volume and edges that something flows along, so that what grows on a
surface grows in the flesh by the same code, and what leaves the one comes into the other to round-off. The outermost
flesh is so thin (`Within.skin`) that a vertex stands for all of it below its own area; the tetrahedra fill what is
left, drawn towards the middle by as much. They are of a cubic lattice cut at the surface (isosurface stuffing), whose
edges inside all have positive weights, so that there a flux always runs from much to little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

from ...arrays import Floats, Ints
from ...contract import InvalidGeometry
from ...fruit import Fruit
from ...geometry.nearest import nearest
from ...geometry.stuffing import boundary, stuffed, touched
from ...geometry.tetrahedra import edges
from ..body.rind import rind
from ..surfaces.imported import extent_of
from ..surfaces.surface import Surface

__all__ = ["Joint", "joined"]

#: Points of the lattice in a cube of it.
_PER_CUBE = 2.0
#: Refinements of a lattice that is too coarse for a thin mesh.
_TRIES, _FINER = 4, 1.3
#: The most tetrahedra of a refined lattice that a mesh may touch: what needs more has more points than steps are for.
_TOUCHED = 4e6
#: No vertex may lie farther from the flesh than so many edges of the lattice.
_FAR = 1.5


@dataclass(frozen=True, eq=False)
class Joint(Surface):
    """A surface's vertices (v), then the flesh's points (p); `area` is volume here [r1^3], `faces` are the surface's.

    cover: the surface alone. tets (t, 4): the flesh's, numbered among its own points. core (c, 3): points of stone or
    core alone, in which nothing lives; cells (t + d, 4): all tetrahedra, the core's points numbered after the flesh's.
    """

    cover: Surface
    tets: Ints
    core: Floats
    cells: Ints

    @property
    def skin(self) -> Surface:
        """The surface alone, whose vertices come first."""
        return self.cover

    @property
    def flesh(self) -> Floats:
        """Points (p, 3) of the flesh."""
        return self.points[len(self.cover.points) :]


def joined(
    surface: Surface, count: int, thickness: float, fruit: Fruit | None = None, behind: float | None = None
) -> Joint:
    """Return a surface and about `count` points of the flesh below it as one medium.

    thickness: of the outermost flesh [r1]. fruit: the one whose stone is no flesh; behind: thickness of the flesh
    behind an open mesh.

    Raises:
        InvalidGeometry: the mesh is too thin somewhere to hold flesh, or open and not fit for a rind.

    """
    points, faces = surface.points, surface.faces
    closed = extent_of(surface)
    if closed is None:
        points, faces = rind(points, faces, behind or 0.15)
    flesh, tets = _filled(points, faces, surface.points, count)
    core, cells = flesh[:0], tets
    if fruit is not None and fruit.has_stone:
        flesh, tets, core, cells = _parted(flesh, tets, fruit)
    links = edges(flesh, tets)
    # the flesh gives the outermost flesh its room, and is as much smaller
    less = 1 - thickness * surface.total(1.0) / float(links.volume.sum())
    if less < 0.5:
        raise InvalidGeometry(
            "the outermost flesh is thicker than what is left below it.", advice="Take a smaller within.skin."
        )
    # where all that there is ends: no skin lies over what the flesh has at its core
    outside, above = boundary(cells), len(surface.points)
    over, under, share = _met(surface.points, flesh, outside[(outside < len(flesh)).all(axis=1)])
    rows = np.repeat(np.arange(above), np.diff(surface.start))
    keep = rows < surface.near
    # half of the outermost flesh lies between its middle and the rest
    through = (2 / thickness) * surface.area[over] * share
    ends = np.concatenate(
        [
            np.stack([rows[keep], surface.near[keep]], axis=1),
            np.stack([over, above + under], axis=1),
            above + links.ends,
        ]
    )
    weight = np.concatenate([thickness * surface.weight[keep], through, np.cbrt(less) * links.weight])
    volume = np.concatenate([thickness * surface.area, less * links.volume])
    _evened(volume, ends, np.abs(weight), above)
    one_way = sparse.csr_array((weight, (ends[:, 0], ends[:, 1])), shape=(len(volume),) * 2)
    graph = sparse.csr_array(one_way + one_way.T)
    graph.sort_indices()
    return Joint(
        np.concatenate([surface.points, flesh]),
        surface.faces,
        volume,
        graph.indptr.astype(np.int64),
        graph.indices.astype(np.int64),
        graph.data,
        float((2 * abs(graph).sum(axis=1) / volume).max()),
        surface,
        tets,
        core,
        cells,
    )


def _met(skin: Floats, flesh: Floats, outside: Ints) -> tuple[Ints, Ints, Floats]:
    """Return which vertices (m) of the skin lie over which points (m) of the flesh, and shares (m) of their areas.

    A vertex lies over the one point that is nearest, and over those besides that no vertex would lie over else. Shared
    among the corners of a face, so short a way would join these to each other, and rot would run along below the skin.
    """
    below = nearest(skin, flesh, outside)
    under = outside[below.face, below.shares.argmax(axis=1)]
    corners = flesh[outside]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 6
    of = np.bincount(outside.ravel(), np.repeat(areas, 3), len(flesh))
    bare = np.setdiff1d(np.unique(outside), under)
    over = np.concatenate([np.arange(len(skin)), KDTree(skin).query(flesh[bare])[1]])
    under = np.concatenate([under, bare])
    share = of[under] / np.bincount(over, of[under], len(skin))[over]
    return over, under, share


def _evened(volume: Floats, ends: Ints, weight: Floats, above: int) -> None:
    """Let points of the flesh that are too small for their edges have more of the volume, in place.

    Where the lattice is cut at the surface some points stand for next to nothing, and would make every step many times
    dearer. They get what the stiffest point of the skin has for its edges, from those that they share edges with.
    """
    out = np.bincount(ends[:, 0], weight, len(volume)) + np.bincount(ends[:, 1], weight, len(volume))
    least = out / float((out[:above] / volume[:above]).max())
    both = np.concatenate([ends, ends[:, ::-1]])
    both = both[(both >= above).all(axis=1)]
    both = both[np.argsort(both[:, 0], kind="stable")]
    start = np.searchsorted(both[:, 0], np.arange(len(volume) + 1))
    small = above + np.flatnonzero(volume[above:] < least[above:])
    for i in small.tolist():
        near = both[start[i] : start[i + 1], 1]
        spare = np.maximum(volume[near] - least[near], 0.0) / 2
        taken = min(least[i] - volume[i], float(spare.sum()))
        if taken > 0:
            volume[near] -= spare * (taken / float(spare.sum()))
            volume[i] += taken


def _filled(points: Floats, faces: Ints, shown: Floats, count: int) -> tuple[Floats, Ints]:
    """Return points and tetrahedra in a closed surface, as many as reach near all `shown` vertices of the mesh."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    volume = abs(float(np.sum(a * np.cross(b, c)))) / 6
    if volume <= 0:
        raise InvalidGeometry("the mesh is flat: nothing is inside of it.", advice="Leave within out.")
    edge = (_PER_CUBE * volume / count) ** (1 / 3)
    far, asked = None, edge
    for _ in range(_TRIES):
        crowd = touched(points, faces, edge)
        if crowd == np.inf or (edge < asked and crowd > _TOUCHED):
            break
        found = stuffed(points, faces, edge)
        if len(found.tets):
            away = nearest(shown, found.points, boundary(found.tets)).distance
            far = shown[int(np.argmax(away))]
            if away.max() <= _FAR * edge:
                return found.points, found.tets
        edge /= _FINER
    where = "" if far is None else " at (" + ", ".join(f"{x:.3g}" for x in far) + ")"
    raise InvalidGeometry(
        f"the mesh is too thin{where} to be filled with flesh.", advice="Thicken it there, or leave within out."
    )


def _parted(points: Floats, tets: Ints, fruit: Fruit) -> tuple[Floats, Ints, Floats, Ints]:
    """Return points and tetrahedra of the flesh, the points of the stone alone, and all tetrahedra, the flesh first."""
    middles = points[tets].mean(axis=1)
    far = np.linalg.norm(middles, axis=1)
    soft = far > fruit.stone_distance(middles / np.maximum(far, 1e-300)[:, None])
    flesh = np.unique(tets[soft])
    rest = np.setdiff1d(np.arange(len(points)), flesh)
    place = np.empty(len(points), np.int64)
    place[flesh], place[rest] = np.arange(len(flesh)), len(flesh) + np.arange(len(rest))
    inner = place[tets[soft]]
    return points[flesh], inner, points[rest], np.concatenate([inner, place[tets[~soft]]])
