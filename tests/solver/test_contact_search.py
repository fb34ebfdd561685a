"""Which nodes, triangles and edges may touch: against brute force, and where nothing touches."""

from __future__ import annotations

import numpy as np
import pytest

from solver.dehydration.contact.contact import SLACK, measure, prepare, push_apart, resolve
from solver.dehydration.contact.data import ACTIVE, BATCH, HELD, HITS, LIVE, PAIRS, SEARCHES, grow, make_contact
from solver.dehydration.contact.search import find_pairs
from solver.geometry.crossings import crossings, split_quads

from ._skins import SINGLE, cubed_sphere, grooved, state, touching, two_plates


def wrinkled(points, amplitude):
    waves = np.sin(9 * points[:, 0] + 1) * np.sin(8 * points[:, 1]) * np.sin(9 * points[:, 2] + 2)
    return points * (1 + amplitude * waves)[:, None]


@pytest.mark.parametrize("axes", [(1, 1, 1), (1, 0.6, 0.9), (0.5, 1, 0.5)])
def test_unfolded_fruits_are_skipped_without_a_search(axes):
    points, quads = cubed_sphere(16)
    contact = touching(points * axes, quads, 0.01)
    assert contact.counts[SEARCHES] == 0
    assert contact.counts[PAIRS] == 0


@pytest.mark.parametrize("amplitude", [0.05, 0.15])
def test_wrinkled_fruit_has_no_contact(amplitude):
    points, quads = cubed_sphere(16)
    contact = touching(points, quads, 0.01)
    x, v = state(wrinkled(points, amplitude)), np.zeros((len(points), 4), SINGLE)
    before = x.copy()
    find_pairs(contact, x)
    push_apart(contact, x, v, np.full(len(x), 0.3, SINGLE))
    assert contact.counts[ACTIVE] == 0
    assert np.array_equal(x, before)


def test_far_side_of_a_thin_neck_is_not_grabbed():
    points, quads = cubed_sphere(16)
    flat = points * [1, 1, 0.06]  # 1.2 mean edges thick at most: skin faces away from skin all over
    contact = touching(flat, quads, 0.01)
    x, v = state(flat), np.zeros((len(flat), 4), SINGLE)
    inner = np.linalg.norm(points[:, :2], axis=1) < 0.8
    push_apart(contact, x, v, np.full(len(x), 0.3, SINGLE))
    assert abs(v[inner]).max() == 0
    assert crossings(flat, split_quads(quads)).count == 0


def to_segment(p, a, b):
    """Distance of points p from segments a b, all (n, 3)."""
    along = b - a
    share = np.clip(((p - a) * along).sum(1) / (along * along).sum(1), 0, 1)
    return np.linalg.norm(p - a - share[:, None] * along, axis=1)


def to_triangle(p, a, b, c):
    """Distance of points from triangles: to the plane where the foot is inside, else to the nearest edge."""
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    inside = np.ones(len(p), bool)
    for tail, head in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(head - tail, p - tail) * normal).sum(1) >= 0
    edges = np.min([to_segment(p, a, b), to_segment(p, b, c), to_segment(p, c, a)], axis=0)
    return np.where(inside, abs(((p - a) * normal).sum(1)), edges)


def between_lines(a, b, c, d):
    """Distance of segments whose lines are closest inside both, infinite elsewhere."""
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = ((p * q).sum(1) for p, q in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    square = uu * vv - uv**2
    square[square <= 1e-12 * uu * vv] = np.inf
    s, t = (uv * vw - uw * vv) / square, (uu * vw - uv * uw) / square
    inner = (s > 0) & (s < 1) & (t > 0) & (t < 1)
    return np.where(inner, np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1), np.inf)


