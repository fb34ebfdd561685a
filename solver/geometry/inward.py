"""Where a surface may cross itself: which of its triangles lie before or behind one that faces inwards.

A surface around the origin whose triangles all face away from it is seen whole from there: it covers every direction
once and crosses nowhere. Where it covers a direction more than once, one of those triangles faces the origin, for their
signs add up to one. So two triangles that cross lie before or behind one that faces inwards: those few are looked for
first, and where there is none that is all. Surfaces that do not enclose the origin, or enclose it twice, are not meant.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .outward import STEEP

__all__ = ["candidates", "inward", "pairs"]

Doubles = NDArray[np.float64]
Words = NDArray[np.int32]

#: How far around a triangle others are looked for, as a share of its size (the least of its heights).
_AROUND = 0.1
#: Sides of the cube around the origin reach to this, so that triangles over an edge are whole on one.
_WIDE = 1.3
#: Cells along a side, over the root of the number of triangles, and at most.
_FINE, _MOST = 0.75, 384
#: Boxes that are held against one together.
_TOGETHER = 32
#: Bits of a key that are sorted by at once.
_DIGIT = 11


@njit(cache=True, error_model="numpy")
def inward(x: Doubles, faces: Words, some: Words) -> Words:
    """Return which of some triangles of vertices x (nv, 3) face the origin, or hardly away from it."""
    found, count = np.empty(len(some), np.int32), 0
    for t in some:
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        volume = nx * x[a, 0] + ny * x[a, 1] + nz * x[a, 2]
        square = (nx * nx + ny * ny + nz * nz) * (x[a, 0] ** 2 + x[a, 1] ** 2 + x[a, 2] ** 2)
        if volume <= 0 or volume * volume <= STEEP**2 * square:
            found[count] = t
            count += 1
    return found[:count]


@njit(cache=True, error_model="numpy")
def _size(x: Doubles, faces: Words, t: int) -> float:
    """Return the least of a triangle's heights."""
    a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    wx, wy, wz = vx - ux, vy - uy, vz - uz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
    return math.sqrt((nx * nx + ny * ny + nz * nz) / max(longest, 1e-300))


@njit(cache=True, error_model="numpy")
def _project(x: Doubles, faces: Words, t: int, side: int, cells: int, box: NDArray[np.int64]) -> bool:
    """Fill `box` (2, 2) with the first and last cell that a triangle covers on a side of the cube around the origin, as
    seen from there; return False where it is not seen whole.
    """
    axis, sign = side // 2, 1 - 2 * (side % 2)
    low_u = low_v = math.inf
    high_u = high_v = -math.inf
    for i in range(3):
        v = faces[t, i]
        depth = sign * x[v, axis]
        if depth <= 1e-9:
            return False
        u, w = x[v, (axis + 1) % 3] / depth, x[v, (axis + 2) % 3] / depth
        low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, w), max(high_v, w)
    if low_u < -_WIDE or high_u > _WIDE or low_v < -_WIDE or high_v > _WIDE:
        return False
    # and a little around, for what only comes near
    more_u, more_v = _WIDE - _AROUND * (high_u - low_u), _WIDE - _AROUND * (high_v - low_v)
    less_u, less_v = _WIDE + _AROUND * (high_u - low_u), _WIDE + _AROUND * (high_v - low_v)
    scale = cells / (2 * _WIDE)
    box[0, 0], box[0, 1] = max(int((low_u + more_u) * scale), 0), min(int((high_u + less_u) * scale), cells - 1)
    box[1, 0], box[1, 1] = max(int((low_v + more_v) * scale), 0), min(int((high_v + less_v) * scale), cells - 1)
    return True


