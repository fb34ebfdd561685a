"""Columns of a thin skin share their masses: a unit step is stable, and steps are those of the masses that they say."""

from __future__ import annotations

import dataclasses

import numba
import numpy as np
import pytest

from solver.dehydration.kernel import (
    build_layout,
    held_outside,
    internal_force,
    kinetic_energy,
    march,
    momentum,
    new_state,
    positions,
    reweigh,
    stiffness_bounds,
)
from solver.dehydration.kernel.bounds import element_bounds, nodal_sums
from solver.dehydration.kernel.coupled import COMMON, RELATIVE, columns_of
from solver.dehydration.kernel.fixed_point import place
from solver.dehydration.kernel.strips import BOTTOM, TOP

from ._kernel_twin import block_mesh, deformed, random_hex
from .test_kernel_masses import stiffness
from .test_skin import grooved

pytestmark = pytest.mark.usefixtures("one_thread")

SAFETY = 2.0


def thin(rng, columns=(4, 5), depth=0.05):
    """A box with a skin of two layers, thin beside its edges, and the outer nodes of its columns."""
    mesh = block_mesh(rng, columns, core=2, exocarp=2)
    height = mesh["positions"].reshape(-1, 5, 3)
    for level in (3, 4):
        height[:, level, 2] = height[:, 2, 2] + depth * (level - 2) * rng.uniform(0.9, 1.1, len(height))
    return mesh, np.arange(len(height)) * 5 + 4


def shared(rng, **words):
    mesh, tops = thin(rng, **words)
    layout = build_layout(**mesh, safety=SAFETY)
    assert sorted(layout.tops) == list(tops)
    return layout, mesh


def dense(layout):
    """The masses (nodes, nodes)."""
    return np.diag(layout.mass) + np.diag(layout.pull[:-1], 1) + np.diag(layout.pull[:-1], -1)


@pytest.mark.parametrize("kappa", [1.0, 30.0, 1000.0])
@pytest.mark.parametrize("flat", [1.0, 0.1, 0.02])
def test_split_bounds_are_safe(kappa, flat):
    """Of both kinds of motion, and together of any: the highest frequency is below 2."""
    rng = np.random.default_rng(20)
    for _ in range(5):
        fresh = random_hex(rng) @ np.diag([1, 1, flat])
        state = np.zeros((8, 4), np.int32)
        place(state, fresh)
        given = np.arange(8)[None], np.ones(1, bool), np.ones(1), np.full(1, kappa), -np.inf
        common, relative = element_bounds(state, *given, split=True)[1:, 0]
        exact = stiffness(positions(state), "exocarp", 1.0, kappa).reshape(8, 3, 8, 3)
        turned = np.zeros((8, 8))
        for k, (low, high) in enumerate(zip(BOTTOM, TOP, strict=True)):
            turned[k, [low, high]] = np.sqrt(0.5)
            turned[4 + k, [low, high]] = -np.sqrt(0.5), np.sqrt(0.5)
        split = np.einsum("pa,aibj,qb->piqj", turned, exact, turned)
        blocks = [split[half][:, :, half].reshape(12, 12) for half in (slice(4), slice(4, 8))]
        for block, bound in zip(blocks, (common, relative), strict=True):
            largest = np.linalg.eigvalsh(block)[-1]
            assert largest <= bound * (1 + 1e-6)
            assert bound <= largest * (1.5 if kappa >= 30 else 4.0)
        masses = np.repeat([COMMON * common / 4, RELATIVE * relative / 4], 12)
        together = split.reshape(24, 24) / np.sqrt(np.outer(masses, masses))
        assert np.linalg.eigvalsh(together)[-1] <= 4 * (1 + 1e-6)


def test_a_step_is_that_of_the_masses():
    """Also where nodes of a column have other than four rows, at the box's sides."""
    rng = np.random.default_rng(21)
    layout, _ = shared(rng)
    state, velocity = deformed(layout, rng, 1e-3, 0.97)
    force = internal_force(layout, state, 0.97).nodal
    free = layout.free
    wanted = np.zeros_like(force)
    wanted[free] = -np.linalg.solve(dense(layout)[np.ix_(free, free)], force[free]) / 1.05
    march(layout, state, velocity, 1, theta=(0.97, 0.97), damping=0.1)
    assert np.abs(velocity[:, :3] - wanted).max() < 1e-5 * np.abs(wanted).max()
    np.testing.assert_allclose(momentum(layout, velocity), dense(layout) @ velocity[:, :3], rtol=1e-12, atol=1e-12)
    energy = 0.5 * (velocity[free, :3] * (dense(layout) @ velocity[:, :3])[free]).sum()
    assert kinetic_energy(layout, velocity) == pytest.approx(energy)


def test_a_unit_step_is_stable_and_the_skin_is_lighter():
    rng = np.random.default_rng(22)
    layout, mesh = shared(rng)
    given = mesh["is_exocarp"], mesh["mu"], mesh["kappa"]
    bounds = stiffness_bounds(layout, layout.fresh, *given, even_crushed=True)[0]
    alone = nodal_sums(layout.connectivity, SAFETY * bounds / 4, layout.nodes)
    lift = np.zeros(layout.nodes)
    for level in (0, 1, 2):
        lift[layout.tops - level] = 1.0
    assert lift @ dense(layout) @ lift < 0.5 * (lift * alone).sum()
    start, _ = deformed(layout, rng, 1e-4, 1.0)
    state, velocity = start.copy(), np.zeros(start.shape, np.float32)
    march(layout, state, velocity, 2000, theta=(1.0, 1.0), damping=0.0)
    assert np.max(np.abs(positions(state) - positions(layout.fresh))) < 1e-2


