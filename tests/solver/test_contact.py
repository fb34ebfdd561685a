"""Self-contact: plates, sulci and fruits that must not pass through themselves, against brute force and balances."""

from __future__ import annotations

import numpy as np
import pytest
from numba import get_num_threads, njit, prange, set_num_threads

from solver.dehydration.contact import push_apart
from solver.dehydration.contact_data import ACTIVE, HITS, OPPOSED, PAIRS, SEARCHES, grow, make_contact
from solver.dehydration.contact_search import find_pairs
from solver.dehydration.penetration import penetration, penetration_depths

SINGLE = np.float32


def cubed_sphere(n):
    t = np.tan(np.linspace(-np.pi / 4, np.pi / 4, n + 1))
    a, b = np.meshgrid(t, t, indexing="ij")
    o = np.ones_like(a)
    faces = [(o, a, b), (-o, b, a), (b, o, a), (a, -o, b), (a, b, o), (b, a, -o)]
    points = np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in faces])
    points /= np.linalg.norm(points, axis=1)[:, None]
    _, first, inverse = np.unique(np.round(points * 1e7).astype(int), axis=0, return_index=True, return_inverse=True)
    ids = inverse.reshape(6, n + 1, n + 1)
    quads = np.stack([ids[:, :-1, :-1], ids[:, 1:, :-1], ids[:, 1:, 1:], ids[:, :-1, 1:]], -1).reshape(-1, 4)
    points = points[first]
    c = points[quads]
    out = np.einsum("ij,ij->i", np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1]), c.mean(1)) > 0
    return points, np.where(out[:, None], quads, quads[:, ::-1]).astype(np.int32)


def sheet(m, n):
    """Quads of an m x n grid of nodes, counter-clockwise seen from +z when i runs along x and j along y."""
    ids = np.arange(m * n).reshape(m, n)
    return np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], -1).reshape(-1, 4).astype(np.int32)


def state(points):
    x = np.zeros((len(points), 4), SINGLE)
    x[:, :3] = points
    return x


def touching(points, quads, clearance, te, **options):
    contact = make_contact(np.arange(len(points)), quads, points, clearance, te, **options)
    assert find_pairs(contact, state(points)) <= len(contact.pair_nodes)
    return contact


def two_plates(gap, rng, lower=9, upper=6, wave=0.0):
    """A plate facing up and a smaller one above it facing down; unit edges."""
    i, j = np.meshgrid(np.arange(lower), np.arange(lower), indexing="ij")
    below = np.stack([i, j, wave * np.sin(1.3 * i + 0.7 * j)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(upper), np.arange(upper), indexing="ij")
    above = np.stack([i + 1.37, j + 1.21, gap + wave * np.cos(0.9 * i - 1.1 * j)], -1).reshape(-1, 3)
    quads = np.concatenate([sheet(lower, lower), sheet(upper, upper)[:, ::-1] + lower * lower])
    minv = rng.uniform(0.2, 0.4, len(below) + len(above)).astype(SINGLE)
    return np.concatenate([below, above]), quads.astype(np.int32), minv, lower * lower


@njit
def march(contact, x, v, minv, anchors, hold, drift, weight, links, lengths, spring, keep, steps, kinetic):
    """Mass-spring explicit steps: anchors that drift, weights (nn, 3), links (nl, 2); returns the deepest."""
    deepest = 0.0
    force = np.zeros((x.shape[0], 3), np.float32)
    for step in range(steps):
        if step % 10 == 0:
            find_pairs(contact, x)
        for i in range(x.shape[0]):
            for k in range(3):
                anchors[i, k] += drift[i, k]
                force[i, k] = weight[i, k] + hold[k] * (anchors[i, k] - x[i, k])
        for e in range(links.shape[0]):
            a, b = links[e, 0], links[e, 1]
            d = x[b, :3] - x[a, :3]
            length = np.sqrt((d * d).sum())
            pull = spring * (length - lengths[e]) / length
            for k in range(3):
                force[a, k] += pull * d[k]
                force[b, k] -= pull * d[k]
        for i in range(x.shape[0]):
            for k in range(3):
                v[i, k] = keep * v[i, k] + minv[i] * force[i, k]
                x[i, k] += v[i, k]
        deepest = max(deepest, push_apart(contact, x, v, minv)[0])
        kinetic[step] = 0.0
        for i in range(x.shape[0]):
            if minv[i] > 0:
                kinetic[step] += (v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2) / minv[i] / 2
    return deepest


NO_LINKS = (np.zeros((0, 2), np.int64), np.zeros(0, SINGLE))


def run(
    contact, x, v, minv, anchors, steps, hold=(0, 0, 0), drift=0.0, weight=0.0, links=NO_LINKS, spring=0.0, keep=1.0
):
    full = np.zeros((len(x), 3), SINGLE)
    kinetic = np.zeros(steps)
    deepest = march(
        contact, x, v, minv, anchors.astype(SINGLE), np.array(hold, SINGLE), (full + drift).astype(SINGLE),
        (full + weight).astype(SINGLE), *links, SINGLE(spring), SINGLE(keep), steps, kinetic,
    )  # fmt: skip
    return deepest, kinetic


def membrane(quads, points):
    """Links along the edges and diagonals of quads, and their lengths."""
    pairs = np.concatenate([quads[:, :2], quads[:, 1:3], quads[:, ::2], quads[:, 1::2]])
    pairs = np.unique(np.sort(pairs.astype(np.int64), axis=1), axis=0)
    return pairs, np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1).astype(SINGLE)


