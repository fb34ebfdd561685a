"""What the tools do at one time: tensors of growth and of curving on each triangle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ... import shell
from ...arrays import Bools, Floats, Ints
from ..state import State
from .agreeing import agreed
from .reach import within
from .tools import HotCurve, HotSpot, HotStroke, HotSurface, Tool, intensities

__all__ = ["Rates", "grown", "rates"]


class Rates(NamedTuple):
    """Per unit time, in each triangle's orthonormal rest frame (f, 3: 11, 12, 22): logarithmic strain, curvature.

    edges: (f, 3, 3) logarithmic strain at the middle of each edge, edge k opposite to corner k; strain is their mean.
    """

    strain: Floats
    edges: Floats
    curving: Floats


def rates(state: State, tools: Mapping[int, Tool], time: float) -> Rates:
    """Return the sum of what all tools do at a growth time."""
    count = len(state.mesh.triangles)
    edges, curving = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for number, tool in tools.items():
        # places with clocks of their own have their intensity in their share
        own = (isinstance(tool, HotCurve) and bool(tool.offsets or tool.paces)) or (
            isinstance(tool, HotSurface) and tool.later is not None
        )
        since = time - tool.start - (tool.delay if isinstance(tool, HotCurve) else 0.0)
        strength = (1.0 if since >= 0 else 0.0) if own else float(intensities(tool, np.array([since]))[0])
        if strength == 0:
            continue
        if isinstance(tool, HotSurface):
            some, share, along = _surface(state, tool, number, time)
        elif isinstance(tool, HotCurve):
            some, share, along = _curve(state, tool, state.curves[number].at(state.x, state.mesh.triangles), since)
        elif isinstance(tool, HotStroke):
            some, share, along = _stroke(state, tool, number, time)
        else:
            some, share, along = _spots(state, tool, number, time)
        first, second = np.log(_stretches(state, tool, number))
        if isinstance(tool, HotStroke) or (isinstance(tool, HotSpot) and tool.polar):
            # a brush that goes nowhere grows the same area, all round, and so does the middle of a spot
            still = ~along.any(axis=1)
            first, second = np.where(still, (first + second) / 2, first), np.where(still, (first + second) / 2, second)
        share = strength * share
        v = _in_rest_frame(state, along, some)
        for k in range(3):
            edges[some, k] += _tensor(share[:, k] * first, share[:, k] * second, v)
        if isinstance(tool, HotSurface) and any(tool.curl):
            mean = share.mean(axis=1)
            curving[some] += _tensor(mean * tool.curl[0], mean * tool.curl[1], v)
    return Rates(edges.mean(axis=1), edges, curving)


def grown(state: State, found: Rates, dt: float) -> tuple[Floats, Floats]:
    """Return rest metrics (f, 3) and rest angles (h,) after dt: G = exp(2 dt strain) in each triangle's rest frame.

    Neighbours agree on what their common edge grows by (`agreed`). Angles stay under stretching (so that a sphere's
    curvature scales by 1/s) and take what curving adds. What does not grow keeps its numbers.
    """
    mesh, some = state.mesh, np.flatnonzero(_nonzero(found.strain) | _nonzero(found.curving))
    e11, e12, e22 = _exponential(dt * found.strain[some])
    l11, l12, l22 = _frames(state.g[some])
    # rows of the stretched frame: U L
    u11, u12 = e11 * l11, e11 * l12 + e12 * l22
    u21, u22 = e12 * l11, e12 * l12 + e22 * l22
    moved, g = _nonzero(found.strain[some]), state.g.copy()
    own = np.stack([u11 * u11 + u21 * u21, u11 * u12 + u21 * u22, u12 * u12 + u22 * u22], -1)[moved]
    ratios = _stretched(found.edges[some[moved]] * dt, l11[moved], l12[moved], l22[moved])
    g[some[moved]] = agreed(state.g[some[moved]], own, ratios, mesh.face_edges[some[moved]], len(mesh.edges))
    rest = state.rest
    if found.curving.any():
        k11, k12, k22 = (dt * found.curving[some]).T
        b = np.zeros_like(g)
        b[some] = np.stack(
            [
                k11 * u11 * u11 + 2 * k12 * u11 * u21 + k22 * u21 * u21,
                k11 * u11 * u12 + k12 * (u11 * u22 + u21 * u12) + k22 * u21 * u22,
                k11 * u12 * u12 + 2 * k12 * u12 * u22 + k22 * u22 * u22,
            ],
            -1,
        )
        rest = rest + shell.added_angles(b, g, mesh)
    return g, rest


def _exponential(strain: Floats) -> tuple[Floats, Floats, Floats]:
    """Return exp of symmetric matrices (m, 3: 11, 12, 22)."""
    h11, h12, h22 = strain.T
    mean, half = (h11 + h22) / 2, np.hypot((h11 - h22) / 2, h12)
    slope = np.where(half > 1e-12, np.sinh(half) / np.maximum(half, 1e-300), 1.0)
    even = np.cosh(half)
    grows = np.exp(mean)
    return grows * (even + slope * (h11 - h22) / 2), grows * slope * h12, grows * (even - slope * (h11 - h22) / 2)


def _stretched(strain: Floats, l11: Floats, l12: Floats, l22: Floats) -> Floats:
    """Return what the squares of three edges (m, 3) grow by, each by the strain (m, 3, 3) at its own middle."""
    found = []
    for k, (a, b) in enumerate(((l12 - l11, l22), (l12, l22), (l11, np.zeros_like(l11)))):
        e11, e12, e22 = _exponential(strain[:, k])
        found.append(((e11 * a + e12 * b) ** 2 + (e12 * a + e22 * b) ** 2) / (a * a + b * b))
    return np.stack(found, -1)


def _nonzero(rates: Floats) -> Bools:
    """Return which rows (m,) of (m, 3) are not all 0; column by column, as numpy is slow along short rows."""
    a, b, c = rates.T
    return np.asarray((a != 0) | (b != 0) | (c != 0))


def _frames(g: Floats) -> tuple[Floats, Floats, Floats]:
    """Return L = [[l11, l12], [0, l22]] with L^T L = g: the edges in the triangle's own orthonormal frame."""
    l11 = np.sqrt(g[:, 0])
    l12 = g[:, 1] / l11
    return l11, l12, np.sqrt(g[:, 2] - l12 * l12)


