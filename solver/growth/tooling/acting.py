"""Where tools act at one time, how much, and along which way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...arrays import Floats, Ints
from ..state import Spot, State
from .geodesic import Distances, carried, distances
from .reach import within
from .tools import HotCurve, HotSpot, HotStroke, HotSurface, clocked, intensities

__all__ = ["Acting", "curve", "dabbed", "spots", "stretches", "stroke", "surface", "tips"]


class Acting(NamedTuple):
    """Triangles (m,), the shares (m, 3) of their edges, by the corners opposite to them, and ways in space (m, 3)."""

    some: Ints
    share: Floats
    along: Floats


def tips(state: State, values: Floats) -> tuple[Ints, Floats]:
    """Return triangles (m,) and the means (m, 3, ...) of their edges' tips' values, as the paper has it, where not 0.

    values: (n, ...) of vertices.
    """
    i, j, k = (values[corner] for corner in state.mesh.triangles.T)
    there = (i != 0) | (j != 0) | (k != 0)
    some = np.flatnonzero(there if there.ndim == 1 else there.any(axis=tuple(range(1, there.ndim))))
    i, j, k = i[some], j[some], k[some]
    return some, np.stack([(j + k) / 2, (k + i) / 2, (i + j) / 2], 1)


def stretches(state: State, tool: HotSpot | HotCurve | HotSurface | HotStroke, number: int) -> Floats:
    """Return the stretches of a tool along its way and across it (2,)."""
    first, second = tool.stretch
    if isinstance(tool, HotCurve) and tool.normalised:
        # the paper's D_T = 1 + lambda (D_N - 1) r_e gamma for small steps, where D - 1 is log D: what grows out moves
        # the curve by log(D_N) r_e; r_e: radius times the kernel's integral, 8/15; gamma: mean curvature
        line = state.curves[number].at(state.x, state.mesh.triangles)
        share = tool.normalised * tool.radius * 8 / 15 * _turning(line, tool.closed)
        first *= second**share
    return np.array([np.clip(first, 0.1, 10.0), second])


def _turning(line: Floats, closed: bool) -> float:
    """Return the total turning of a polyline over its length."""
    ways = np.diff(np.concatenate([line, line[:2]]) if closed else line, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    ways = ways / np.maximum(lengths[:, None], 1e-300)
    turns = np.arccos(np.clip((ways[1:] * ways[:-1]).sum(-1), -1, 1))
    return float(turns.sum() / (lengths[:-1] if closed else lengths).sum())


def surface(state: State, tool: HotSurface, number: int, time: float) -> Acting:
    """Return where a part of the surface acts."""
    values = state.shares[number]
    if clocked(tool):
        own = (time - tool.start - tool.offset * values[:, 1]) * tool.pace ** values[:, 2]
        values = values[:, 0] * intensities(tool, own)
    some, share = tips(state, values)
    if tool.frame == "around":
        middle = state.x[state.mesh.triangles[some]].mean(axis=1)
        return Acting(some, share, np.stack([-middle[:, 1], middle[:, 0], np.zeros(len(middle))], -1))
    return Acting(some, share, np.broadcast_to(np.array(tool.frame), (len(share), 3)))


def _reached(state: State, tool: HotSpot | HotStroke, spot: Spot) -> tuple[Ints, Floats, Floats]:
    """Return the vertices (m,) that a spot or a dab reaches, how much (m,), and how far all are (n,), if by surface."""
    x, triangles = state.x, state.mesh.triangles
    there = spot.anchor.at(x, triangles)[0]
    corners = triangles[spot.anchor.faces[0]]
    if tool.distance == "surface":
        seeds = np.unique(triangles[np.isin(triangles, corners).any(axis=1)])
        # beyond the radius by an edge, as a triangle's slope needs its three corners
        limit = spot.radius + 2 * state.length
        away = distances(x, triangles, seeds, np.linalg.norm(x[seeds] - there, axis=1), limit, False).away
        near = np.flatnonzero(np.isfinite(away))
    else:
        away = np.linalg.norm(x - there, axis=1)
        near = within(state, corners, spot.radius, away)
    return near, _kernel(tool.kernel, away[near] / spot.radius), away


def spots(state: State, tool: HotSpot, number: int, time: float) -> Acting:
    """Return where hot spots act: as the strongest there does."""
    triangles, x = state.mesh.triangles, state.x
    whole, middle = np.zeros(len(x)), np.zeros((len(x), 3))
    away = np.full(len(x), np.inf)
    for spot in state.spots[number]:
        if spot.letter and spot.letter in tool.resting:
            continue
        near, value, found = _reached(state, tool, spot)
        middle[near[value > whole[near]]] = spot.anchor.at(x, triangles)[0]
        whole[near] = np.maximum(whole[near], value)
        away = np.minimum(away, found)
    some, share = tips(state, whole)
    p = x[triangles[some]]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    if tool.polar and tool.distance == "surface":
        axis = _slope(p, normal, away[triangles[some]])
    elif tool.polar:
        # away from the spot that acts most at the corner where any does
        strongest = np.take_along_axis(triangles[some], whole[triangles[some]].argmax(axis=1)[:, None], 1)[:, 0]
        axis = p.mean(axis=1) - middle[strongest]
        axis = axis - (normal * axis).sum(axis=1)[:, None] * normal
    else:
        axis = np.array(tool.frame)
        axis = axis - (normal @ axis)[:, None] * normal
    turn = np.radians(tool.angle + tool.turning * (time - tool.start))
    return Acting(some, share, np.cos(turn) * axis + np.sin(turn) * np.cross(normal, axis))


def _slope(p: Floats, normal: Floats, values: Floats) -> Floats:
    """Return the ways (m, 3) in which linear values (m, 3) of triangles (m, 3, 3) rise; 0 where one is not known."""
    v = np.where(np.isfinite(values).all(axis=1, keepdims=True), values, 0.0)
    edges = np.stack([p[:, 2] - p[:, 1], p[:, 0] - p[:, 2], p[:, 1] - p[:, 0]], 1)
    return np.asarray(np.einsum("mk,mkc->mc", v, np.cross(normal[:, None], edges)))


def stroke(state: State, tool: HotStroke, number: int, time: float) -> Acting:
    """Return where a stroke acts, how much, and along which way: that of the dab that acts most."""
    whole, ways = dabbed(state, tool, number, time)
    some, share = tips(state, whole)
    return Acting(some, share, ways[state.mesh.triangles[some]].mean(axis=1))


def dabbed(state: State, tool: HotStroke, number: int, time: float) -> tuple[Floats, Floats]:
    """Return how much a stroke acts at each vertex (n,), and along which way (n, 3): as the dab that acts most."""
    x = state.x
    whole, ways = np.zeros(len(x)), np.zeros((len(x), 3))
    for spot in state.spots[number]:
        if not 0 <= time - tool.laid(spot.dab) < tool.hold:
            continue
        near, value, _ = _reached(state, tool, spot)
        stronger = value > whole[near]
        whole[near[stronger]] = value[stronger]
        ways[near[stronger]] = tool.ways[spot.dab] if tool.ways else 0.0
    return whole, ways


def _kernel(name: str, r: Floats) -> Floats:
    inside = r < 1
    if name == "flat":
        return inside.astype(float)
    near = np.where(inside, r, 1.0)
    return 1 - near if name == "cone" else (1 - near * near) ** 2


def curve(state: State, tool: HotCurve, number: int, since: float) -> Acting:
    """Return where a curve acts: as its nearest point does."""
    x, triangles = state.x, state.mesh.triangles
    line = state.curves[number].at(x, triangles)
    tails, heads = line, np.roll(line, -1, axis=0)
    if not tool.closed:
        tails, heads = tails[:-1], heads[:-1]
    painted = (
        tool.intensities or (1.0,) * len(line),
        tool.offsets or (0.0,) * len(line),
        tool.paces or (1.0,) * len(line),
    )
    points = np.array(painted).T
    local, along = np.zeros((len(x), 3)), np.zeros((len(x), 3))
    best = np.full(len(x), np.inf)
    for k, (tail, head) in enumerate(zip(tails, heads, strict=True)):
        way = head - tail
        u = np.clip((x - tail) @ way / max(way @ way, 1e-300), 0, 1)
        gap = np.linalg.norm(x - tail - u[:, None] * way, axis=1)
        nearer = gap < best
        best = np.where(nearer, gap, best)
        value = (1 - u)[:, None] * points[k] + u[:, None] * points[(k + 1) % len(line)]
        local = np.where(nearer[:, None], value, local)
        along[nearer] = way
    # a curve is near all along, and not only where its control points are
    pieces = max(2, int(np.linalg.norm(heads - tails, axis=1).max(initial=0) / (0.5 * tool.radius)) + 1)
    if tool.distance == "surface":
        pieces = max(pieces, int(np.linalg.norm(heads - tails, axis=1).max(initial=0) / (0.5 * state.length)) + 1)
    path = (tails[:, None] + np.linspace(0, 1, min(pieces, 200))[:, None] * (heads - tails)[:, None]).reshape(-1, 3)
    sources = np.unique(KDTree(x).query(path)[1])
    if tool.distance == "surface":
        found = _from(state, sources, best, tool.radius)
        best, near = found.away, np.flatnonzero(np.isfinite(found.away))
        told = carried(found, np.concatenate([local, along], axis=1))
        local, along = told[:, :3], told[:, 3:]
    else:
        near = within(state, sources, tool.radius, best)
    share = local[:, 0]
    if tool.offsets or tool.paces:
        share = share * intensities(tool, (since - local[:, 1]) * local[:, 2])
    whole = np.zeros(len(x))
    whole[near] = share[near] * _kernel("smooth", best[near] / tool.radius)
    some, mean = tips(state, whole)
    return Acting(some, mean, along[triangles[some]].mean(axis=1))


def _from(state: State, sources: Ints, near: Floats, radius: float) -> Distances:
    """Return distances along the surface from a line: `near` (n,) at vertices around `sources`, fronts beyond."""
    triangles = state.mesh.triangles
    seeds = np.unique(triangles[np.isin(triangles, sources).any(axis=1)])
    return distances(state.x, triangles, seeds, near[seeds], radius + 2 * state.length, True)
