"""What the tools do at one time: tensors of growth and of curving on each triangle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ... import shell
from ...arrays import Bools, Floats, Ints
from ..state import State
from .acting import Acting, curve, dabbed, spots, stretches, stroke, surface, tips
from .agreeing import agreed
from .painted import carried_ways, logs_of
from .tools import HotCurve, HotSpot, HotStroke, HotSurface, HotTensors, Tool, clocked, intensities

__all__ = ["Rates", "grown", "rates", "thickening"]


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
        own = clocked(tool)
        since = time - tool.start - (tool.delay if isinstance(tool, HotCurve) else 0.0)
        strength = (1.0 if since >= 0 else 0.0) if own else float(intensities(tool, np.array([since]))[0])
        if strength == 0:
            continue
        if isinstance(tool, HotTensors):
            some, logs, v = _tensors(state, number)
            for k in range(3):
                edges[some, k] += strength * _tensor(logs[:, k, 0], logs[:, k, 1], v)
            continue
        some, share, along = _acting(state, tool, number, time, since)
        first, second = np.log(stretches(state, tool, number))
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


def thickening(state: State, tools: Mapping[int, Tool], time: float) -> Floats | None:
    """Return the logarithmic rates (n,) at which strokes thicken the sheet at a growth time; None where none does."""
    found: Floats | None = None
    for number, tool in tools.items():
        if not isinstance(tool, HotStroke) or tool.thickening == 1:
            continue
        strength = float(intensities(tool, np.array([time - tool.start]))[0])
        if strength:
            more = strength * np.log(tool.thickening) * dabbed(state, tool, number, time)[0]
            found = more if found is None else found + more
    return found


def _acting(
    state: State, tool: HotSpot | HotCurve | HotSurface | HotStroke, number: int, time: float, since: float
) -> Acting:
    if isinstance(tool, HotSurface):
        return surface(state, tool, number, time)
    if isinstance(tool, HotCurve):
        return curve(state, tool, number, since)
    if isinstance(tool, HotStroke):
        return stroke(state, tool, number, time)
    return spots(state, tool, number, time)


def _tensors(state: State, number: int) -> tuple[Ints, Floats, Floats]:
    """Return triangles (m,), logarithmic rates (m, 3, 2) of their edges, and first directions (m, 2) in rest frames."""
    ridden = state.shares[number]
    some, logs = tips(state, logs_of(ridden))
    s, t = carried_ways(ridden, state.mesh.triangles[some]).T
    l11, l12, l22 = _frames(state.g[some])
    v = np.stack([l11 * s + l12 * t, l22 * t], -1)
    return some, logs, v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300)


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