def test_thick_skins_share_nothing():
    mesh, tops = thin(np.random.default_rng(23), depth=0.3)
    assert not len(build_layout(**mesh).tops)
    assert len(columns_of(mesh["connectivity"], mesh["is_exocarp"])) == len(tops)


def test_only_columns_of_three_nodes_in_a_row_share():
    mesh, tops = thin(np.random.default_rng(23))
    connect, skin = mesh["connectivity"], mesh["is_exocarp"]
    assert np.array_equal(columns_of(connect, skin), tops)
    assert not len(columns_of(np.random.default_rng(1).permutation(connect.max() + 1)[connect], skin))
    assert not len(columns_of(connect, np.ones_like(skin)))
    assert not len(columns_of(connect, np.zeros_like(skin)))
    single = block_mesh(np.random.default_rng(2), exocarp=1)
    assert not len(columns_of(single["connectivity"], single["is_exocarp"]))


def test_masses_taken_anew_are_those_of_the_fresh_mesh_until_it_deforms():
    layout, mesh = shared(np.random.default_rng(24))
    given = mesh["is_exocarp"], mesh["mu"], mesh["kappa"]
    fresh = stiffness_bounds(layout, layout.fresh, *given, even_crushed=True)
    again = reweigh(layout, layout.fresh, *given, fresh, safety=SAFETY)
    outer = [layout.tops, layout.tops - 1]
    np.testing.assert_allclose(again.mass[outer], layout.mass[outer], rtol=1e-9)
    np.testing.assert_allclose(again.spread[:, 4:], layout.spread[:, 4:], rtol=0.05)
    wide = layout.fresh.copy()
    place(wide, positions(layout.fresh) * [1.5, 1.5, 1.0])
    stretched = reweigh(layout, wide, *given, fresh, safety=SAFETY)
    assert stretched.mass[layout.tops].min() > 1.5 * layout.mass[layout.tops].min()


def test_a_held_surface_stays_and_what_is_below_moves_by_its_own_masses():
    rng = np.random.default_rng(25)
    layout, _ = shared(rng)
    held = held_outside(layout, layout.tops)
    state, velocity = deformed(layout, rng, 1e-3, 0.97)
    before, force = state.copy(), internal_force(layout, state, 0.97).nodal
    march(held, state, velocity, 1, theta=(0.97, 0.97), damping=0.0)
    assert np.array_equal(state[layout.tops], before[layout.tops])
    free = layout.free.copy()
    free[layout.tops] = False
    wanted = -np.linalg.solve(dense(layout)[np.ix_(free, free)], force[free])
    assert np.abs(velocity[free, :3] - wanted).max() < 1e-5 * np.abs(wanted).max()


def thin_grooved():
    layout, skin, where = grooved(te=0.04)
    assert len(layout.tops)
    return layout, skin, where


def test_contact_pushes_the_outer_nodes_and_no_others():
    """What lies below goes along by the masses that are shared: a push is no pull on the skin's inside."""
    layout, skin, where = thin_grooved()
    words = {"theta": (0.8, 0.8), "damping": 0.01}
    state, velocity = new_state(layout, where)
    skin = march(layout, state, velocity, 3, skin=skin, **words)
    alone, quiet = state.copy(), velocity.copy()
    march(layout, state, velocity, 1, skin=skin, **words)
    march(layout, alone, quiet, 1, **words)
    pushed = momentum(layout, velocity.astype(np.float64) - quiet)
    outer = np.zeros(layout.nodes, bool)
    outer[skin.rows] = True
    assert np.abs(velocity - quiet)[~outer].max() > 0
    assert np.abs(pushed[outer]).max() > 1e3 * np.abs(pushed[~outer & layout.free]).max()


def test_same_bytes_on_one_and_two_threads():
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("only one thread")
    found = set()
    for threads in (1, 2):
        numba.set_num_threads(threads)
        layout, skin, where = thin_grooved()
        state, velocity = new_state(layout, where)
        march(layout, state, velocity, 30, theta=(0.8, 0.8), damping=0.01, skin=skin)
        found.add(state.tobytes() + velocity.tobytes())
    assert len(found) == 1


def test_the_back_ends_agree():
    rng = np.random.default_rng(26)
    layout, _ = shared(rng)
    start, _ = deformed(layout, rng, 1e-3, 0.97)
    ends = []
    for backend in ("scalar", "vector"):
        state, velocity = start.copy(), np.zeros(start.shape, np.float32)
        march(layout, state, velocity, 50, theta=(0.97, 0.97), damping=0.05, backend=backend)
        ends.append(positions(state))
    assert np.abs(ends[0] - ends[1]).max() < 1e-6
    plain = dataclasses.replace(layout, tops=layout.tops[:0], spread=layout.spread[:0])
    state, velocity = start.copy(), np.zeros(start.shape, np.float32)
    march(plain, state, velocity, 50, theta=(0.97, 0.97), damping=0.05)
    assert np.abs(ends[0] - positions(state)).max() > 1e-4
