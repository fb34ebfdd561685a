"""From triangles to pixels: every triangle tests the few of its bounding box, and the nearest fragment wins."""

from __future__ import annotations

import numpy as np

from solver.arrays import Array, Bools

__all__ = ["finer", "normals", "rasterise"]


def finer(values: Array, faces: Array, longest: float) -> tuple[Array, Array]:
    """Cut triangles with an edge above `longest` in four, until there are none; values (v, k) begin with places."""
    done = []
    while True:
        p = values[faces, :3]
        long = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1) > longest
        done.append(faces[~long])
        if not long.any() or len(values) > 4_000_000:
            return values, np.concatenate([*done, faces[long]])
        a, b, c = faces[long].T
        middles = [0.5 * (values[i] + values[j]) for i, j in ((a, b), (b, c), (c, a))]
        ab, bc, ca = (len(values) + k * len(a) + np.arange(len(a)) for k in range(3))
        values = np.concatenate([values, *middles])
        faces = np.concatenate([np.stack(t, -1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])


def normals(vertices: Array, faces: Array) -> Array:
    """Return the unit normals of vertices (v, 3), by the areas of the triangles about them."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for axis in range(3):
        for corner in range(3):
            total[:, axis] += np.bincount(faces[:, corner], areas[:, axis], len(vertices))
    found: Array = total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-300)
    return found


def rasterise(points: Array, depth: Array, faces: Array, side: int, both: bool) -> tuple[Array, Array, Array, Bools]:
    """Return (pixel index, face, barycentric weights, seen from behind) of what is nearest to the eye in each pixel.

    both: triangles that turn away from the eye are drawn too.
    """
    corners = points[faces]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0]
    # the picture's second axis points down
    front = np.flatnonzero(np.abs(area) > 1e-12) if both else np.flatnonzero(area < -1e-12)
    behind = area > 0
    corners, edge1, edge2, area = corners[front], edge1[front], edge2[front], area[front]
    low = np.floor(corners.min(axis=1)).astype(int)
    span = np.ceil(corners.max(axis=1)).astype(int) - low
    found = []
    for dy in range(int(span[:, 1].max(initial=0)) + 1):
        for dx in range(int(span[:, 0].max(initial=0)) + 1):
            near = np.flatnonzero((span[:, 0] >= dx) & (span[:, 1] >= dy))
            pixel = low[near] + [dx, dy]
            offset = pixel + 0.5 - corners[near, 0]
            u = (offset[:, 0] * edge2[near, 1] - offset[:, 1] * edge2[near, 0]) / area[near]
            v = (edge1[near, 0] * offset[:, 1] - edge1[near, 1] * offset[:, 0]) / area[near]
            inside = (u >= 0) & (v >= 0) & (u + v <= 1) & ((pixel >= 0) & (pixel < side)).all(axis=1)
            u, v = u[inside], v[inside]
            found.append(
                (pixel[inside, 1] * side + pixel[inside, 0], front[near[inside]], np.stack([1 - u - v, u, v], -1))
            )
    index, face, weights = (np.concatenate(parts) for parts in zip(*found, strict=True))
    near_last = np.argsort(np.einsum("fk,fk->f", weights, depth[faces[face]]), kind="stable")
    winner = np.full(side * side, -1)
    winner[index[near_last]] = near_last
    kept = winner[winner >= 0]
    return index[kept], face[kept], weights[kept], behind[face[kept]]