@njit(cache=True, error_model="numpy")
def _has_corner(x: Doubles, faces: Words, t: int, side: int) -> bool:
    """Whether a corner of a triangle is on a side of the cube."""
    axis, sign = side // 2, 1 - 2 * (side % 2)
    for i in range(3):
        v = faces[t, i]
        depth = sign * x[v, axis]
        if depth >= abs(x[v, (axis + 1) % 3]) and depth >= abs(x[v, (axis + 2) % 3]):
            return True
    return False


@njit(cache=True, error_model="numpy")
def _mark(x: Doubles, faces: Words, some: Words, marked: NDArray[np.bool_]) -> bool:
    """Mark the cells (6, n, n) of the cube that triangles cover; False where one is too large for that."""
    box, cells = np.empty((2, 2), np.int64), marked.shape[1]
    for n in range(len(some)):
        for side in range(6):
            if _project(x, faces, some[n], side, cells, box):
                marked[side, box[0, 0] : box[0, 1] + 1, box[1, 0] : box[1, 1] + 1] = True
            elif _has_corner(x, faces, some[n], side):
                return False
    return True


@njit(cache=True, error_model="numpy")
def _sums(marked: NDArray[np.bool_]) -> Words:
    """Return how many cells (6, n, n) are marked before each corner (6, n + 1, n + 1) of theirs, both ways."""
    cells = marked.shape[1]
    found = np.zeros((6, cells + 1, cells + 1), np.int32)
    for side in range(6):
        for i in range(cells):
            here, above, below = marked[side, i], found[side, i, 1:], found[side, i + 1, 1:]
            if here.any():
                count = np.int32(0)
                for j in range(cells):
                    count += np.int32(here[j])
                    below[j] = above[j] + count
            else:
                below[:] = above
    return found


class _Cells(NamedTuple):
    """The cell of each vertex on its own side of the cube."""

    side: NDArray[np.int8]
    row: NDArray[np.int16]
    column: NDArray[np.int16]


@njit(cache=True, error_model="numpy")
def _cells(x: Doubles, cells: int) -> tuple[NDArray[np.int8], NDArray[np.int16], NDArray[np.int16]]:
    sides, rows, columns = np.empty(len(x), np.int8), np.empty(len(x), np.int16), np.empty(len(x), np.int16)
    scale = cells / (2 * _WIDE)
    for v in range(len(x)):
        side = 0
        for k in range(1, 3):
            if abs(x[v, k]) > abs(x[v, side]):
                side = k
        depth = max(abs(x[v, side]), 1e-12)
        rows[v] = int((x[v, (side + 1) % 3] / depth + _WIDE) * scale)
        columns[v] = int((x[v, (side + 2) % 3] / depth + _WIDE) * scale)
        sides[v] = 2 * side + (x[v, side] < 0)
    return sides, rows, columns


@njit(cache=True, error_model="numpy")
def _covering(x: Doubles, faces: Words, some: Words, at: _Cells, marked: NDArray[np.bool_], wide: bool) -> Words:
    """Return which of some triangles cover a marked cell (6, n, n); if `wide`, those too that would mark one."""
    cells, sums, box = marked.shape[1], _sums(marked), np.empty((2, 2), np.int64)
    found, count = np.empty(len(some), np.int32), 0
    for t in some:
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        side = at.side[a]
        is_seen = at.side[b] == side and at.side[c] == side
        if is_seen:
            i, j = (at.row[a], at.row[b], at.row[c]), (at.column[a], at.column[b], at.column[c])
            low, high, left, right = min(i), max(i) + 1, min(j), max(j) + 1
        else:
            is_seen = _project(x, faces, t, side, cells, box)
            low, high, left, right = box[0, 0], box[0, 1] + 1, box[1, 0], box[1, 1] + 1
        if is_seen:
            if wide:  # what triangles mark is a little around them
                more, beside = int(_AROUND * (high - low)) + 1, int(_AROUND * (right - left)) + 1
                low, left = max(low - more, 0), max(left - beside, 0)
                high, right = min(high + more, cells), min(right + beside, cells)
            of = sums[side]
            many = of[high, right] - of[low, right] - of[high, left] + of[low, left]
        else:
            many = np.int32(1)
        # no branch: no processor guesses which ones fold
        found[count] = t
        count += many > 0
    return found[:count]


