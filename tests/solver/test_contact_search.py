"""Which nodes may touch which quads, and how deep: against brute force, and where nothing touches."""

from __future__ import annotations

import numpy as np
import pytest

from solver.dehydration.contact.contact import push_apart
from solver.dehydration.contact.data import ACTIVE, HITS, OPPOSED, PAIRS, SEARCHES, grow, make_contact
from solver.dehydration.contact.search import find_pairs
from solver.dehydration.measures.penetration import penetration, penetration_depths

from ._skins import SINGLE, cubed_sphere, state, touching, two_plates


def wrinkled(points, amplitude):
    waves = np.sin(9 * points[:, 0] + 1) * np.sin(8 * points[:, 1]) * np.sin(9 * points[:, 2] + 2)
    return points * (1 + amplitude * waves)[:, None]


@pytest.mark.parametrize("axes", [(1, 1, 1), (1, 0.6, 0.9), (0.5, 1, 0.5)])
def test_unfolded_fruits_are_skipped_without_a_search(axes):
    points, quads = cubed_sphere(16)
    contact = touching(points * axes, quads, 0.01, 0.04)
    assert contact.counts[SEARCHES] == 0
    assert contact.counts[PAIRS] == 0


@pytest.mark.parametrize("amplitude", [0.05, 0.15])
def test_wrinkled_fruit_has_no_contact(amplitude):
    points, quads = cubed_sphere(16)
    contact = touching(points, quads, 0.01, 0.04)
    x, v = state(wrinkled(points, amplitude)), np.zeros((len(points), 4), SINGLE)
    before = x.copy()
    find_pairs(contact, x)
    push_apart(contact, x, v, np.full(len(x), 0.3, SINGLE))
    assert contact.counts[ACTIVE] == 0
    assert np.array_equal(x, before)


def test_far_side_of_a_thin_neck_is_not_grabbed():
    points, quads = cubed_sphere(16)
    flat = points * [1, 1, 0.06]  # 1.2 mean edges thick at most: skin faces away from skin all over
    contact = touching(flat, quads, 0.01, 0.05)
    x, v = state(flat), np.zeros((len(flat), 4), SINGLE)
    inner = np.linalg.norm(points[:, :2], axis=1) < 0.8
    push_apart(contact, x, v, np.full(len(x), 0.3, SINGLE))
    assert abs(v[inner]).max() == 0
    assert penetration_depths(flat, quads, 0.2).max() == 0


def brute_force(x, quads, contact):
    """Nearest quad of each node by dense search and Gauss-Newton in float64: {node: gap} of the touching ones."""
    p = x[:, :3].astype(float)
    facing = np.cross(p[quads[:, 2]] - p[quads[:, 0]], p[quads[:, 3]] - p[quads[:, 1]])
    facing /= np.linalg.norm(facing, axis=1)[:, None]
    normals = np.zeros_like(p)
    for k in range(4):
        np.add.at(normals, quads[:, k], facing)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    node, quad = np.nonzero(normals @ facing.T < OPPOSED)
    apart = ~(quads[quad] == node[:, None]).any(1)
    node, quad = node[apart], quad[apart]
    corner, target = p[quads[quad]], p[node]

    def at(u, v):
        w = np.stack([(1 - u) * (1 - v), (1 + u) * (1 - v), (1 + u) * (1 + v), (1 - u) * (1 + v)], -1) / 4
        du = np.stack([v - 1, 1 - v, 1 + v, -1 - v], -1) / 4
        dv = np.stack([u - 1, -1 - u, 1 + u, 1 - u], -1) / 4
        return (np.einsum("pk,pki->pi", weights, corner) for weights in (w, du, dv))

    grid = np.linspace(-1, 1, 9)
    u, v, least = np.zeros(len(node)), np.zeros(len(node)), np.full(len(node), np.inf)
    for a in grid:
        for b in grid:
            square = ((next(at(np.full_like(u, a), np.full_like(v, b))) - target) ** 2).sum(1)
            better = square < least
            u[better], v[better], least = a, b, np.minimum(least, square)
    for width in 0.25 * 0.7 ** np.arange(40):  # pattern search: slow, sure and nothing like Newton
        for a, b in ((width, 0), (-width, 0), (0, width), (0, -width)):
            s, t = np.clip(u + a, -1, 1), np.clip(v + b, -1, 1)
            square = ((next(at(s, t)) - target) ** 2).sum(1)
            better = square < least
            u, v, least = np.where(better, s, u), np.where(better, t, v), np.minimum(least, square)
    foot, du, dv = at(u, v)
    normal = np.cross(du, dv)
    height = ((target - foot) * normal).sum(1) / np.linalg.norm(normal, axis=1)
    distance = np.sqrt(least)
    found = {}
    for i in np.unique(node):
        mine = np.flatnonzero(node == i)
        near = mine[distance[mine] <= distance[mine].min() + 1e-4 * contact.size]
        best = near[np.argmax(abs(height[near]))]
        gap = np.copysign(distance[best], height[best])
        squarely = gap >= 0 or abs(height[best]) > 0.7 * distance[best]
        if -contact.depth <= gap < contact.clearance and squarely:
            found[int(i)] = gap
    return found