@pytest.mark.parametrize("gap", [0.12, 0.0, -0.05])
def test_brute_force_finds_the_same_pairs_at_the_same_distance(gap):
    points, quads, minv, _ = two_plates(gap, np.random.default_rng(5), wave=0.15)
    contact = touching(points, quads, 0.1)
    x, v = state(points), np.zeros((len(points), 4), SINGLE)
    p, triangles = x[:, :3].astype(float), split_quads(quads)
    near = contact.clearance + SLACK * contact.margin
    node, face = (k.ravel() for k in np.indices((len(p), len(triangles))))
    free = (triangles[face] != node[:, None]).all(1)
    node, face = node[free], face[free]
    away = to_triangle(p[node], *p[triangles[face]].swapaxes(0, 1))
    expected = {(i, *triangles[j]): d for i, j, d in zip(node, face, away, strict=True) if d < near}
    edges = np.unique(np.sort(np.concatenate([triangles[:, :2], triangles[:, 1:], triangles[:, ::2]]), axis=1), axis=0)
    one, two = (edges[k] for k in np.triu_indices(len(edges), 1))
    free = (one[:, :, None] != two[:, None, :]).all((1, 2))
    one, two = one[free], two[free]
    away = between_lines(*p[one].swapaxes(0, 1), *p[two].swapaxes(0, 1))
    both = {frozenset((tuple(e), tuple(f))): d for e, f, d in zip(one, two, away, strict=True)}
    push_apart(contact, x, v, minv)
    hits = set(contact.hits[: contact.counts[HITS]].tolist())
    found, crossed = {}, {}
    for i, (a, b, c, d, kind) in enumerate(contact.pairs[: contact.counts[LIVE]].tolist()):
        if kind == 0:
            found[a, b, c, d] = contact.values[i, 7]
            assert i in hits or found[a, b, c, d] >= near
        elif i in hits:
            crossed[frozenset((tuple(sorted((a, b))), tuple(sorted((c, d)))))] = contact.values[i, 7]
    assert len(expected) > 10
    assert max(abs(value - found[key]) for key, value in expected.items()) < 1e-5
    close = sum(d < near for d in both.values())
    assert close > 5
    # those next to an end or nearly parallel count for nothing
    assert crossed.keys() <= both.keys()
    assert len(crossed) > 0.7 * close
    assert max(abs(both[key] - value) for key, value in crossed.items()) < 1e-5


@pytest.mark.parametrize("turn", [0.0, 0.25])
def test_pairs_that_are_not_looked_at_could_not_have_counted(turn):
    rng, results = np.random.default_rng(3), []
    points, quads, minv, _ = two_plates(0.13, rng, wave=0.1)
    moved = points + np.array([0.02, 0.0, 0.05]) + rng.uniform(-0.03, 0.03, points.shape)
    moved[:, 2] += turn * 0.1 * (points[:, 0] - 4)
    for all_of_them in (False, True):
        contact = touching(points, quads, 0.1)
        if all_of_them:
            contact.apart[:] = 0
        x, v = state(moved), np.full((len(points), 4), 1e-3, SINGLE)
        push_apart(contact, x, v, minv)
        results.append((x.tobytes(), v.tobytes(), contact.counts.tolist(), contact.values[: contact.counts[LIVE], 7]))
    *few, near = results[0]
    *every, far = results[1]
    assert few == every
    assert np.mean(near != far) > 0.1  # what is not looked at has a bound in its place
    assert np.all(near <= far + 1e-6)
    assert contact.counts[ACTIVE] > 0


def test_neighbours_that_need_no_look_had_nothing_in_reach():
    points, quads = cubed_sphere(16)
    first = grooved(points, 0.3)
    trusting, doubting = (make_contact(np.arange(len(points)), quads, first, 0.01) for _ in range(2))
    doubting.looked[:], doubting.doubts[1] = 0, len(doubting.triangles)  # never measured, nothing is ever sure
    trusted, measured, most = [], [], 0
    for step, width in enumerate(np.linspace(0.3, 0.0, 40)):
        x = state(wrinkled(grooved(points, width), 0.002 * step))
        for contact in (trusting, doubting):
            contact.searched[:] = 1e15
            find_pairs(contact, x)
        assert trusting.counts.tolist() == doubting.counts.tolist()
        for name in ("pairs", "apart", "limits"):
            one, two = (getattr(contact, name)[: contact.counts[PAIRS]] for contact in (trusting, doubting))
            assert one.tobytes() == two.tobytes()
        most = max(most, trusting.counts[PAIRS])
        trusted.append(trusting.sure.mean())
        measured.append(trusting.looked.tobytes())
    assert not doubting.sure[doubting.bending].any()
    assert len(doubting.bending) > 0.9 * len(doubting.triangles)
    assert most > 100
    assert min(trusted[1:]) > 0.5
    assert len(set(measured)) < 30