@njit(cache=True, error_model="numpy")
def candidates(x: Doubles, faces: Words, moved: NDArray[np.bool_]) -> Words:
    """Return the triangles that lie before or behind one that faces inwards, and one with a corner in `moved` (nv,);
    where it is empty, each counts as moved.
    """
    some = every = np.arange(len(faces)).astype(np.int32)
    cells = min(int(_FINE * math.sqrt(len(faces))) + 1, _MOST)
    at, there = _Cells(*_cells(x, cells)), np.ones((6, cells, cells), np.bool_)
    if len(moved) > 0:
        others, count = np.empty(len(faces), np.int32), 0
        for t in every:
            others[count] = t
            count += moved[faces[t, 0]] | moved[faces[t, 1]] | moved[faces[t, 2]]
        close = np.zeros((6, cells, cells), np.bool_)
        if _mark(x, faces, others[:count], close):
            some, there = _covering(x, faces, every, at, close, True), close
    hidden = inward(x, faces, some)
    if len(hidden) == 0:
        return hidden
    marked = np.zeros((6, cells, cells), np.bool_)
    if not _mark(x, faces, hidden, marked):
        return every
    return _covering(x, faces, some, at, marked & there, False)


@njit(cache=True, error_model="numpy")
def _around(x: Doubles, faces: Words, some: Words, size: Doubles) -> NDArray[np.float32]:
    """Fill the sizes of some triangles, and return the boxes (n, 6) around them and a little more."""
    box = np.empty((len(some), 6), np.float32)
    for n in range(len(some)):
        t = some[n]
        size[t] = _size(x, faces, t)
        more = _AROUND * size[t] + 1e-6
        for k in range(3):
            a, b, c = x[faces[t, 0], k], x[faces[t, 1], k], x[faces[t, 2], k]
            box[n, k], box[n, 3 + k] = min(a, b, c) - more, max(a, b, c) + more
    return box


class _Strips(NamedTuple):
    """Boxes in strips across y, each in order along x: what is walked through lies side by side in memory."""

    bounds: NDArray[np.float32]
    """(6, n) by bound, for several boxes are looked at together; behind the last come some that nothing meets"""
    corners: Words
    """(3, n) of the triangles in them"""
    first: Words
    """(n,) the first strip that each box is in"""
    place: Words
    """(n,) their triangles"""
    counts: NDArray[np.bool_]
    """(n,) whether one of a triangle's corners has moved, or none was asked for"""
    ends: NDArray[np.int64]
    """(strips + 1,) where each strip begins"""