@pytest.mark.parametrize("gap", [0.12, 0.0, -0.3])
def test_brute_force_finds_the_same_contacts(gap):
    points, quads, minv, _ = two_plates(gap, np.random.default_rng(5), wave=0.15)
    contact = touching(points, quads, 0.1, 1.0)
    x, v = state(points), np.zeros((len(points), 4), SINGLE)
    expected = brute_force(x, quads, contact)
    push_apart(contact, x, v, minv)
    hits = contact.counts[HITS]
    found = {}
    for node, gap, weight in zip(
        contact.hits[:hits, 0], contact.hit_values[:hits, 7], contact.hit_values[:hits, 11], strict=True
    ):
        if weight == 1 and gap < contact.clearance:
            found[int(node)] = min(float(gap), found.get(int(node), np.inf), key=abs)
    assert len(expected) > 5
    assert found.keys() == expected.keys()
    assert max(abs(found[i] - expected[i]) for i in found) < 1e-3


def test_full_list_is_reported_and_can_grow():
    points, quads, _, _ = two_plates(0.05, np.random.default_rng(7))
    contact = make_contact(np.arange(len(points)), quads, points, 0.1, 1.0, capacity=5)
    needed = find_pairs(contact, state(points))
    assert needed > 5
    assert contact.counts[PAIRS] == 5
    assert find_pairs(contact, state(points)) == needed
    contact = grow(contact, needed)
    assert find_pairs(contact, state(points)) == needed == contact.counts[PAIRS]


def test_list_survives_small_motion_and_follows_large():
    points, quads, _, _ = two_plates(0.05, np.random.default_rng(8))
    contact = touching(points, quads, 0.1, 1.0)
    before = contact.counts[SEARCHES]
    find_pairs(contact, state(points + 0.01))
    assert contact.counts[SEARCHES] == before
    find_pairs(contact, state(points + 0.2))
    assert contact.counts[SEARCHES] == before + 1


def test_broken_positions_end_the_search_rather_than_hang():
    points, quads, minv, _ = two_plates(0.05, np.random.default_rng(9))
    contact = touching(points, quads, 0.1, 1.0)
    for value in (np.nan, np.inf, 1e30):
        x, v = state(points), np.zeros((len(points), 4), SINGLE)
        x[40, 1] = value
        find_pairs(contact, x)
        push_apart(contact, x, v, minv)
    with pytest.raises(ValueError, match="finite"):
        penetration(np.full((len(points), 3), np.nan), quads)


@pytest.mark.parametrize("overlap", [0.0, 0.03, 0.08])
def test_penetration_of_two_spheres_is_their_overlap(overlap):
    points, quads = cubed_sphere(12)
    both = np.concatenate([points, points * [1, 1, -1] + [0, 0, 2 - overlap]])
    mirrored = quads[:, ::-1] + len(points)
    depth = penetration(both, np.concatenate([quads, mirrored]))
    # the poles are nodes, and facets lie inside their sphere by h^2 / 8
    assert depth == pytest.approx(overlap, abs=0.003)
