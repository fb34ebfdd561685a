"""Crossing triangles: shapes whose count is known, and a twin that intersects every pair in plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from solver.geometry.boxes import LEAF, leaf_pairs, sort_boxes
from solver.geometry.crossings import cross, crossings, depth_of, split_quads

TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
FACES = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


def twin(points, triangles):
    """Pairs in which an edge of one triangle pierces the other: every pair, every edge, by the point it pierces in."""
    i, j = np.triu_indices(len(triangles), 1)
    apart = ~(triangles[i][:, :, None] == triangles[j][:, None, :]).any((1, 2))
    i, j = i[apart], j[apart]
    hit = np.zeros(len(i), bool)
    for u, v in ((i, j), (j, i)):
        s, t = points[triangles[u]], points[triangles[v]]
        normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        for k in range(3):
            tail, head = s[:, k], s[:, (k + 1) % 3]
            below = np.einsum("pi,pi->p", tail - t[:, 0], normal)
            above = np.einsum("pi,pi->p", head - t[:, 0], normal)
            piercing = below * above < 0
            share = np.divide(below, below - above, out=np.zeros(len(i)), where=piercing)
            at = tail + (head - tail) * share[:, None]
            for c in range(3):
                inward = np.cross(t[:, (c + 1) % 3] - t[:, c], at - t[:, c])
                piercing &= np.einsum("pi,pi->p", inward, normal) > 0
            hit |= piercing
    pairs = np.stack([i[hit], j[hit]], axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def soup(rng, count, size):
    points = rng.normal(size=(count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    return points.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def grid(rows, columns, closed=(False, False)):
    """Triangles of a grid of points, row by row."""
    i = np.arange(rows * columns).reshape(rows, columns)
    down, right = np.roll(i, -1, 0), np.roll(i, -1, 1)
    quads = np.stack([i, down, np.roll(down, -1, 1), right], axis=-1)
    return split_quads(quads[: rows if closed[0] else -1, : columns if closed[1] else -1].reshape(-1, 4))


@pytest.mark.parametrize("size", [0.3, 0.5, 1.0])
def test_the_same_pairs_as_every_pair_in_numpy(size):
    points, triangles = soup(np.random.default_rng(3), 120, size)
    expected = twin(points, triangles)
    assert len(expected) > 5
    assert np.array_equal(crossings(points, triangles).pairs, expected)


def test_sizes_that_differ_by_a_million_are_found_alike():
    rng = np.random.default_rng(4)
    points, triangles = soup(rng, 150, 1.0)
    small = 10.0 ** rng.uniform(-6, 0, size=(150, 1, 1))
    corners = points.reshape(150, 3, 3)
    points = (corners[:, :1] / 3 + (corners - corners[:, :1]) * small).reshape(-1, 3)
    assert np.array_equal(crossings(points, triangles).pairs, twin(points, triangles))


def test_two_tetrahedra_of_a_cube_cross_along_the_edges_of_an_octahedron():
    """Twelve edges, each of one face of either; all their ends lie on edges: nothing is in general position."""
    points, triangles = np.concatenate([TETRAHEDRON, -TETRAHEDRON]), np.concatenate([FACES, FACES + 4])
    rng = np.random.default_rng(5)
    assert crossings(points, triangles).count == 12
    for turn in Rotation.random(20, random_state=rng):
        assert crossings(turn.apply(points) * rng.uniform(0.1, 10), triangles).count == 12


def test_a_corner_through_a_face_is_three_crossings_as_deep_as_it_reaches():
    tip = TETRAHEDRON - TETRAHEDRON[0]  # its corner 0 at the origin, the rest behind it
    tip = Rotation.align_vectors([[0, 0, 1]], [tip.mean(0)])[0].apply(tip) - [0, 0, 0.05]
    plate = np.array([[-9, -8, 0], [9, -8, 0], [0, 16, 0.0]])
    turns = Rotation.random(5, random_state=np.random.default_rng(6))
    for turn in turns:
        found = crossings(turn.apply(np.concatenate([tip, plate])), np.concatenate([FACES, [[4, 5, 6]]]))
        assert found.count == 3
        assert found.depths == pytest.approx(np.full(3, 0.05), rel=1e-9)
        assert found.depth == pytest.approx(0.05)


@pytest.mark.parametrize("lift", [0.0, 1e-9, -1e-9])
def test_touching_is_no_crossing(lift):
    """A corner on a face, an edge on an edge, a face on a face; and a hair's breadth either way."""
    plate = np.array([[-3, -2, 0], [3, -2, 0], [0, 4, 0.0]])
    standing = np.array([[0, 0, lift], [1, 0, 1], [0.2, 1, 1]])
    found = crossings(np.concatenate([plate, standing]), [[0, 1, 2], [3, 4, 5]])
    assert found.count == (lift < 0)
    assert found.depth == pytest.approx(max(-lift, 0), rel=1e-5)
    for shift in ([0, 0, 0], [0.5, 0.1, 0], [6, 0, 0]):
        assert crossings(np.concatenate([plate, plate + shift]), [[0, 1, 2], [3, 4, 5]]).count == 0
    edge = np.array([[-1, -2, 0], [1, -2, 0], [0, -2, 5.0]])
    assert crossings(np.concatenate([plate, edge]), [[0, 1, 2], [3, 4, 5]]).count == 0


