"""Threads on a surface: where they stand, how they bend, and ribbons and heads that stand for them as triangles.

Feet are drawn once, on the first stage's triangles, each with a rank of its own: in a stage those stand whose rank is
below the share of the largest density there. So a thread that has grown stays where it is, and moves with its skin.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.arrays import Array, Floats, Ints
from solver.contract import Fur

__all__ = ["Feet", "Threads", "feet", "grown", "ribbons"]

#: Most threads of a picture; points of a thread; how far long ones droop, over their length.
_MOST, _POINTS, _DROOP = 20_000, 4, 0.15
#: Faces of an octahedron about the origin, corners +x, -x, +y, -y, +z, -z.
_OCTAHEDRON = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])


class Feet(NamedTuple):
    """Where threads may stand: corners of a triangle (k, 3), shares of them (k, 3), and numbers of each (k)."""

    corners: Ints
    shares: Floats
    rank: Floats
    spin: Floats
    size: Floats
    ripe: Floats


class Threads(NamedTuple):
    """Threads that stand: points (k, 4, 3) from the foot up, which feet (k), colours of foot and tip (k, 3).

    width: at the foot, of all or of each (k). heads (k): half-widths of the heads, 0 where there is none. out (k, 3):
    the skin's normals.
    """

    points: Floats
    foot: Ints
    low: Floats
    high: Floats
    width: float | Floats
    heads: Floats
    out: Floats


def feet(vertices: Array, faces: Array, peak: float, most: int = _MOST) -> Feet:
    """Return feet on a surface (v, 3), (f, 3), `peak` on a unit of area but not more than `most`."""
    corners = np.asarray(vertices, float)[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    count = int(min(peak * area.sum(), most))
    rng = np.random.default_rng(0)
    face = np.sort(rng.choice(len(area), size=count, p=area / area.sum()))
    a, b = np.sqrt(rng.random(count)), rng.random(count)
    shares = np.stack([1 - a, a * (1 - b), a * b], axis=1)
    return Feet(np.asarray(faces, np.int64)[face], shares, *rng.random((4, count)))


def grown(where: Feet, vertices: Array, normals: Array, fur: Fur) -> Threads:
    """Return the threads of a stage, whose vertices (v, 3) have normals (v, 3)."""

    def there(values: Array) -> Array:
        found: Array = np.einsum("kc,kc...->k...", where.shares, np.asarray(values, float)[where.corners])
        return found

    stands = np.flatnonzero((where.rank * fur.peak < there(fur.density)) & (there(fur.length) > 0))
    corners, *numbers = where
    where = Feet(corners[stands], *(part[stands] for part in numbers))
    root, out = there(vertices), there(normals)
    out = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
    other = np.where(np.abs(out[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    east = np.cross(other, out)
    east /= np.maximum(np.linalg.norm(east, axis=1, keepdims=True), 1e-12)
    turn = 2 * np.pi * where.spin[:, None]
    side = np.cos(turn) * east + np.sin(turn) * np.cross(out, east)
    # what is one number for all threads stays one
    width, head, leaning = (there(np.asarray(x)) if np.ndim(x) else x for x in (fur.width, fur.head, fur.lean))
    leaning = np.reshape(leaning, (-1, 1))
    lean = leaning * (0.3 + where.size[:, None])
    length = there(fur.length)[:, None] * (0.5 + 0.8 * where.size[:, None])
    along = np.linspace(0, 1, _POINTS)
    points = np.stack([root + length * (s * out + lean * (0.4 * s + 0.6 * s**2) * side) for s in along], axis=1)
    points[..., 1] -= _DROOP * leaning * length * along**2
    heads = np.where(where.ripe < there(fur.ripe), head, 0.0)
    return Threads(points, stands, there(fur.foot), there(fur.tip), width, heads, out)


def ribbons(threads: Threads) -> tuple[Floats, Ints, Floats, Floats]:
    """Return vertices (v, 3), triangles (f, 3), colours (v, 3) and normals (v, 3) that stand for threads.

    Each is a ribbon that narrows to its tip; a head is an octahedron.
    """
    points, out = threads.points, threads.out
    count, steps = points.shape[:2]
    if not count:
        empty = np.empty((0, 3))
        return empty, np.empty((0, 3), np.int64), empty, empty
    way = points[:, -1] - points[:, 0]
    across = np.cross(way, out + 0.31)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    narrow = np.linspace(1, 0.35, steps)[None, :, None] * np.reshape(threads.width, (-1, 1, 1)) / 2
    left, right = points - narrow * across[:, None], points + narrow * across[:, None]
    vertices = np.stack([left, right], axis=2).reshape(-1, 3)
    share = np.repeat(np.linspace(0, 1, steps), 2)[None, :, None]
    colour = (threads.low[:, None] * (1 - share) + threads.high[:, None] * share).reshape(-1, 3)
    one = np.array([[2 * i, 2 * i + 1, 2 * i + 3] for i in range(steps - 1)])
    two = np.array([[2 * i, 2 * i + 3, 2 * i + 2] for i in range(steps - 1)])
    faces = (2 * steps * np.arange(count)[:, None, None] + np.concatenate([one, two])).reshape(-1, 3)
    normals = np.repeat(out, 2 * steps, axis=0)
    headed = np.flatnonzero(threads.heads > 0)
    if not len(headed):
        return vertices, faces, colour, normals
    axes = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    knobs = points[headed, -1][:, None] + threads.heads[headed, None, None] * axes
    more = len(vertices) + 6 * np.arange(len(headed))[:, None, None] + _OCTAHEDRON
    return (
        np.concatenate([vertices, knobs.reshape(-1, 3)]),
        np.concatenate([faces, more.reshape(-1, 3)]),
        np.concatenate([colour, np.repeat(threads.high[headed] * 0.5, 6, axis=0)]),
        np.concatenate([normals, np.tile(axes, (len(headed), 1))]),
    )
