"""A surface is put out of contact where it crosses, nowhere else, and without a jump."""

from __future__ import annotations

import numpy as np
import pytest

from solver.arrays import Floats
from solver.geometry.apart import GAP, Topology, _weigh, look, look_again, put_apart
from solver.geometry.crossings import crossings
from solver.geometry.inward import candidates, pairs
from solver.lattice import closed_lattice, directions, lattice

N = 24


@pytest.fixture(scope="module")
def topology() -> Topology:
    return Topology.of(closed_lattice(N), 2 * N * N + 2)


def sphere(fold: float) -> Floats:
    """Return the points and poles (2 n^2 + 2, 3) of a sphere whose azimuths run back and forth by `fold`."""
    theta, phi = lattice(N)
    bulge = np.sin(theta) ** 4
    points = directions(theta, phi + fold * bulge * np.sin(6 * phi)) * (1 + 0.08 * bulge * np.cos(6 * phi))[..., None]
    return np.concatenate([points.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])


def test_every_vertex_has_all_its_neighbours(topology: Topology) -> None:
    counts = np.diff(topology.first)
    assert (counts[2 * N : -2 - 2 * N] == 6).all()
    assert counts[-2:].tolist() == [2 * N, 2 * N]


@pytest.mark.parametrize("fold", [0.15, 0.2, 0.3, 0.5])
def test_what_crosses_is_counted_as_by_all_pairs_and_put_apart(topology: Topology, fold: float) -> None:
    x = sphere(fold)
    before = crossings(x.astype(np.float32), closed_lattice(N)).count
    counted = x.copy()
    assert put_apart(counted, topology, 0).crossings == before
    assert np.array_equal(counted, x)
    found = put_apart(x, topology)
    assert found.crossings == 0
    assert crossings(x.astype(np.float32), closed_lattice(N)).count == 0
    assert (before > 0) == (fold > 0.18)


def test_a_surface_that_folds_freely_stays_as_it_is(topology: Topology) -> None:
    for fold in (0.0, 0.1):
        x = sphere(fold)
        kept = x.copy()
        assert put_apart(x, topology).near == 0
        assert np.array_equal(x, kept)


def test_only_what_crosses_moves(topology: Topology) -> None:
    x = sphere(0.4)
    given = x.copy()
    put_apart(x, topology)
    moved = np.linalg.norm(x - given, axis=1)[:-2].reshape(N, 2 * N)
    assert moved.max() > 0
    # folds stand at every sixth of the way around; poles do not fold
    assert moved[:3].max() == moved[-3:].max() == 0


def test_no_jump_where_contact_begins(topology: Topology) -> None:
    """Evening out grows from nothing: the surface moves no farther than three times what it was made from."""
    given = np.array([sphere(fold) for fold in np.linspace(0.15, 0.24, 37)])
    after = given.copy()
    for x in after:
        put_apart(x, topology)
    before, steps = (np.linalg.norm(np.diff(found, axis=0), axis=2).max(axis=1) for found in (given, after))
    assert np.abs(after - given).max() > 0.01
    assert steps.max() < 3 * before.max()


def test_what_did_not_move_is_not_looked_at_again(topology: Topology) -> None:
    """Candidates are limited to what lies before or behind a triangle that moved."""
    x = sphere(0.4)
    everything = candidates(x, topology.triangles, np.empty(0, bool))
    moved = np.zeros(len(x), bool)
    always = candidates(x, topology.triangles, moved)  # those whose cells cannot be told
    assert len(always) < 0.2 * len(everything)
    one = everything[np.abs(x[topology.triangles[everything], 0]).min(axis=1).argmax()]  # in the middle of a side
    moved[topology.triangles[one]] = True
    some = candidates(x, topology.triangles, moved)
    assert len(always) < len(some) < 0.5 * len(everything)
    assert np.isin(some, everything).all()
    assert one in some


