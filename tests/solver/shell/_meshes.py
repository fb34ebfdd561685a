"""Meshes and plain-numpy twins that the shell's tests share."""

import numpy as np
from scipy.spatial import ConvexHull


def sheet(rows: int, columns: int, length: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return an equilateral lattice in the plane z = 0, normals up."""
    y, x = np.mgrid[:rows, :columns].astype(float)
    points = np.stack([(x + 0.5 * (y % 2)) * length, y * length * np.sqrt(0.75), 0 * x], -1).reshape(-1, 3)
    faces = []
    for r in range(rows - 1):
        for c in range(columns - 1):
            a, b, d, e = r * columns + c, r * columns + c + 1, (r + 1) * columns + c, (r + 1) * columns + c + 1
            faces += [[a, b, d], [b, e, d]] if r % 2 == 0 else [[a, b, e], [a, e, d]]
    return points, np.array(faces)


def ball(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a Fibonacci sphere, normals outward."""
    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, np.pi * (1 + 5**0.5) * i
    points = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], -1)
    faces = ConvexHull(points).simplices
    p = points[faces]
    inward = np.einsum("fi,fi->f", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p.sum(1)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return points, faces.astype(np.int64)


def membrane_twin(x, faces, g, lame):
    """Energy of the membrane by orthonormal frames and deformation gradients."""
    total = 0.0
    for face, (g11, g12, g22) in zip(faces, g, strict=True):
        rest = np.linalg.cholesky(np.array([[g11, g12], [g12, g22]])).T
        f = np.stack([x[face[1]] - x[face[0]], x[face[2]] - x[face[0]]], -1) @ np.linalg.inv(rest)
        e = (f.T @ f - np.eye(2)) / 2
        total += np.linalg.det(rest) / 2 * (lame / 2 * np.trace(e) ** 2 + np.sum(e * e))
    return total


def angle_twin(x, hinge):
    """Angle between the normals, by arccos and the sign of the fold."""
    i, j, k, m = x[hinge]
    n1, n2 = np.cross(j - i, k - i), np.cross(i - j, m - j)
    n1, n2 = n1 / np.linalg.norm(n1), n2 / np.linalg.norm(n2)
    return np.arccos(np.clip(n1 @ n2, -1, 1)) * np.sign(-(m - i) @ n1)
