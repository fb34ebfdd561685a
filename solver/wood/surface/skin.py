"""The bundle's surface: cells of the section extruded along the rods, closed by caps, open where it is broken.

Sutherland 2012, chapter 5. The thesis keeps a closed mesh for every rod. Here a wall between two cells that hold
together on both sides is left out, so that an unbroken bundle is one closed surface, and interior rods cost nothing
until a break uncovers them. Vertices stay apart where a sharp edge is meant: bark, walls, ends and broken faces.
"""

from __future__ import annotations

import numpy as np

from ...contract import Context
from ...meshes import Frame
from ..fibres.timber import hews
from ..model.grain import Field
from ..model.state import Wood
from ..params import WoodParams
from ..shape.fork import limbs
from ..shape.taper import thickness
from .align import Pairs, aligned, bonded, corners, meeting, turned
from .cells import Section, section
from .rows import Rows, rows, spans

__all__ = ["Skin"]

#: Reach of the splinters of a broken rod, over its radius.
_SPLINTERS = 2.5
#: The middle ring of a broken face, over the cell's own size.
_RING = 0.55
_BARK, _WALL, _END = range(3)


class Skin:
    """What turns moments of a bundle into meshes; made once per run from the bundle as laid."""

    def __init__(self, wood: Wood, params: WoodParams) -> None:
        self.section = section(params)
        self._span = spans(wood, params.length)
        self._pairs = meeting(self.section)
        # a child of the run's seed: the bundle's own draws stay what they are without a mesh
        generator = Context.generator(params.seed).spawn(1)[0]
        width = self.section.radius
        self._grain = Field(4 * width, width / 2, generator)
        self._params = params
        self._wide = _wide(wood, self.section.radius) if hews(params) else None
        self._grown = _grown(self.section, self._pairs, bonded(wood, self._span, self._pairs), params)

    def frame(self, wood: Wood, covered: bool = False) -> Frame:
        """Return the mesh of a moment, with the field `inside`; with `covered`, walls that hide each other too."""
        section = self.section
        found = rows(wood, self._span, _SPLINTERS * section.radius)
        holds = bonded(wood, self._span, self._pairs)
        found = found._replace(across=turned(found, section, self._pairs, holds))
        begin, row, number = corners(found, section)
        thin = thickness(found.place, self._params)
        if self._wide is not None:
            part = found.place / self._span.length * (self._wide.shape[1] - 1)
            thin = thin * self._wide[found.rod, np.clip(np.rint(part).astype(int), 0, self._wide.shape[1] - 1)]
        thin = thin[row, None]
        away = thin * (section.places[section.corner] - section.points[section.owner])[number]
        single = self._set_off(found, row, away)
        group, places = aligned(single, begin, found, section, self._pairs, holds)
        sheets = _Sheets(len(places))
        _walls(sheets, found, section, begin, row, number, group, covered, self._bark(found, row, number))
        _ends(sheets, found, begin, row, group)
        vertices, inside = sheets.vertices(places)
        faces = self._broken_faces(found, begin, row, number, away, single, len(vertices))
        rough = np.concatenate([vertices, *(points for points, _ in faces)])
        triangles = np.concatenate([sheets.triangles(), *(t for _, t in faces)])
        inside = np.concatenate([inside, np.ones(len(rough) - len(inside))])
        return Frame(rough, triangles.astype(np.int32), {"inside": inside})

    def _bark(self, found: Rows, row: np.ndarray, number: np.ndarray) -> np.ndarray:
        """Return whether the sides (c,) that begin at corners lie on bark, as far as the next row."""
        following = np.minimum(np.arange(1, len(found.place) + 1), len(found.place) - 1)
        middle = (found.place + found.place[following]) / 2 / self._span.length
        # between two stations lies what is grown at the second
        station = np.ceil(np.clip(middle, 0, 1) * (self._grown.shape[1] - 1)).astype(int)
        found_: np.ndarray = (self.section.mate[number] < 0) | self._grown[number, station[row]]
        return found_

    def _set_off(self, found: Rows, row: np.ndarray, away: np.ndarray) -> np.ndarray:
        """Return points (n, 3) at `away` (n, 2) [m] in the section from the centre lines; broken ends are rough."""
        upward = np.cross(found.tangent, found.across)[row]
        points: np.ndarray = found.point[row] + away[:, :1] * found.across[row] + away[:, 1:] * upward
        rough = np.flatnonzero(found.rough[row] > 0)
        material = np.column_stack([found.place[row], self.section.points[found.rod[row]] + away])[rough]
        reach = found.rough[row[rough]] * np.tanh(self._grain(material))
        points[rough] += reach[:, None] * found.tangent[row[rough]]
        return points

    def _broken_faces(
        self,
        found: Rows,
        begin: np.ndarray,
        row: np.ndarray,
        number: np.ndarray,
        away: np.ndarray,
        single: np.ndarray,
        count: int,
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return vertices and triangles of the rough faces, numbered from `count`: rim, ring and middle."""
        ends = np.flatnonzero(found.station < 0)
        if not len(ends):
            return []
        mine = np.flatnonzero(found.station[row] < 0)
        rank = np.zeros(len(begin), int)
        rank[ends] = np.arange(len(ends))
        # numbers of rim and ring vertices follow the corners', the middles come last
        seat = np.full(len(row), -1)
        seat[mine] = np.arange(len(mine))
        points = np.concatenate(
            [
                single[mine],
                self._set_off(found, row[mine], _RING * away[mine]),
                self._set_off(found, ends, np.zeros((len(ends), 2))),
            ]
        )
        following = begin[row] + self.section.following[number] - self.section.start[found.rod[row]]
        a, b = seat[mine], seat[following[mine]]
        c, d, e = a + len(mine), b + len(mine), 2 * len(mine) + rank[row[mine]]
        faces = np.stack([np.stack([a, b, d], 1), np.stack([a, d, c], 1), np.stack([c, d, e], 1)], 1)
        # a far end looks along the rod, a near one against it
        last = np.append(found.piece[1:] != found.piece[:-1], True)[row[mine]]
        faces[~last] = faces[~last][:, :, ::-1]
        return [(points, faces.reshape(-1, 3) + count)]


def _wide(wood: Wood, radius: float) -> np.ndarray:
    """Return how wide rods (k, edges) of mean `radius` [m] are over what they are where all of them is within."""
    own = wood.rods.radius.reshape(len(wood.grid), -1)
    found: np.ndarray = own / np.maximum(own.max(1, keepdims=True), 0.9 * radius)
    return found


def _grown(section: Section, pairs: Pairs, holds: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return where along (n, stations) sides of cells are bark that have a neighbour: where a fork's limbs have parted.

    holds (p, stations): whether pairs hold together as laid.
    """
    out = np.zeros((len(section.owner), holds.shape[1]), bool)
    inner = np.flatnonzero(section.mate >= 0)
    if params.fork is None or not len(inner):
        return out
    one, other = section.owner[inner], section.owner[section.mate[inner]]
    branch, count = limbs(section.points, params), len(section.points)
    key = np.minimum(one, other) * count + np.maximum(one, other)
    pair = np.searchsorted(pairs.p * count + pairs.q, key)
    beyond = np.linspace(0, params.length, holds.shape[1]) > params.fork.at
    out[inner] = (branch[one] != branch[other])[:, None] & ~holds[pair] & beyond
    return out


class _Sheets:
    """Triangles whose vertices are groups of corners, apart by sheet, and middles of ends."""

    def __init__(self, groups: int) -> None:
        self._groups = groups
        self._faces: list[np.ndarray] = []
        self._middles: list[np.ndarray] = []

    def add(self, sheet: int, faces: np.ndarray) -> None:
        """Add triangles (t, 3) of groups."""
        self._faces.append(faces + sheet * self._groups)

    def middles(self, points: np.ndarray) -> int:
        """Add vertices (n, 3) and return the number of the first, for sheet 0."""
        first = 3 * self._groups + sum(len(m) for m in self._middles)
        self._middles.append(points)
        return first

    def vertices(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the vertices (v, 3) that occur and their field `inside`."""
        self._used, self._number = np.unique(np.concatenate(self._faces), return_inverse=True)
        known = np.concatenate([places, places, places, *self._middles])
        return known[self._used], (self._used >= self._groups).astype(float)

    def triangles(self) -> np.ndarray:
        """Return the triangles (t, 3) of the numbers that `vertices` gave."""
        return self._number.reshape(-1, 3)


def _walls(
    sheets: _Sheets,
    found: Rows,
    section: Section,
    begin: np.ndarray,
    row: np.ndarray,
    number: np.ndarray,
    group: np.ndarray,
    covered: bool,
    bark: np.ndarray,
) -> None:
    """Add bark and uncovered walls: two triangles per side between two rows of a piece, all cut the same way.

    bark (c,): whether a corner's side, as far as the next row, never had a neighbour.
    """
    goes_on = np.append(found.piece[1:] == found.piece[:-1], False)
    low = np.flatnonzero(goes_on[row])
    side, here = number[low], row[low]
    local = section.start[found.rod[here]]
    a, b = group[begin[here] + side - local], group[begin[here] + section.following[side] - local]
    d, c = group[begin[here + 1] + side - local], group[begin[here + 1] + section.following[side] - local]
    mate = section.mate[side]
    hidden = np.zeros(len(low), bool)
    if not covered:
        regular = (
            (mate >= 0) & (found.station[here] >= 0) & (found.station[np.minimum(here + 1, len(goes_on) - 1)] >= 0)
        )
        n = np.flatnonzero(regular)
        other = section.owner[mate[n]]
        under = found.at[other, found.station[here[n]]]
        over = found.at[other, found.station[here[n]] + 1]
        whole = (under >= 0) & (over == under + 1) & (found.piece[under] == found.piece[over])
        n, other, under = n[whole], other[whole], under[whole]
        base = section.start[other]
        # the mate runs backwards: its first corner is this side's second
        first, second = section.following[mate[n]] - base, mate[n] - base
        hidden[n] = (
            (a[n] == group[begin[under] + first])
            & (b[n] == group[begin[under] + second])
            & (d[n] == group[begin[under + 1] + first])
            & (c[n] == group[begin[under + 1] + second])
        )
    for sheet, of in ((_BARK, bark[low] & ~hidden), (_WALL, ~bark[low] & ~hidden)):
        sheets.add(sheet, np.concatenate([np.stack([a, b, c], 1)[of], np.stack([a, c, d], 1)[of]]))


def _ends(sheets: _Sheets, found: Rows, begin: np.ndarray, row: np.ndarray, group: np.ndarray) -> None:
    """Add the bundle's two ends: fans about the rods."""
    for station, far in ((0, False), (found.at.shape[1] - 1, True)):
        ends = found.at[:, station]
        ends = ends[ends >= 0]
        middle = np.zeros(len(found.rod), int)
        middle[ends] = sheets.middles(found.point[ends]) + np.arange(len(ends))
        is_end = np.zeros(len(found.rod), bool)
        is_end[ends] = True
        mine = np.flatnonzero(is_end[row])
        a = group[mine]
        following = np.where(mine + 1 < begin[row[mine] + 1], mine + 1, begin[row[mine]])
        b = group[following]
        if not far:
            a, b = b, a
        offset = _END * sheets._groups
        sheets.add(0, np.stack([middle[row[mine]], a + offset, b + offset], 1))