@pytest.mark.parametrize("power", [1, 9])
def test_pairs_are_those_of_all_boxes_that_touch(topology: Topology, power: int) -> None:
    """But for those that lie apart along the line between their middles, or beyond an edge. A power of x crowds most
    about x = 0.
    """
    x, faces, size = sphere(0.4), topology.triangles, np.empty(len(topology.triangles))
    x[:, 0] **= power
    nobody = np.empty(0, bool)
    some = candidates(x, faces, nobody) if power == 1 else np.arange(len(faces), dtype=np.int32)
    listed = pairs(x, faces, some, size, nobody).tolist()
    found = {tuple(sorted(pair)) for pair in listed}
    assert len(found) == len(listed)
    corners = x[faces[some]]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.allclose(size[some], np.linalg.norm(normal, axis=1) / sides.max(axis=1), rtol=1e-12)
    more = 0.1 * size[some, None] + 1e-6
    low, high = (corners.min(axis=1) - more).astype("f4"), (corners.max(axis=1) + more).astype("f4")
    touch = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    apart = ~(faces[some][:, None, :, None] == faces[some][None, :, None, :]).any(axis=(2, 3))
    line = corners.mean(axis=1)[None] - corners.mean(axis=1)[:, None]
    line /= np.linalg.norm(line, axis=2, keepdims=True) + 1e-300
    own, other = np.einsum("ijk,ick->ijc", line, corners), np.einsum("ijk,jck->ijc", line, corners)
    margin = 0.1 * (size[some][:, None] + size[some]) + 1e-6
    close = other.min(axis=2) - own.max(axis=2) <= margin
    beside = np.zeros_like(close)
    for edge in range(3):
        out = np.cross(corners[:, (edge + 1) % 3] - corners[:, edge], normal)
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        way = np.einsum("ik,jck->ijc", out, corners) - np.einsum("ik,ik->i", out, corners[:, edge])[:, None, None]
        beside |= way.min(axis=2) > margin
    within = ~(beside | beside.T)
    first, second = np.nonzero(np.triu(touch & apart & close & within, 1))
    expected = {tuple(sorted(pair)) for pair in zip(some[first].tolist(), some[second].tolist(), strict=True)}
    assert len(expected) > 100
    assert np.triu(touch & apart & ~close, 1).any()
    assert np.triu(touch & apart & close & ~within, 1).any()
    assert found == expected
    moved = np.zeros(len(x), bool)
    moved[faces[listed[0][0]]] = True
    here = moved[faces].any(axis=1)
    those = {tuple(sorted(pair)) for pair in pairs(x, faces, some, size, moved).tolist()}
    assert those == {pair for pair in found if here[list(pair)].any()} != found


def test_needles_around_a_pole_are_no_pairs() -> None:
    """Their boxes touch, and none of the axes that tell solid bodies apart may do so: they lie in one plane, nearly."""
    theta, phi = lattice(64)
    points, faces = directions(theta, phi).reshape(-1, 3), closed_lattice(64).astype(np.int32)
    x = np.concatenate([points, [[0, 1, 0], [0, -1, 0]]])
    x[:, 1] = 1 + 0.02 * (x[:, 1] - 1)
    cap = np.flatnonzero((np.append(theta, [0, np.pi])[faces] < 0.4).all(axis=1)).astype(np.int32)
    assert len(cap) > 1000
    assert len(pairs(x, faces, cap, np.empty(len(faces)), np.empty(0, bool))) == 0


def test_a_second_look_finds_what_a_first_one_would(topology: Topology) -> None:
    before, after = sphere(0.4), sphere(0.4)
    looked = look(before, topology)
    folded = np.unique(topology.triangles[looked.pairs[: len(looked.pairs) // 3]])
    after[folded] *= 0.98
    again = look_again(after, topology, looked, (after != before).any(axis=1))
    anew = look(after, topology)
    assert {tuple(sorted(pair)) for pair in again.pairs.tolist()} == {
        tuple(sorted(pair)) for pair in anew.pairs.tolist()
    }
    assert len(again.pairs) == len(anew.pairs) != len(looked.pairs)
    assert np.array_equal(again.size[anew.pairs], anew.size[anew.pairs])


def test_a_pair_is_asked_again_once_its_corners_have_gone_as_far_as_it_was_apart() -> None:
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0.3], [0, 1, 0.3], [1, 0, 0.3]], float)
    faces, pair = np.array([[0, 1, 2], [3, 4, 5]], np.int32), np.array([[0, 1]], np.int32)
    axes, until, gone, size = np.zeros(1, np.int8), np.zeros(1), np.zeros(6), np.full(2, 0.5**0.5)

    def active() -> int:
        return int(_weigh(x, faces, pair, axes, until, gone, size, np.zeros(6), 0, 0.0)[0])

    assert active() == 0
    assert until[0] == pytest.approx(0.3 - GAP * size[0])
    for way, asked in ((0.1, 0), (0.19, 0), (0.008, 1)):  # less than half of the gap is left at last
        x[3:, 2] -= way
        gone[3:] += way
        assert active() == asked


def test_a_look_may_be_handed_on(topology: Topology) -> None:
    x, y = sphere(0.4), sphere(0.4)
    looked = look(x, topology)
    assert put_apart(x, topology, 0, looked) == put_apart(x, topology, 0)
    assert put_apart(x, topology, looked=looked) == put_apart(y, topology)
    assert np.array_equal(x, y)
