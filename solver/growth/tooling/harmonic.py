"""Harmonic interpolation: values painted at some vertices, spread by Laplace's equation (the paper's 4.3)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from ...arrays import Floats, Ints
from ...contract import InvalidInput

__all__ = ["harmonic", "harmonic_tensors"]


def harmonic(x: Floats, triangles: Ints, painted: Ints, values: Floats) -> Floats:
    """Return the values (n,) or (n, k) that are harmonic but at the vertices `painted` (m,), where they are `values`.

    Linear elements (cotangents); the surface's border lets nothing through where it is not painted.

    Raises:
        InvalidInput: a part of the surface without any painted vertex.

    """
    n = len(x)
    weights = _cotangents(x, triangles)
    matrix = diags(np.asarray(weights.sum(axis=1)).ravel()) - weights
    inner = np.setdiff1d(np.arange(n), painted)
    found = np.zeros((n, *np.shape(values)[1:]))
    found[painted] = values
    if not len(inner):
        return found
    parts, part = connected_components(weights, directed=False)
    if len(np.unique(part[painted])) < parts:
        raise InvalidInput("nothing is painted on a part of the surface.", advice="Paint each part at least once.")
    rows = csr_matrix(matrix)[inner]
    found[inner] = spsolve(rows[:, inner].tocsc(), -(rows[:, painted] @ found[painted]))
    return found


def harmonic_tensors(
    x: Floats, triangles: Ints, painted: Ints, directions: Floats, rates: Floats
) -> tuple[Floats, Floats]:
    """Return rates (n, 2) and their first directions (n, 3), tangent unit vectors, from those of painted vertices.

    Coefficients of the tensors spread by themselves; the frame is made orthonormal anew from them, and scaled by the
    rates, which spread on their own: a turning frame would lose its anisotropy otherwise.
    """
    unit = directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-300)
    # the traceless part alone turns the frame, so that isotropic strokes have no say
    pull = (rates[:, 0] - rates[:, 1])[:, None, None] * (unit[:, :, None] * unit[:, None, :])
    both = harmonic(x, triangles, painted, np.concatenate([pull.reshape(-1, 9), rates], axis=1))
    normals = np.zeros_like(x)
    p = x[triangles]
    area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], area)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    flat = np.eye(3) - normals[:, :, None] * normals[:, None, :]
    tensors = flat @ both[:, :9].reshape(-1, 3, 3) @ flat
    values, vectors = np.linalg.eigh(tensors)
    # of rates that are less along than across, the first direction has the lowest value
    strongest = np.where(values[:, 2] >= -values[:, 0], 2, 0)
    return both[:, 9:], np.take_along_axis(vectors, strongest[:, None, None], axis=2)[:, :, 0]


def _cotangents(x: Floats, triangles: Ints) -> csr_matrix:
    """Return half the sums of cotangents opposite to each edge, symmetric (n, n)."""
    n = len(x)
    total = csr_matrix((n, n))
    for corner in range(3):
        o, i, j = (triangles[:, (corner + k) % 3] for k in range(3))
        a, b = x[i] - x[o], x[j] - x[o]
        area = np.maximum(np.linalg.norm(np.cross(a, b), axis=1), 1e-300)
        part = csr_matrix((0.5 * (a * b).sum(axis=1) / area, (i, j)), shape=(n, n))
        total = total + part + part.T
    return csr_matrix(total)