def _in_rest_frame(state: State, along: Floats, some: Ints) -> Floats:
    """Return unit vectors (m, 2) of directions in space (m, 3), carried back to some rest frames by the shape."""
    p = state.x[state.mesh.triangles[some]]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    aa, ab, bb = (a * a).sum(-1), (a * b).sum(-1), (b * b).sum(-1)
    va, vb = (along * a).sum(-1), (along * b).sum(-1)
    s, t = bb * va - ab * vb, aa * vb - ab * va
    l11, l12, l22 = _frames(state.g[some])
    v = np.stack([l11 * s + l12 * t, l22 * t], -1)
    size = np.linalg.norm(v, axis=1, keepdims=True)
    # a direction along the normal has no projection: any frame is as good
    return np.where(size > 1e-12, v / np.maximum(size, 1e-300), np.array([1.0, 0.0]))


def _tensor(first: Floats, second: Floats, v: Floats) -> Floats:
    """Return first v v^T + second (1 - v v^T), (f, 3)."""
    c, s = v.T
    return np.stack([first * c * c + second * s * s, (first - second) * c * s, first * s * s + second * c * c], -1)


def _tips(state: State, share: Floats) -> tuple[Ints, Floats]:
    """Return triangles (m,) and the means of their edges' tips' shares (m, 3), as the paper has it, where not 0."""
    i, j, k = (share[corner] for corner in state.mesh.triangles.T)
    some = np.flatnonzero((i != 0) | (j != 0) | (k != 0))
    i, j, k = i[some], j[some], k[some]
    return some, np.stack([(j + k) / 2, (k + i) / 2, (i + j) / 2], -1)


def _stretches(state: State, tool: Tool, number: int) -> Floats:
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