def test_an_edge_through_the_edge_between_two_faces_crosses_the_one_it_leans_to():
    roof = np.array([[0, -1, 0], [0, 1, 0], [1, 0, -0.5], [-1, 0, -0.5]])
    blade = np.array([[0.0, 0, 0.5], [0, 0, -0.5], [0.1, 3, 0]])
    found = crossings(np.concatenate([roof, blade]), [[0, 1, 2], [1, 0, 3], [4, 5, 6]])
    assert found.pairs.tolist() == [[0, 2]]


@pytest.mark.parametrize(("waist", "crosses"), [(0.3, False), (0.5, True)])
def test_a_tube_along_a_knot_crosses_where_it_is_thicker_than_the_knot_leaves_room(waist, crosses):
    """The strands of this trefoil are 0.77 apart at the least (measured below, from points of its axis)."""
    n, m = 400, 24
    s = np.arange(n) * 2 * np.pi / n
    axis = np.stack([np.sin(s) + 2 * np.sin(2 * s), np.cos(s) - 2 * np.cos(2 * s), -np.sin(3 * s)], axis=1) / 2
    apart = np.linalg.norm(axis[:, None] - axis[None], axis=2)
    along = np.minimum(abs(s[:, None] - s), 2 * np.pi - abs(s[:, None] - s))
    assert (2 * waist > apart[along > 1].min()) == crosses
    tangent = np.roll(axis, -1, 0) - np.roll(axis, 1, 0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    first = np.cross(tangent, [0.3, 0.2, 1])
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(tangent, first)
    around = np.arange(m) * 2 * np.pi / m
    tube = axis[:, None] + waist * (
        first[:, None] * np.cos(around)[:, None] + second[:, None] * np.sin(around)[:, None]
    )
    triangles = grid(n, m, closed=(True, True))
    for turn in Rotation.random(3, random_state=np.random.default_rng(7)):
        found = crossings(turn.apply(tube.reshape(-1, 3)), triangles)
        assert (found.count > 0) == crosses
        # overlapping tubes: no part reaches deeper into the other than both are thick
        assert found.depth <= 2 * waist


@pytest.mark.parametrize(("top", "shift", "count"), [(2.0, 0.5, 38), (1.0, 0.5, 19)])
def test_crossed_sheets_cross_once_per_piece_of_their_line(top, shift, count):
    """Two rows of ten cells at right angles along x. Where both cover the line, each piece between ends is one pair.

    A sheet of -1 to 2 ends triangles at x = k and k + 1/3, the other at k + 1/2 and k + 5/6: 37 ends within the common
    stretch 1/2 to 10. One of -1 to 1 ends them at halves, as does the other: 18, shared by both.
    """
    x = np.arange(11.0)
    flat = np.stack(np.broadcast_arrays(x[:, None], [-1.0, top], 0.0), axis=-1).reshape(-1, 3)
    upright = np.stack(np.broadcast_arrays(x[:, None] + shift, 0.0, [-1.0, top]), axis=-1).reshape(-1, 3)
    sheet = grid(11, 2)
    assert crossings(np.concatenate([flat, upright]), np.concatenate([sheet, sheet + len(flat)])).count == count


def test_closed_folds_are_found_and_open_ones_are_not():
    points = np.random.default_rng(9).normal(size=(1, 3))
    n = 60
    u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 2 * np.pi, 2 * n, endpoint=False), indexing="ij")
    for bend, crosses in ((0.9, False), (1.3, True)):
        # a ring whose wall leans over its own axis: rows beyond the axis pass through each other
        radius = 1 - bend * u * 1.0
        ring = np.stack([radius * np.cos(v), radius * np.sin(v), 0.3 * np.sin(3 * v) * u], axis=-1).reshape(-1, 3)
        found = crossings(ring + points, grid(n, 2 * n, closed=(False, True)))
        assert (found.count > 0) == crosses


def test_depth_is_the_shortest_way_out():
    rng = np.random.default_rng(10)
    seen = 0
    for _ in range(300):
        a, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
        if not cross(a, b):
            continue
        seen += 1
        depth = depth_of(a, b)
        ways = rng.normal(size=(200, 3))
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        # no move that is shorter frees them, and along the right way the depth does
        assert all(cross(a + 0.98 * depth * way, b) for way in ways)
        axes = [np.cross(t[1] - t[0], t[2] - t[0]) for t in (a, b)]
        axes += [np.cross(a[i] - a[i - 1], b[j] - b[j - 1]) for i in range(3) for j in range(3)]
        moves = [sign * 1.001 * depth * axis / np.linalg.norm(axis) for axis in axes for sign in (1, -1)]
        assert not all(cross(a + move, b) for move in moves)
    assert seen > 20


def test_leaves_that_touch_are_all_found():
    rng = np.random.default_rng(11)
    low = rng.uniform(size=(301, 3))
    high = low + 10.0 ** rng.uniform(-4, -0.5, size=(301, 3))
    tree = sort_boxes(low, high)
    found = {(int(a), int(b)) for a, b in leaf_pairs(tree)}
    assert all(a <= b for a, b in found)
    place = np.empty(301, np.int64)
    place[tree.order] = np.arange(301)
    overlap = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(-1)
    for i, j in np.argwhere(overlap):
        assert tuple(sorted((place[i] // LEAF, place[j] // LEAF))) in found


def test_nothing_and_nonsense():
    assert crossings(np.zeros((3, 3)), np.empty((0, 3), int)).count == 0
    assert crossings(np.eye(3), [[0, 1, 2]]).depth == 0
    with pytest.raises(ValueError, match="finite"):
        crossings([[0, 0, np.nan]] * 3, [[0, 1, 2]])
    with pytest.raises(ValueError, match="positions"):
        crossings(np.eye(3), [[0, 1, 3]])