@pytest.mark.parametrize("batches", [1, 4])
def test_more_meetings_than_there_is_room_for_are_gone_through_in_rounds(batches):
    points, quads = cubed_sphere(16)
    folded = wrinkled(grooved(points, 0.05), 0.05)
    ample = touching(folded, quads, 0.01)
    tight = make_contact(np.arange(len(points)), quads, ample.rest, 0.01)
    room = batches * BATCH
    tight = tight._replace(met=tight.met[:room].copy(), near=tight.near[:room].copy())
    find_pairs(tight, state(folded))
    assert ample.met_by_part.sum() > 5 * BATCH
    assert room // len(ample.met_by_part) < ample.met_by_part.max() < 4 * BATCH
    assert ample.met_by_part.max() <= len(ample.met) // len(ample.met_by_part)
    count = ample.counts[PAIRS]
    assert count == tight.counts[PAIRS] > 100
    for name in ("pairs", "apart", "limits"):
        assert getattr(ample, name)[:count].tobytes() == getattr(tight, name)[:count].tobytes()


@pytest.mark.parametrize(("gap", "speed", "held"), [(0.09, 1e-4, False), (0.09, 0.2, True), (0.001, 1e-4, True)])
def test_ways_are_looked_at_wherever_one_may_be_cut_short(gap, speed, held):
    """Slow ones that are hardly pushed go their ways, fast and hard pushed ones do not: as if all were looked at."""
    points, quads, minv, _ = two_plates(gap, np.random.default_rng(4))
    results, looked = [], []
    for every in (False, True):
        contact = touching(points, quads, 0.1)
        x, v = state(points), np.full((len(points), 4), speed, SINGLE)
        for i in range(prepare(contact, x, v)):
            measure(
                contact.before, contact.searched, contact.pairs, contact.apart, contact.values, contact.weights,
                contact.limits, SINGLE(SLACK * contact.margin), contact.clearance, i,
            )  # fmt: skip
        if every:
            contact.moved[1] = np.inf
        resolve(contact, x, v, minv)
        assert contact.counts[ACTIVE] > 0
        results.append(x.tobytes() + v.tobytes())
        looked.append(bool(contact.counts[HELD]))
    assert results[0] == results[1]
    assert looked == [held, True]


def test_full_list_is_reported_and_can_grow():
    points, quads, _, _ = two_plates(0.05, np.random.default_rng(7))
    contact = make_contact(np.arange(len(points)), quads, points, 0.1, capacity=5)
    needed = find_pairs(contact, state(points))
    assert needed > 5
    assert contact.counts[PAIRS] == 5
    assert find_pairs(contact, state(points)) == needed
    contact = grow(contact, needed)
    assert find_pairs(contact, state(points)) == needed == contact.counts[PAIRS]


def test_list_survives_small_motion_and_follows_large():
    points, quads, _, _ = two_plates(0.05, np.random.default_rng(8))
    contact = touching(points, quads, 0.1)
    before = contact.counts[SEARCHES]
    find_pairs(contact, state(points + 0.01))
    assert contact.counts[SEARCHES] == before
    find_pairs(contact, state(points + 0.2))
    assert contact.counts[SEARCHES] == before + 1


def test_broken_positions_end_the_search_rather_than_hang():
    points, quads, minv, _ = two_plates(0.05, np.random.default_rng(9))
    contact = touching(points, quads, 0.1)
    for value in (np.nan, np.inf, 1e30):
        x, v = state(points), np.zeros((len(points), 4), SINGLE)
        x[40, 1] = value
        find_pairs(contact, x)
        push_apart(contact, x, v, minv)