def test_pressed_plates_settle_at_the_clearance_and_stay_quiet():
    points, quads, minv, lower = two_plates(0.4, np.random.default_rng(1))
    contact = touching(points, quads, 0.1, 1.0)
    x, v = state(points), np.zeros((len(points), 4), SINGLE)
    weight = np.zeros((len(points), 3))
    weight[lower:, 2] = -1e-3
    minv[:lower] = 0
    springs = {"links": membrane(quads[64:], points), "spring": 0.1, "hold": (0.02, 0.02, 0)}
    deepest, kinetic = run(contact, x, v, minv, x[:, :3].copy(), 5000, weight=weight, **springs)
    assert contact.counts[ACTIVE] >= 25
    assert deepest == 0
    assert abs(x[lower:, 2] - 0.1).max() < 0.02
    assert np.isfinite(kinetic).all()
    assert kinetic[-500:].max() < 0.02 * kinetic.max()


def test_contact_gives_no_energy_to_plates_on_springs():
    """The upper plate is held half an edge behind the lower one, which gives way; nothing but contact damps."""
    points, quads, minv, lower = two_plates(0.2, np.random.default_rng(2))
    contact = touching(points, quads, 0.1, 1.0)
    x, v = state(points), np.zeros((len(points), 4), SINGLE)
    links, lengths = membrane(quads, points)
    springs = {"links": (links, lengths), "spring": 0.3, "hold": (0.05, 0.05, 0.05)}
    anchors = points.copy()
    anchors[lower:, 2] -= 0.7
    drift = (anchors - points) / 2000
    deepest, _ = run(contact, x, v, minv, points, 2000, drift=drift, **springs)
    energies = []
    for _ in range(10):
        depth, kinetic = run(contact, x, v, minv, anchors, 500, **springs)
        deepest = max(deepest, depth)
        stretch = np.linalg.norm(x[links[:, 0], :3] - x[links[:, 1], :3], axis=1) - lengths
        energies.append(kinetic[-1] + 0.15 * (stretch**2).sum() + 0.025 * ((x[:, :3] - anchors) ** 2).sum())
    assert contact.counts[ACTIVE] >= 25
    assert max(deepest, penetration(x, quads)) < 0.02
    assert x[:lower, 2].min() < -0.1
    assert max(np.diff(energies)) < 1e-3 * energies[0]


@pytest.mark.parametrize("gap", [0.07, -0.2])
def test_momentum_is_balanced_to_round_off(gap):
    rng = np.random.default_rng(3)
    points, quads, minv, _ = two_plates(gap, rng, wave=0.06)
    contact = touching(points, quads, 0.1, 1.0)
    x, v = state(points), state(rng.normal(size=points.shape) * 1e-3)
    before, start = x.astype(float), v.astype(float)
    push_apart(contact, x, v, minv)
    impulse = ((v - start) / minv[:, None])[:, :3]
    assert contact.counts[ACTIVE] > 10
    assert np.allclose(x - before, v - start, atol=2e-6)
    size = abs(impulse).sum()
    assert abs(impulse.sum(0)).max() < 1e-6 * size
    began = (before - start)[:, :3]  # forces act where the step began
    assert abs(np.cross(began - began.mean(0), impulse).sum(0)).max() < 1e-5 * size


def test_push_never_overshoots_the_clearance():
    """The operator's eigenvalues are within [0, 1]: repeated pushes approach the clearance and do not ring."""
    points, quads, minv, lower = two_plates(0.05, np.random.default_rng(4))
    contact = touching(points, quads, 0.1, 1.0, recovery=1.0)
    x, v = state(points), np.zeros((len(points), 4), SINGLE)
    sizes = []
    for _ in range(300):
        push_apart(contact, x, v, minv)
        sizes.append(np.sqrt((v**2 / minv[:, None]).sum()))
        v[:] = 0
        assert x[lower:, 2].max() - x[:lower, 2].min() < 0.13
    assert max(np.diff(sizes)) < 1e-5
    assert sizes[-1] < 0.01 * sizes[0]
    assert x[lower:, 2].mean() > 0.05


