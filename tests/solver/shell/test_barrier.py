"""The barrier of contact against differences and brute force, and steps that nothing passes."""

from __future__ import annotations

import numpy as np
import pytest

from solver import shell
from solver.geometry.crossings import crossings
from solver.shell.contact.distance import EDGES, FACE, nearest
from tests.solver.shell._meshes import sheet

ALL = np.arange(4)[None]


def stencils(count: int, seed: int = 0):
    """Yield kind and points (4, 3) of random stencils, every fifth pair of edges about parallel."""
    generator = np.random.default_rng(seed)
    for trial in range(count):
        kind = (FACE, EDGES)[trial % 2]
        x = generator.normal(size=(4, 3))
        if kind == EDGES and trial % 5 == 0:
            x[3] = x[2] + 1.3 * (x[1] - x[0]) + 0.02 * generator.normal(size=3)
        yield kind, x


def sampled(kind: int, x) -> float:
    """Distance of a stencil's parts by samples of both."""
    s = np.linspace(0, 1, 81)
    if kind == EDGES:
        one, two = (a + s[:, None] * (b - a) for a, b in ((x[0], x[1]), (x[2], x[3])))
        return float(np.linalg.norm(one[:, None] - two[None], axis=-1).min())
    a, b = np.meshgrid(s, s)
    inside = a + b <= 1 + 1e-12
    weights = np.stack([1 - a - b, a, b], -1)[inside]
    return float(np.linalg.norm(weights @ x[1:] - x[0], axis=1).min())


def test_nearest_points_are_those_of_samples():
    for kind, x in stencils(60):
        weights, gap = np.empty(4), np.empty(3)
        square = nearest(x, ALL[0], kind, weights, gap)
        assert np.sqrt(square) == pytest.approx(np.linalg.norm(weights @ x), rel=1e-12)
        assert sampled(kind, x) - 0.08 <= np.sqrt(square) <= sampled(kind, x) * (1 + 1e-12)


def test_gradient_and_second_derivative_are_those_of_differences():
    """Vertex and triangle, edges at an angle and edges about parallel; near and far within the reach."""
    generator = np.random.default_rng(1)
    for kind, x in stencils(80):
        weights, gap = np.empty(4), np.empty(3)
        distance = np.sqrt(nearest(x, ALL[0], kind, weights, gap))
        rest = np.array([kind]), np.array([distance * generator.uniform(1.05, 3)]), np.array([1.7])
        gradient, slopes, bends = np.zeros((4, 3)), np.zeros(12), np.zeros((12, 12))
        shell.barrier(x, ALL, *rest, gradient)
        for k in range(12):
            move = np.zeros(12)
            move[k] = 1e-6
            move = move.reshape(4, 3)
            up, down = np.zeros((4, 3)), np.zeros((4, 3))
            slopes[k] = (shell.barrier(x + move, ALL, *rest, up) - shell.barrier(x - move, ALL, *rest, down)) / 2e-6
            bends[:, k] = (up - down).ravel() / 2e-6
        blocks = np.zeros((16, 3, 3))
        shell.barrier_hessian(x, ALL, *rest, np.arange(16)[None], blocks)
        found = blocks.reshape(4, 4, 3, 3).transpose(0, 2, 1, 3).reshape(12, 12)
        assert np.abs(slopes - gradient.ravel()).max() <= 1e-6 * max(np.abs(gradient).max(), 1e-6)
        assert np.abs(bends - found).max() <= 1e-5 * np.abs(bends).max()
        # inner forces: no resultant
        assert np.abs(gradient.sum(axis=0)).max() <= 1e-12 * max(np.abs(gradient).max(), 1e-300)


def test_no_step_passes_through():
    """Parts sent at each other stop in front of each other, and stop there at last, wherever they come from."""
    stopped = 0
    for kind, x in stencils(200, seed=3):
        way = np.random.default_rng(stopped).normal(size=(4, 3)) * 4
        share = shell.free_step(x, way, ALL, np.array([kind]), 1.0)
        weights, gap = np.empty(4), np.empty(3)
        start = nearest(x, ALL[0], kind, weights, gap)
        gaps = [nearest(x + t * way, ALL[0], kind, weights, gap) for t in np.linspace(0, share, 400)]
        assert min(gaps) >= 0.009 * start
        assert 0 < share <= 1
        stopped += share < 1
        if share < 1:
            # not far in front: what is left is a small part of the way there was
            assert gaps[-1] <= 0.25 * start
    assert stopped > 10


def crumpled():
    """Two sheets that lie on each other, bent: points, triangles and what `near_of` needs."""
    points, faces = sheet(9, 9, 0.1)
    low = points + np.stack([0 * points[:, 0], 0 * points[:, 0], 0.05 * np.sin(9 * points[:, 0])], -1)
    # shifted by less than an edge, so that edges cross above each other
    x = np.concatenate([low, low + np.array([0.035, 0.024, 0.03])])
    mesh = shell.topology(np.concatenate([faces, faces + len(points)]), len(x))
    return x, mesh


def near_in(x, mesh, distance):
    g = shell.metric(x, mesh.triangles)
    lengths = np.linalg.norm(x[mesh.edges[:, 0]] - x[mesh.edges[:, 1]], axis=1)
    return shell.near_of((g,), mesh, lengths, np.ones(mesh.vertices), distance)


