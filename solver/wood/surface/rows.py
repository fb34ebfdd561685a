"""Where the sections of the render mesh stand: rows across the pieces that the rods are broken into.

All rods have rows at the same stations along the bundle, so that the corners of neighbours coincide one by one; the
thesis' rows stand at the rods' own vertices, and corners meet edges. A broken end has a row of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..model.state import Wood

__all__ = ["Rows", "Spans", "rows", "spans"]

_TINY = 1e-9


class Spans(NamedTuple):
    """Material places of the edges as laid: start and end (e,) along the bundle [m]; ghosts lie outside 0 to length."""

    start: np.ndarray
    end: np.ndarray
    length: float
    stations: int


class Rows(NamedTuple):
    """Rows (w,) of all pieces, along each rod."""

    rod: np.ndarray
    piece: np.ndarray
    place: np.ndarray  # along the bundle [m]
    station: np.ndarray  # -1: a broken end
    rough: np.ndarray  # how far a broken end's splinters may reach [m]
    point: np.ndarray  # (w, 3) on the centre line [m]
    tangent: np.ndarray  # (w, 3)
    across: np.ndarray  # (w, 3) where the section's y axis points
    at: np.ndarray  # (rods, stations) row, -1: none


def spans(wood: Wood, length: float) -> Spans:
    """Return the edges' places in the straight bundle of `length` [m] as laid; fibres may be longer than it."""
    x = wood.straight[:, 0]
    return Spans(x[wood.rods.a], x[wood.rods.b], length, wood.grid.shape[1])


class _Pieces(NamedTuple):
    """Pieces (p,): first and last edge, material ends [m], whether they are broken, reach of the splinters [m]."""

    first: np.ndarray
    last: np.ndarray
    ends: np.ndarray  # (p, 2)
    broken: np.ndarray  # (p, 2)
    rough: np.ndarray  # (p, 2)


def _pieces(wood: Wood, span: Spans, joined: np.ndarray, reach: float) -> _Pieces:
    """Return the pieces: runs of whole edges joined to one another, with the stubs of cut edges at their ends.

    A vertex that lost both its edges has no direction and is not shown.
    """
    rods, alive = wood.rods, wood.rods.alive == 1
    first = np.flatnonzero(alive & ~np.concatenate([[False], joined]))
    last = np.flatnonzero(alive & ~np.concatenate([joined, [False]]))
    cut = span.start + wood.cut * (span.end - span.start)
    low, high = span.start[first], span.end[last]
    before, after = np.maximum(first - 1, 0), np.minimum(last + 1, len(alive) - 1)
    stub = (before < first) & (wood.rod[before] == wood.rod[first]) & ~alive[before]
    low = np.where(stub & (rods.b[before] == rods.a[first]), cut[before], low)
    stub = (after > last) & (wood.rod[after] == wood.rod[last]) & ~alive[after]
    high = np.where(stub & (rods.a[after] == rods.b[last]), cut[after], high)
    ends = np.clip(np.column_stack([low, high]), 0, span.length)
    shown = ends[:, 1] - ends[:, 0] > _TINY * span.length
    first, last, ends = first[shown], last[shown], ends[shown]
    broken = np.column_stack([ends[:, 0] > _TINY * span.length, ends[:, 1] < (1 - _TINY) * span.length])
    rough = np.repeat(np.minimum(reach, 0.3 * (ends[:, 1] - ends[:, 0]))[:, None], 2, 1)
    # both faces of a break have the same splinters
    facing = np.flatnonzero(
        (ends[:-1, 1] == ends[1:, 0]) & (wood.rod[first[:-1]] == wood.rod[first[1:]]) & broken[:-1, 1]
    )
    rough[facing, 1] = rough[facing + 1, 0] = np.minimum(rough[facing, 1], rough[facing + 1, 0])
    # a saw leaves plane faces
    rough[np.isin(wood.parent[rods.a[first]], wood.sawn), 0] = 0.0
    rough[np.isin(wood.parent[rods.b[last]], wood.sawn), 1] = 0.0
    return _Pieces(first, last, ends, broken, rough)