@njit(cache=True, error_model="numpy")
def _in_strips(
    faces: Words, some: Words, box: NDArray[np.float32], moved: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], Words, Words, Words, NDArray[np.bool_], NDArray[np.int64]]:
    count = len(some)
    first_y, last_y = box[:, 1].min(), box[:, 4].max()
    strips = min(max(int(math.sqrt(count)) // 4, 1), 64)
    scale = strips / max(last_y - first_y, 1e-6)
    order = _order(np.ascontiguousarray(box[:, 0]))
    lows, highs, ends = np.empty(count, np.int32), np.empty(count, np.int32), np.zeros(strips + 1, np.int64)
    for m in range(count):
        n = order[m]
        lows[m] = min(int((box[n, 1] - first_y) * scale), strips - 1)
        highs[m] = min(int((box[n, 4] - first_y) * scale), strips - 1)
        for strip in range(lows[m], highs[m] + 1):
            ends[strip + 1] += 1
    ends = np.cumsum(ends)
    fill = ends[:-1].copy()
    bounds, corners = (
        np.full((6, ends[-1] + _TOGETHER), np.inf, np.float32),
        np.zeros((3, ends[-1] + _TOGETHER), np.int32),
    )
    place, first_strip = np.empty(ends[-1], np.int32), np.zeros(ends[-1] + _TOGETHER, np.int32)
    counts = np.ones(ends[-1], np.bool_)
    for m in range(count):
        for strip in range(lows[m], highs[m] + 1):
            there = fill[strip]
            place[there], first_strip[there] = some[order[m]], lows[m]
            for k in range(6):
                bounds[k, there] = box[order[m], k]
            for k in range(3):
                corners[k, there] = faces[some[order[m]], k]
            if len(moved) > 0:
                counts[there] = moved[corners[0, there]] | moved[corners[1, there]] | moved[corners[2, there]]
            fill[strip] += 1
    return bounds, corners, first_strip, place, counts, ends


@njit(cache=True, error_model="numpy")
def pairs(x: Doubles, faces: Words, some: Words, size: Doubles, moved: NDArray[np.bool_]) -> Words:
    """Return the pairs (np, 2) among some triangles without a common corner that touch or nearly do, as far as their
    boxes and the line between their middles tell; if any are `moved` (nv,), those of which one has a corner among them.

    The sizes of these triangles are filled into `size` (nt,).
    """
    strips = _Strips(*_in_strips(faces, some, _around(x, faces, some, size), moved))
    bounds, ends, place, counts = strips.bounds, strips.ends, strips.place, strips.counts
    found, room = np.empty((1024, 2), np.int32), 0
    met = np.empty(_TOGETHER, np.uint8)
    eights = met.view(np.uint64)
    for strip in range(len(ends) - 1):
        for m in range(ends[strip], ends[strip + 1]):
            o = m + 1
            while o < ends[strip + 1]:
                _meet(bounds, strips.corners, strips.first, m, o, strip, met)
                for eight in range(_TOGETHER // 8):
                    if eights[eight] == 0:
                        continue
                    for k in range(8 * eight, min(8 * eight + 8, ends[strip + 1] - o)):
                        if met[k] == 0 or not (counts[m] or counts[o + k]):
                            continue
                        if _lie_apart(x, size, faces, place[m], place[o + k]):
                            continue
                        if room == len(found):
                            found = np.concatenate((found, found))
                        found[room, 0], found[room, 1] = place[m], place[o + k]
                        room += 1
                if bounds[0, o + _TOGETHER - 1] > bounds[3, m]:
                    break
                o += _TOGETHER
    return found[:room]


@njit(cache=True, error_model="numpy")
def _order(keys: NDArray[np.float32]) -> Words:
    """Return what sorts `keys`, digit by digit from the last: a sixth of the time of argsort for 50,000."""
    count, base = len(keys), 1 << _DIGIT
    bits, sign = keys.view(np.uint32), np.uint32(1 << 31)
    words = np.empty(count, np.uint32)
    for n in range(count):
        # so that they are in the order of the numbers: all bits of a negative one the other way, of others the first
        words[n] = ~bits[n] if bits[n] & sign else bits[n] | sign
    order, sorted_words = np.arange(count).astype(np.int32), words
    for shift in range(0, 32, _DIGIT):
        ends = np.zeros(base + 1, np.int64)
        for n in range(count):
            ends[((words[n] >> np.uint32(shift)) & np.uint32(base - 1)) + 1] += 1
        ends = np.cumsum(ends)
        moved, sorted_words = np.empty(count, np.int32), np.empty(count, np.uint32)
        for n in range(count):
            digit = (words[n] >> np.uint32(shift)) & np.uint32(base - 1)
            moved[ends[digit]], sorted_words[ends[digit]] = order[n], words[n]
            ends[digit] += 1
        order, words = moved, sorted_words
    return order


@njit(cache=True, error_model="numpy")
def _meet(
    bounds: NDArray[np.float32], corners: Words, first_strip: Words, m: int, o: int, strip: int, met: NDArray[np.uint8]
) -> None:
    """Fill which of the boxes from `o` on meet box `m`, without a common corner, and for the first time in this strip.

    No branch, and views that are read from their first place on: so the compiler makes it a few instructions for all of
    them. With places that it has to suspect of being negative it took three times as long.
    """
    x1, y0, y1, z0, z1 = bounds[3, m], bounds[1, m], bounds[4, m], bounds[2, m], bounds[5, m]
    p, q, r = corners[0, m], corners[1, m], corners[2, m]
    # a pair belongs to the strip in which both are met first
    first = np.int32(strip if first_strip[m] < strip else -1)
    end = o + _TOGETHER
    low_x, low_y, high_y, low_z, high_z = (
        bounds[0, o:end],
        bounds[1, o:end],
        bounds[4, o:end],
        bounds[2, o:end],
        bounds[5, o:end],
    )
    firsts, seconds, thirds, strips = corners[0, o:end], corners[1, o:end], corners[2, o:end], first_strip[o:end]
    for k in range(_TOGETHER):
        a, b, c = firsts[k], seconds[k], thirds[k]
        is_other = (
            (a != p) & (a != q) & (a != r) & (b != p) & (b != q) & (b != r) & (c != p) & (c != q) & (c != r)
        )  # fmt: skip
        is_here = (low_x[k] <= x1) & (low_y[k] <= y1) & (high_y[k] >= y0) & (low_z[k] <= z1) & (high_z[k] >= z0)
        met[k] = is_other & is_here & ((first < 0) | (strips[k] == first))


@njit(cache=True, error_model="numpy")
def _lie_apart(x: Doubles, size: Doubles, faces: Words, a: int, b: int) -> bool:
    """Whether two triangles are clearly apart: along the line between their middles, as most that lie side by side are,
    or beyond an edge, as needles around a pole are.
    """
    nx = ny = nz = 0.0
    for k in range(3):
        v, w = faces[a, k], faces[b, k]
        nx, ny, nz = nx + x[w, 0] - x[v, 0], ny + x[w, 1] - x[v, 1], nz + x[w, 2] - x[v, 2]
    high, low = -math.inf, math.inf
    for k in range(3):
        v, w = faces[a, k], faces[b, k]
        high = max(high, nx * x[v, 0] + ny * x[v, 1] + nz * x[v, 2])
        low = min(low, nx * x[w, 0] + ny * x[w, 1] + nz * x[w, 2])
    more = _AROUND * (size[a] + size[b]) + 1e-6
    gap = low - high
    if gap > 0 and gap * gap > more * more * (nx * nx + ny * ny + nz * nz):
        return True
    return _is_beyond(x, faces, a, b, more) or _is_beyond(x, faces, b, a, more)


@njit(cache=True, error_model="numpy")
def _is_beyond(x: Doubles, faces: Words, a: int, b: int, more: float) -> bool:
    """Whether triangle `b` lies farther than `more` beyond an edge of `a`, in the plane of that."""
    p, q, r = faces[a, 0], faces[a, 1], faces[a, 2]
    ux, uy, uz = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
    vx, vy, vz = x[r, 0] - x[p, 0], x[r, 1] - x[p, 1], x[r, 2] - x[p, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    for i in range(3):
        p, q = faces[a, i], faces[a, (i + 1) % 3]
        ux, uy, uz = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
        # away from the third corner, which is counter-clockwise from this edge
        ox, oy, oz = uy * nz - uz * ny, uz * nx - ux * nz, ux * ny - uy * nx
        least = math.inf
        for k in range(3):
            w = faces[b, k]
            least = min(least, ox * (x[w, 0] - x[p, 0]) + oy * (x[w, 1] - x[p, 1]) + oz * (x[w, 2] - x[p, 2]))
        if least > 0 and least * least > more * more * (ox * ox + oy * oy + oz * oz):
            return True
    return False