def test_search_finds_all_that_is_within_reach():
    """Against all vertices with all triangles, and all edges with all edges, of the two sheets."""
    x, mesh = crumpled()
    distance, half = 0.05, len(x) // 2
    found = shell.search(x, mesh, near_in(x, mesh, distance), distance, 0.01, 0.01, 0.1)
    kept = shell.within(x, found)
    seen = {(int(found.kinds[k]), *sorted(map(int, found.stencils[k]))) for k in kept}
    weights, gap, wanted = np.empty(4), np.empty(3), set()
    for v in range(len(x)):
        for t in mesh.triangles:
            q = np.array([v, *t])
            if (v < half) != (t[0] < half) and nearest(x, q, FACE, weights, gap) < distance**2:
                wanted.add((FACE, *sorted(map(int, q))))
    for a in mesh.edges[mesh.edges[:, 0] < half]:
        for b in mesh.edges[mesh.edges[:, 0] >= half]:
            q = np.array([*a, *b])
            if nearest(x, q, EDGES, weights, gap) < distance**2:
                wanted.add((EDGES, *sorted(map(int, q))))
    assert {k for k, *_ in wanted} == {FACE, EDGES}
    assert wanted <= seen
    # what lies near along one sheet is not taken for a touch
    assert all(min(q) < half <= max(q) for _, *q in seen)


def test_what_was_not_found_is_out_of_reach_after_the_room_was_used():
    x, mesh = crumpled()
    distance, room = 0.02, 0.02
    found = shell.search(x, mesh, near_in(x, mesh, distance), distance, room, 0.01, 0.1)
    moved = x.copy()
    moved[: len(x) // 2, 2] += room
    moved[len(x) // 2 :, 2] -= room
    again = shell.search(moved, mesh, near_in(x, mesh, distance), distance, 0.0, 0.0, 0.1)
    now = {(int(again.kinds[k]), *again.stencils[k].tolist()) for k in shell.within(moved, again)}
    before = {(int(k), *q) for k, q in zip(found.kinds, found.stencils.tolist(), strict=True)}
    assert now
    assert now <= before


def hairpin():
    """A strip with half a turn about a sharp fold, as it is and flat: its legs are near each other at rest, too."""
    points, faces = sheet(12, 3, 0.1)
    along, radius = points[:, 0] - points[:, 0].mean(), 0.06
    turn = np.clip(along / radius, -np.pi / 2, np.pi / 2)
    out = radius * np.cos(turn) - np.maximum(np.abs(along) - radius * np.pi / 2, 0)
    x = np.stack([out, points[:, 1], radius * np.sin(turn)], -1)
    return x, points, shell.topology(faces, len(x))


def test_near_ones_are_listed_as_far_as_both_can_move_and_no_further():
    """However much edges may change: after the legs have moved towards each other what is in reach was listed."""
    x, flat, mesh = hairpin()
    distance, room = 0.03, 0.05
    near = near_in(flat, mesh, 2 * distance + 0.5)
    found = shell.search(x, mesh, near, distance, room, 1.0, 0.1)
    assert found.near == len(found.kinds) > 50
    weights, gap = np.empty(4), np.empty(3)
    squares = [nearest(x, q, k, weights, gap) for q, k in zip(found.stencils, found.kinds, strict=True)]
    assert (np.sqrt(squares) <= found.reach + 2 * room + 1e-12).all()
    moved = x.copy()
    moved[:, 2] -= room * np.sign(x[:, 2])
    before = {(int(k), *q) for k, q in zip(found.kinds, found.stencils.tolist(), strict=True)}
    again = shell.search(moved, mesh, near, distance, 0.0, 0.0, 0.1)
    now = {(int(again.kinds[k]), *again.stencils[k].tolist()) for k in shell.within(moved, again)}
    assert len(now) > 10
    assert now <= before


def test_edges_alone_stop_two_triangles_that_pass_edge_first():
    """Two triangles cross at right angles, edge through edge: no vertex comes near the other's face."""
    x = np.array([[-1, 0, 0], [1, 0, 0], [0, 0, -2], [0, -1, 0.3], [0, 1, 0.3], [0, 0, 2.3]], float)
    mesh = shell.topology(np.array([[0, 1, 2], [3, 4, 5]]), 6)
    found = shell.search(x, mesh, near_in(x, mesh, 0.1), 0.1, 1.0, 0.1, 1.0)
    way = np.zeros_like(x)
    way[3:, 2] = -1.0
    share = shell.free_step(x, way, found.stencils, found.kinds, 1.0)
    assert 0.2 < share < 0.3
    assert crossings(x + way, mesh.triangles).count
    assert not crossings(x + share * way, mesh.triangles).count


def test_a_collapsed_triangle_has_neither_height_nor_area():
    """Of three points on a line the squares may differ by rounding either way, which depends on the processor."""
    rng, triangles = np.random.default_rng(0), np.array([[0, 1, 2], [0, 2, 3]])
    mesh, squared = shell.topology(triangles, 4), []
    for _ in range(200):
        way, along = rng.normal(size=3), np.sort(rng.uniform(size=2))
        x = np.array([[0.0, 0, 0], along[0] * way, way, rng.normal(size=3)])
        g = shell.metric(x, triangles)
        squared.append(g[0, 0] * g[0, 2] - g[0, 1] ** 2)
        lengths = np.linalg.norm(x[mesh.edges[:, 0]] - x[mesh.edges[:, 1]], axis=1)
        with np.errstate(all="raise"):
            near = shell.near_of((g,), mesh, lengths, np.ones(4), 0.1)
            assert shell.areas(g)[0] < 1e-7
        assert np.all(near.altitudes[:3] < 1e-6)
    assert min(squared) < 0 < max(squared)