def _unit(a: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(a, axis=-1, keepdims=True)
    return np.where(length > 0, a / np.maximum(length, 1e-300), [1.0, 0.0, 0.0])


def rows(wood: Wood, span: Spans, reach: float) -> Rows:
    """Return the rows of all pieces; `reach` [m] bounds the splinters of broken ends."""
    rods = wood.rods
    alive = rods.alive == 1
    joined = (wood.rod[:-1] == wood.rod[1:]) & alive[:-1] & alive[1:] & (rods.b[:-1] == rods.a[1:])
    found = _pieces(wood, span, joined, reach)
    step = span.length / (span.stations - 1)
    low = np.where(found.broken[:, 0], np.floor((found.ends[:, 0] + found.rough[:, 0]) / step) + 1, 0).astype(int)
    high = np.where(
        found.broken[:, 1], np.ceil((found.ends[:, 1] - found.rough[:, 1]) / step) - 1, span.stations - 1
    ).astype(int)
    between = np.maximum(high - low + 1, 0)
    counts = between + found.broken.sum(1)
    piece = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    within -= found.broken[piece, 0]
    ending = np.where(within < 0, 0, np.where(within >= between[piece], 1, -1))
    station = np.where(ending < 0, low[piece] + within, -1)
    place = np.where(ending < 0, station * step, found.ends[piece, np.maximum(ending, 0)])
    rod = wood.rod[found.first][piece]
    gap = 4 * span.length
    edge = np.searchsorted(wood.rod * gap + span.start, rod * gap + place, side="right") - 1
    edge = np.clip(edge, found.first[piece], found.last[piece])
    share = (place - span.start[edge]) / (span.end[edge] - span.start[edge])
    point, tangent = _curve(wood, joined, edge, share)
    at = np.full((len(wood.grid), span.stations), -1)
    regular = np.flatnonzero(station >= 0)
    at[rod[regular], station[regular]] = regular
    rough = np.where(ending < 0, 0.0, found.rough[piece, np.maximum(ending, 0)])
    across = _material(wood, joined, edge, share) if wood.turning else _upright(tangent)
    across = _unit(across - (across * tangent).sum(1, keepdims=True) * tangent)
    return Rows(rod, piece, place, station, rough, point, tangent, across, at)


def _curve(wood: Wood, joined: np.ndarray, edge: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points (w, 3) and unit tangents (w, 3): cubic through the vertices, straight beyond the ends."""
    x, rods = wood.motion.x, wood.rods
    vector = x[rods.b] - x[rods.a]
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    t = _unit(vector)
    begin, finish = t.copy(), t.copy()
    inner = np.flatnonzero(joined)
    begin[inner + 1] = finish[inner] = _unit(t[inner] + t[inner + 1])
    u = np.clip(share, 0, 1)[:, None]
    over = share[:, None] - u
    p, q, d0, d1 = x[rods.a[edge]], x[rods.b[edge]], begin[edge] * length[edge], finish[edge] * length[edge]
    point = (1 + 2 * u) * (1 - u) ** 2 * p + u**2 * (3 - 2 * u) * q + u * (1 - u) * ((1 - u) * d0 - u * d1)
    point += over * np.where(over > 0, d1, d0)
    return point, _unit((1 - u) * begin[edge] + u * finish[edge])


def _upright(tangent: np.ndarray) -> np.ndarray:
    """Return the y axis (w, 3) turned by the least rotation that takes the x axis to the tangents."""
    c, t1, t2 = tangent.T
    less = 1 / np.maximum(1 + c, 1e-6)
    return np.column_stack([-t1, c + t2**2 * less, -t1 * t2 * less])


def _material(wood: Wood, joined: np.ndarray, edge: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the first axis (w, 3) of the material frames, which edges have at their middles."""
    m, t = wood.motion, wood.motion.old
    theta = m.theta[:, None]
    own = np.cos(theta) * m.d + np.sin(theta) * np.cross(t, m.d)
    half = np.clip(share, 0, 1) - 0.5
    other = np.clip(edge + np.where(half > 0, 1, -1), 0, len(t) - 1)
    beside = (other != edge) & joined[np.clip(np.minimum(edge, other), 0, len(joined) - 1)] if len(joined) else False
    weight = np.where(beside, np.abs(half), 0.0)[:, None]
    found: np.ndarray = (1 - weight) * own[edge] + weight * own[other]
    return found