def _surface(state: State, tool: HotSurface, number: int, time: float) -> tuple[Ints, Floats, Floats]:
    values = state.shares[number]
    if tool.later is not None:
        values = values[:, 0] * intensities(tool, time - tool.start - tool.offset * values[:, 1])
    some, share = _tips(state, values)
    if tool.frame == "around":
        middle = state.x[state.mesh.triangles[some]].mean(axis=1)
        return some, share, np.stack([-middle[:, 1], middle[:, 0], np.zeros(len(middle))], -1)
    return some, share, np.broadcast_to(np.array(tool.frame), (len(share), 3))


def _spots(state: State, tool: HotSpot, number: int, time: float) -> tuple[Ints, Floats, Floats]:
    triangles, x = state.mesh.triangles, state.x
    whole, middle = np.zeros(len(x)), np.zeros((len(x), 3))
    for spot in state.spots[number]:
        if spot.letter and spot.letter in tool.resting:
            continue
        there = spot.anchor.at(x, triangles)[0]
        away = np.linalg.norm(x - there, axis=1)
        near = within(state, triangles[spot.anchor.faces[0]], spot.radius, away)
        value = _kernel(tool.kernel, away[near] / spot.radius)
        middle[near[value > whole[near]]] = there
        whole[near] = np.maximum(whole[near], value)
    some, share = _tips(state, whole)
    p = x[triangles[some]]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    if tool.polar:
        # away from the spot that acts most at the corner where any does
        strongest = np.take_along_axis(triangles[some], whole[triangles[some]].argmax(axis=1)[:, None], 1)[:, 0]
        axis = p.mean(axis=1) - middle[strongest]
        axis = axis - (normal * axis).sum(axis=1)[:, None] * normal
    else:
        axis = np.array(tool.frame)
        axis = axis - (normal @ axis)[:, None] * normal
    turn = np.radians(tool.angle + tool.turning * (time - tool.start))
    return some, share, np.cos(turn) * axis + np.sin(turn) * np.cross(normal, axis)


def _stroke(state: State, tool: HotStroke, number: int, time: float) -> tuple[Ints, Floats, Floats]:
    """Return where a stroke acts, how much, and along which way: that of the dab that acts most."""
    triangles, x = state.mesh.triangles, state.x
    whole, ways = np.zeros(len(x)), np.zeros((len(x), 3))
    for spot in state.spots[number]:
        if not 0 <= time - tool.laid(spot.dab) < tool.hold:
            continue
        away = np.linalg.norm(x - spot.anchor.at(x, triangles)[0], axis=1)
        near = within(state, triangles[spot.anchor.faces[0]], spot.radius, away)
        value = _kernel(tool.kernel, away[near] / spot.radius)
        stronger = value > whole[near]
        whole[near[stronger]] = value[stronger]
        ways[near[stronger]] = tool.ways[spot.dab] if tool.ways else 0.0
    some, share = _tips(state, whole)
    return some, share, ways[triangles[some]].mean(axis=1)


def _kernel(name: str, r: Floats) -> Floats:
    inside = r < 1
    if name == "flat":
        return inside.astype(float)
    near = np.where(inside, r, 1.0)
    return 1 - near if name == "cone" else (1 - near * near) ** 2


def _curve(state: State, tool: HotCurve, line: Floats, since: float) -> tuple[Ints, Floats, Floats]:
    x, triangles = state.x, state.mesh.triangles
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
    share = local[:, 0]
    if tool.offsets or tool.paces:
        share = share * intensities(tool, (since - local[:, 1]) * local[:, 2])
    # a curve is near all along, and not only where its control points are
    pieces = max(2, int(np.linalg.norm(heads - tails, axis=1).max(initial=0) / (0.5 * tool.radius)) + 1)
    path = (tails[:, None] + np.linspace(0, 1, min(pieces, 200))[:, None] * (heads - tails)[:, None]).reshape(-1, 3)
    near = within(state, np.unique(KDTree(x).query(path)[1]), tool.radius, best)
    whole = np.zeros(len(x))
    whole[near] = share[near] * _kernel("smooth", best[near] / tool.radius)
    some, mean = _tips(state, whole)
    return some, mean, along[triangles[some]].mean(axis=1)
