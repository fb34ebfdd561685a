"""The explicit kernels, which go part by part through a plan, against plain numpy that knows of no parts."""

from dataclasses import replace

import numpy as np
import pytest

from solver.wood import SOLVER
from solver.wood.fracture import break_worst, overstress
from solver.wood.model.bundle import lay
from solver.wood.model.plan import plan_for
from solver.wood.model.state import State, Wood, copied
from solver.wood.stepping.explicit import march
from solver.wood.stepping.moment import begin

from ._bonds_twin import bond_energies


def broken(rods: int = 12, vertices: int = 30, **values) -> Wood:
    """Return a shaken bundle with split vertices, cut edges and bonds that are off."""
    wood = lay(SOLVER.parse({"rods": rods, "vertices": vertices, **values}), vertices)
    m, generator = wood.motion, np.random.default_rng(3)
    m.x[:] += generator.normal(0, 0.05 * wood.rods.rest.min(), m.x.shape)
    m.v[:] = generator.normal(0, 0.1, m.x.shape) * (m.held == 0)[:, None]
    wood.bonds.on[generator.choice(len(wood.bonds.on), len(wood.bonds.on) // 5, replace=False)] = 0
    wood.bonds.damage[:] = generator.uniform(0, 1, len(wood.bonds.on)) * (
        generator.uniform(size=len(wood.bonds.on)) < 0.3
    )
    ratio, place = np.zeros(len(wood.rods.a)), np.zeros(len(wood.rods.a))
    real = np.flatnonzero(wood.rods.k > 0)
    hit = real[3::13]
    ratio[hit], place[hit] = 2.0, np.resize([0.0, 0.5, 1.0], len(hit))
    found = break_worst(wood, ratio, place, np.inf)
    assert found.rods > 3
    assert len(found.wood.motion.x) > len(m.x)
    assert not found.wood.rods.alive.all()
    return found.wood


def forces(wood: Wood) -> tuple[np.ndarray, np.ndarray]:
    """Return the forces (v, 3) of rods, loads included, and unit tangents."""
    x, r = wood.motion.x, wood.rods
    e = x[r.b] - x[r.a]
    length = np.linalg.norm(e, axis=1)[:, None]
    t = e / length
    g = -np.where(r.alive == 1, r.k * (length[:, 0] / r.rest - 1), 0.0)[:, None] * t
    whole = r.whole == 1
    p, q = r.before[whole], r.after[whole]
    c = (t[p] * t[q]).sum(1)[:, None]
    # E = 4 alpha (1 - c) / (1 + c) / span, dE/dc = -8 alpha / (1 + c)^2 / span
    slope = 8 * (r.alpha / r.span)[whole][:, None] / (1 + c) ** 2
    np.add.at(g, p, slope * (t[q] - c * t[p]) / length[p])
    np.add.at(g, q, slope * (t[p] - c * t[q]) / length[q])
    f = wood.motion.load.copy()
    np.add.at(f, r.a, -g)
    np.add.at(f, r.b, g)
    return f, t


@pytest.mark.parametrize("values", [{}, {"rods": 1, "vertices": 60}, {"reach": 0.0}, {"clamp": "both", "rods": 9}])
def test_forces_are_those_of_plain_numpy(values):
    wood = broken(**values)
    state = begin(wood)
    f, t = forces(wood)
    each, scale = bond_energies(wood, wood.motion.x), np.abs(state.scratch.f).max()
    if not len(each):
        np.testing.assert_allclose(state.scratch.f, f, rtol=0, atol=1e-12 * scale)
    # by a complex step, which loses no digits; shares beyond an edge's ends are among them
    for seed in range(6 if len(each) else 0):
        way = np.random.default_rng(seed).normal(size=f.shape)
        slope = bond_energies(wood, wood.motion.x + 1e-30j * way).imag.sum() / 1e-30
        assert ((state.scratch.f - f) * way).sum() == pytest.approx(-slope, abs=1e-12 * scale * f.size**0.5)
    whole = state.scratch.each.sum(0)
    plain = bond_energies(replace(wood, bonds=wood.bonds._replace(damage=0 * each)), wood.motion.x)
    pressed = state.scratch.each[0] == 0
    np.testing.assert_allclose(
        whole[~pressed], plain[~pressed], rtol=1e-9, atol=1e-12 * max(each.max(initial=0.0), 1e-300)
    )
    np.testing.assert_allclose(state.books[2], each.sum(), rtol=1e-11)
    np.testing.assert_allclose(state.scratch.t, t, rtol=0, atol=1e-14)
    inside = state.scratch.f - wood.motion.load
    assert np.abs(inside.sum(0)).max() < 1e-12 * scale
    assert np.abs(np.cross(wood.motion.x, inside).sum(0)).max() < 1e-12 * scale


def test_a_plan_lists_every_whole_bond_once_and_by_its_edge():
    wood = broken(rods=40)
    plan, b = plan_for(wood.rods, wood.bonds, wood.strength), wood.bonds
    found = []
    for p in range(len(plan.part) - 1):
        lanes = plan.lane[plan.part[p] + p : plan.part[p + 1] + p + 1].astype(int)
        number = plan.origin[p, : lanes[-1]]
        np.testing.assert_array_equal(b.j[number], np.repeat(np.arange(*plan.part[p : p + 2]), np.diff(lanes)))
        seat = plan.seat[p, : lanes[-1]]
        np.testing.assert_array_equal(b.i[number], np.append(np.arange(len(plan.a)), plan.stub)[seat])
        np.testing.assert_array_equal(b.at[number], np.append(np.full(len(plan.a), 0.5), plan.at)[seat])
        found.append(number)
    assert len(found) > 3
    assert len(plan.stub) > 3
    np.testing.assert_array_equal(np.sort(np.concatenate(found)), np.flatnonzero(b.on))


def _marched(state: State, pieces: tuple[int, ...]) -> State:
    state, time = copied(state), 0.0
    w = state.wood
    for steps in pieces:
        assert march(
            w.motion,
            w.rods,
            w.turns,
            w.bodies,
            w.pins,
            state.scratch,
            w.turning,
            time,
            1e-8,
            steps,
            20.0,
            state.books,
            state.impulse,
        )
        time += steps * 1e-8
    return state


def test_a_march_in_pieces_is_the_march_whole():
    """Energies are looked at where a piece ends: that must not touch the motion, nor what is booked."""
    state = begin(broken())
    whole, pieces = _marched(state, (24,)), _marched(state, (1, 5, 2, 16))
    assert whole.wood.motion.x.tobytes() == pieces.wood.motion.x.tobytes()
    assert whole.wood.motion.v.tobytes() == pieces.wood.motion.v.tobytes()
    assert whole.books.tobytes() == pieces.books.tobytes()
    assert whole.scratch.each.tobytes() == pieces.scratch.each.tobytes()
    assert np.abs(whole.wood.motion.x - state.wood.motion.x).max() > 0


def test_numbers_of_bonds_do_not_matter_to_the_forces():
    wood = broken()
    order = np.random.default_rng(1).permutation(len(wood.bonds.i))
    other = replace(wood, bonds=type(wood.bonds)(*(a[order] for a in wood.bonds)))
    one, two = begin(wood), begin(other)
    scale = np.abs(one.scratch.f).max()
    np.testing.assert_allclose(one.scratch.f, two.scratch.f, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(one.scratch.each[:, order], two.scratch.each, rtol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_of_strain_is_above_what_it_bounds_and_near(seed):
    wood = broken(rods=12, clamp=("none", "start", "both")[seed % 3], seed=seed)
    state, count = begin(wood), len(wood.rods.a)
    ratio, place, m = np.zeros(count), np.zeros(count), wood.motion
    t, inverse = state.scratch.t, state.scratch.inverse
    top = overstress(
        wood.rods, t, inverse, wood.strength, m.theta, m.reference, state.scratch.bent, False, True, ratio, place
    )
    assert top <= state.scratch.found[:, 3].max() * (1 + 1e-6) < 1.5 * top
    for p in range(len(state.scratch.found)):
        own = ratio[state.scratch.plan.part[p] : state.scratch.plan.part[p + 1]]
        assert own.max() <= state.scratch.found[p, 3] * (1 + 1e-6)


@pytest.mark.parametrize("reach", [0.0, 1.6], ids=["loose", "bonded"])
def test_seats_are_computed_where_something_is_bonded(reach):
    """Of several parts none has bonds, or all: without, the seats' array stays what it was."""
    wood = lay(SOLVER.parse({"rods": 30, "vertices": 20, "reach": reach}), 20)
    state = begin(wood)
    assert len(state.scratch.plan.part) > 3
    state.scratch.seats[:, :, :6] = np.nan
    books, impulse = state.books, state.impulse
    assert march(
        wood.motion, wood.rods, wood.turns, wood.bodies, wood.pins, state.scratch, False, 0.0, 1e-9, 1, 0.0,
        books, impulse,
    )  # fmt: skip
    assert np.isnan(state.scratch.seats[:, :, :6]).all() == (reach == 0.0)
    assert np.isfinite(wood.motion.x).all()
