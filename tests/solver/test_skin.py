"""What contact changes of the skin is what the fruit gets, in whatever order and by however many threads."""

from __future__ import annotations

import dataclasses

import numba
import numpy as np
import pytest

from solver.dehydration.contact.data import HELD, HITS, READS
from solver.dehydration.fresh.mesh import build_mesh
from solver.dehydration.kernel import build_layout, make_skin, march, new_state
from solver.dehydration.kernel.fixed_point import QUANTUM
from solver.dehydration.kernel.layout import aligned_copy
from solver.dehydration.kernel.strips import GROUP
from solver.dehydration.params import DehydrationParams


def grooved(least: float = -2.0, safety: float = 4.0, clearance: float = 0.05, te: float = 0.1):
    """A fruit's layout, its skin, and its nodes where a groove has closed, as far as y > least."""
    mesh = build_mesh(DehydrationParams.parse({"te": te}), 16, np.linspace(0, 1, 4))
    depth = mesh.depth.copy()
    depth[-3:] = 1
    groove = np.exp(-((mesh.rays[:, 0] / 0.15) ** 2)) * (mesh.rays[:, 1] > least)
    where = mesh.positions * (1 - 0.5 * groove[:, None] * depth[None, :] ** 2).reshape(-1, 1)
    mu = np.where(mesh.is_exocarp, 10.0, 1.0)
    layout = build_layout(mesh.positions, mesh.connectivity, mesh.is_exocarp, mu, 30 * mu, mesh.fixed, safety=safety)
    return layout, make_skin(layout, mesh.surface_nodes, mesh.sphere.quads, clearance), where


@pytest.mark.parametrize(("given", "steps", "many"), [((), 3, True), ((0.7, 100.0, 0.1), 9, False)])
def test_the_fruit_gets_what_contact_has_changed(given: tuple[float, ...], steps: int, many: bool) -> None:
    """Of few pushes each gives it, of many each node is looked at once: the speeds are those of the skin either way."""
    layout, skin, where = grooved(*given)
    state, velocity = new_state(layout, where)
    words = {"theta": (0.8, 0.8), "damping": 0.01}
    skin = march(layout, state, velocity, steps, skin=skin, **words)
    before, alone, quiet = state.copy(), state.copy(), velocity.copy()
    skin = march(layout, state, velocity, 1, skin=skin, **words)
    march(layout, alone, quiet, 1, **words)
    counts, looked = skin.contact.counts, skin.contact.reads[: skin.contact.counts[READS]]
    assert counts[HITS] > 15  # 20: the lighter skin is pushed away by the first
    assert bool(counts[HELD] or 4 * counts[HITS] > counts[READS]) is many
    assert counts[HELD] or (skin.contact.hit_values[: counts[HITS], 1] > 0).sum() > 10
    assert np.array_equal(velocity[skin.rows[looked], :3], skin.velocity[looked, :3])
    assert np.abs(velocity - quiet)[skin.rows[looked]].max() > 0.01 * np.abs(velocity).max()
    # a node goes by its speed, rounded once as it moves and once as it is pushed
    moved = (state - before)[layout.free, :3] - velocity[layout.free, :3].astype(np.float64) / QUANTUM
    assert np.abs(moved).max() < 2


def test_same_bytes_on_one_and_two_threads_that_touch() -> None:
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("only one thread")
    found = set()
    for threads in (1, 2):
        numba.set_num_threads(threads)
        layout, skin, where = grooved()
        state, velocity = new_state(layout, where)
        march(layout, state, velocity, 30, theta=(0.8, 0.8), damping=0.01, skin=skin)
        found.add(state.tobytes() + velocity.tobytes())
    assert len(found) == 1


def test_threads_move_what_they_push(monkeypatch) -> None:
    """Every group of nodes is moved once, and rows of force are read by the thread that has written them."""
    own, plain = {}, {}
    for threads in (1, 2, 4):
        monkeypatch.setattr("solver.dehydration.kernel.layout.get_num_threads", lambda threads=threads: threads)
        layout, _, _ = grooved()
        assert sorted(layout.groups) == list(range(-(-layout.nodes // GROUP)))
        strip = np.searchsorted(layout.strips[:, 0], layout.rows // 3 // 64, side="right") - 1
        turn = np.empty(len(layout.groups), int)
        turn[layout.groups] = np.arange(len(turn))
        node = np.repeat(np.arange(layout.nodes), np.diff(layout.row_start))
        parts = turn[node // GROUP] * threads // len(turn), strip * threads // len(layout.strips)
        own[threads] = np.mean(parts[0] == parts[1])
        plain[threads] = np.mean(node // GROUP * threads // len(turn) == parts[1])
    assert own[1] == 1
    assert own[2] > 0.85
    assert own[4] > 0.75
    assert plain[2] < 0.6  # by number alone


def test_order_of_groups_does_not_matter() -> None:
    layout, _, where = grooved()
    found = set()
    for order in (layout.groups, layout.groups[::-1]):
        other = dataclasses.replace(layout, groups=aligned_copy(order, np.int32))
        state, velocity = new_state(other, where)
        march(other, state, velocity, 20, theta=(0.8, 0.8), damping=0.01)
        found.add(state.tobytes() + velocity.tobytes())
    assert len(found) == 1
