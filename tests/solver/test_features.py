"""Features of a skin and what neighbours may do to each other, by brute force over all pairs of triangles."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from solver.dehydration.contact.features import features, neighbours
from solver.geometry.crossings import split_quads

from ._skins import cubed_sphere, sheet


def expected(triangles, own_nodes, own_edges, source):
    """Rows of `neighbours`, in its order: corners against triangles one way, then the other, then edges."""
    image = source != np.arange(len(source))
    corners = [set(one) for one in triangles.tolist()]
    pairs = [(t, u) for t, u in itertools.combinations(range(len(triangles)), 2) if corners[t] & corners[u]]
    rows = []
    for turned, i in itertools.product((False, True), range(3)):
        for t, u in (pair[::-1] if turned else pair for pair in pairs):
            a = own_nodes[t, i]
            if a >= 0 and a not in corners[u] and not (image[a] and image[triangles[u]].all()):
                rows.append([t, u, a, *triangles[u], 0])
    for i, j in itertools.product(range(3), range(3)):
        for t, u in pairs:
            ends = [*own_edges[t, i], *own_edges[u, j]]
            if min(ends) >= 0 and len(set(ends)) == 4 and not image[ends].all():
                rows.append([t, u, *ends, 1])
    return rows


@pytest.mark.parametrize("images", [0, 40])
@pytest.mark.parametrize("skin", ["closed", "open"])
def test_what_neighbours_may_do_is_that_of_all_pairs(skin: str, images: int) -> None:
    quads = cubed_sphere(4)[1] if skin == "closed" else sheet(9, 7)
    triangles, nodes = split_quads(quads).astype(np.int32), int(quads.max()) + 1
    source = np.arange(nodes, dtype=np.int32)
    source[nodes - images :] = 0
    own_nodes, own_edges = features(triangles, nodes)
    found = neighbours(triangles, own_nodes, own_edges, source)
    assert found.dtype == np.int32
    assert found.flags.c_contiguous
    rows = expected(triangles, own_nodes, own_edges, source)
    assert len(rows) > 100
    assert found.tolist() == [[int(n) for n in row] for row in rows]


def test_one_triangle_has_no_neighbours() -> None:
    triangles = np.array([[0, 1, 2]], np.int32)
    assert neighbours(triangles, *features(triangles, 3), np.arange(3, dtype=np.int32)).shape == (0, 7)
