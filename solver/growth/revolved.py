"""Surfaces of revolution about z as triangles: rings of about even edges, stitched, with a point where they close."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints

__all__ = ["capsule", "cone", "revolved", "stem", "torus"]


def stem(count: int, height: float) -> tuple[Floats, Ints]:
    """Return a stem of radius 1 on z = 0, open below, of a height, with half a sphere on it."""
    return revolved([_line((1, 0), (1, height)), _quarter(height, 1)], count)


def capsule(count: int, length: float) -> tuple[Floats, Ints]:
    """Return a closed cylinder of radius 1 and a length, half a sphere at either end, its middle at 0."""
    half = length / 2
    return revolved([_quarter(-half, -1)[::-1], _line((1, -half), (1, half)), _quarter(half, 1)], count)


def cone(count: int, height: float) -> tuple[Floats, Ints]:
    """Return a cone of radius 1 on z = 0, open below, with its tip at a height."""
    return revolved([_line((1, 0), (0, height))], count)


def torus(count: int, aspect: float) -> tuple[Floats, Ints]:
    """Return a torus: circle of radius 1 in the plane z = 0, tube of radius 1 / aspect."""
    tube = 1 / aspect
    h = _edge(4 * np.pi**2 * tube, count)
    rows, columns = max(5, round(2 * np.pi * tube / (h * np.sqrt(0.75)))), max(6, round(2 * np.pi / h))
    rows += rows % 2
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    around, turn = 2 * np.pi * (i + 0.5 * (j % 2)) / columns, 2 * np.pi * j / rows
    r = 1 + tube * np.cos(turn)
    points = np.stack([r * np.cos(around), r * np.sin(around), tube * np.sin(turn)], -1).reshape(-1, 3)
    low, east = i + columns * j, (i + 1) % columns + columns * j
    high, far = i + columns * ((j + 1) % rows), (i + 1) % columns + columns * ((j + 1) % rows)
    even = (j % 2 == 0)[..., None]
    one = np.where(even, np.stack([low, east, high], -1), np.stack([low, east, far], -1))
    two = np.where(even, np.stack([east, far, high], -1), np.stack([low, far, high], -1))
    return points, np.concatenate([one.reshape(-1, 3), two.reshape(-1, 3)])


def revolved(parts: list[Floats], count: int) -> tuple[Floats, Ints]:
    """Return about `count` points (n, 3) and triangles, outward, of a profile turned about z.

    parts: polylines (k, 2) of radius and z, each from where the last one ended, the inside on their left; their ends
    are points of the mesh.
    """
    lengths = [np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]) for p in parts]
    area = sum(float((np.diff(s) * np.pi * (p[1:, 0] + p[:-1, 0])).sum()) for p, s in zip(parts, lengths, strict=True))
    h = _edge(area, count)
    profile = [parts[0][:1]]
    for part, s in zip(parts, lengths, strict=True):
        at = np.linspace(0, s[-1], max(1, round(s[-1] / (h * np.sqrt(0.75)))) + 1)[1:]
        profile.append(np.stack([np.interp(at, s, part[:, 0]), np.interp(at, s, part[:, 1])], -1))
    line = np.concatenate(profile)
    sizes = [1 if r < 1e-9 else max(5, round(2 * np.pi * r / h)) for r in line[:, 0]]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    points, triangles, turn = [], [], 0.0
    for (r, z), size in zip(line, sizes, strict=True):
        around = 2 * np.pi * (np.arange(size) + turn) / size
        points.append(np.stack([r * np.cos(around), r * np.sin(around), np.full(size, z)], -1))
        turn = 0.5 - turn
    for k in range(len(sizes) - 1):
        triangles += _stitched(sizes[k], sizes[k + 1], int(starts[k]), int(starts[k + 1]), 0.0 if k % 2 == 0 else 0.5)
    return np.concatenate(points), np.array(triangles, np.int64)


def _stitched(low: int, high: int, first: int, second: int, turn: float) -> list[tuple[int, int, int]]:
    """Return the triangles between two rings of `low` and `high` points, counter-clockwise from outside."""
    found, i, j = [], 0, 0
    while i < low * (low > 1) or j < high * (high > 1):
        here, there = (i + 1 + turn) / low, (j + 1.5 - turn) / high
        if high == 1 or (low > 1 and i < low and (here <= there or j >= high)):
            found.append((first + i % low, first + (i + 1) % low, second + j % high))
            i += 1
        else:
            found.append((first + i % low, second + (j + 1) % high, second + j % high))
            j += 1
    return found


def _edge(area: float, count: int) -> float:
    """Return the edge of equilateral triangles that put `count` points on an area."""
    return float(np.sqrt(area / (count * np.sqrt(0.75))))


def _line(a: tuple[float, float], b: tuple[float, float]) -> Floats:
    return np.array([a, b], float)


def _quarter(z: float, side: int) -> Floats:
    """Return a quarter of the unit circle about (0, z), from the equator to the pole above (side 1) or below (-1)."""
    turn = np.linspace(0, np.pi / 2, 65)
    found = np.stack([np.cos(turn), z + side * np.sin(turn)], -1)
    found[-1, 0] = 0.0
    return found