@pytest.mark.parametrize("fold", [0.0, -0.25, 0.15])
def test_force_is_continuous_when_a_node_slides_across_an_edge(fold):
    """Over flat, convex and concave neighbours neither the size of the push nor its direction jumps."""
    i, j = np.meshgrid([-1.0, 0, 1], [-1.0, 0, 1], indexing="ij")
    ground = np.stack([i, j, fold * abs(i)], -1).reshape(-1, 3)
    # one small quad facing down, away from the ground's nodes, so that only its own nodes touch
    probe = np.array([(-0.05, 0.4, 0.06), (-0.05, 0.5, 0.06), (0.05, 0.5, 0.06), (0.05, 0.4, 0.06)])
    quads = np.concatenate([sheet(3, 3), [[9, 10, 11, 12]]]).astype(np.int32)
    minv = np.array([0.0] * 9 + [0.3] * 4, SINGLE)
    jumps = []
    for steps in (150, 600):
        pushes = []
        for shift in np.linspace(-0.15, 0.15, steps + 1):
            points = np.concatenate([ground, probe + np.array([shift, 0, 0])])
            points[9:, 2] += fold * abs(points[9:, 0])
            contact = touching(points, quads, 0.1, 1.0, recovery=1.0)
            x, v = state(points), np.zeros((13, 4), SINGLE)
            push_apart(contact, x, v, minv)
            pushes.append(v[9, :3].copy())
        size = np.linalg.norm(pushes, axis=1)
        assert size.min() > 0.01  # lacking 0.04 of a clearance of 0.1: phi pushes by 0.016 where one quad is near
        turn = np.linalg.norm(np.diff(np.array(pushes) / size[:, None], axis=0), axis=1)
        jumps.append((abs(np.diff(size)).max() / size.max(), turn.max()))
    # what is continuous jumps less the finer it is sampled
    (coarse, turned), (fine, turns) = jumps
    assert fine < 0.02
    assert fine < coarse / 2.5
    assert turns < 0.05
    assert turns < turned / 1.5


def grooved(points, width):
    """A closed skin with a groove around its waist, half as deep as the body and 2 width wide at its mouth."""
    polar = np.arcsin(np.clip(abs(points[:, 2]), 0, 1))
    floor, rim, top = 0.15, 0.65, np.pi / 2
    z = 0.15 * np.minimum(polar / floor, 1) + (width - 0.15) * np.clip((polar - floor) / (rim - floor), 0, 1)
    r = 0.5 + 0.5 * np.clip((polar - floor) / (rim - floor), 0, 1)
    cap = np.clip((polar - rim) / (top - rim), 0, 1) * np.pi / 2
    r, z = np.where(cap > 0, np.cos(cap), r), z + 0.8 * np.sin(cap)
    around = points[:, :2] / (np.linalg.norm(points[:, :2], axis=1, keepdims=True) + 1e-12)
    return np.column_stack([around * r[:, None], np.sign(points[:, 2]) * z])


def test_closing_sulcus_never_goes_through_itself():
    """Springs pull the walls of a deep groove a whole edge through each other."""
    ball, quads = cubed_sphere(16)
    start, end = grooved(ball, 0.15), grooved(ball, -0.05)
    contact = touching(start, quads, 0.1 * 0.1, 0.1)
    h = float(contact.size)
    x, v = state(start), np.zeros((len(ball), 4), SINGLE)
    minv = np.random.default_rng(11).uniform(0.2, 0.4, len(ball)).astype(SINGLE)
    springs = {"hold": (0.05, 0.05, 0.05), "links": membrane(quads, start), "spring": 0.1, "keep": 0.99}
    steps, parts = 3000, 6
    worst = 0.0
    for part in range(parts):
        anchors = start + (end - start) * part / parts
        deepest, kinetic = run(contact, x, v, minv, anchors, steps // parts, drift=(end - start) / steps, **springs)
        worst = max(worst, deepest, penetration(x, quads))
        assert kinetic.max() < 1e-4
    assert contact.counts[ACTIVE] > 150
    assert worst < 0.1 * h


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


@njit(parallel=True)
def parallel_march(contact, x, v, minv, pull, steps):
    """As the real march calls it: nodes in parallel, contact serial between them."""
    for step in range(steps):
        if step % 10 == 0:
            find_pairs(contact, x)
        for i in prange(x.shape[0]):
            v[i, 2] += pull[i]
            for k in range(3):
                x[i, k] += v[i, k]
        push_apart(contact, x, v, minv)


def test_same_bytes_whatever_the_thread_count():
    results = []
    threads = get_num_threads()
    for count in (1, threads, threads):
        set_num_threads(count)
        points, quads, minv, lower = two_plates(0.2, np.random.default_rng(6), wave=0.05)
        contact = touching(points, quads, 0.1, 1.0)
        x, v = state(points), np.zeros((len(points), 4), SINGLE)
        pull = np.where(np.arange(len(x)) < lower, 1e-4, -2e-4).astype(SINGLE)
        parallel_march(contact, x, v, minv, pull, 200)
        assert contact.counts[ACTIVE] > 0
        results.append((x.tobytes(), v.tobytes()))
    set_num_threads(threads)
    assert results[0] == results[1] == results[2]


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
