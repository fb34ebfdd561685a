"""Whole runs: the balance of energy, breaks at known loads, contact's books, hostile input."""

import numpy as np
import pytest

from solver.contract import InvalidGeometry, InvalidInput, Need, NotConverged, SolverError
from solver.wood import SOLVER
from solver.wood.fracture import break_worst
from solver.wood.model.bundle import lay
from solver.wood.model.curves import held
from solver.wood.stepping.moment import begin

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}
ROD = {"rods": 1, "radius": 0.002, "vertices": 16, **PLAIN}


def run(values, *stages, **need):
    return SOLVER.solve(SOLVER.parse(values), Need(stages=stages, **need))


def test_energy_of_a_bent_bundle_drifts_with_the_square_of_the_step():
    """The experiment of Fig. 4.1, shorter."""
    values = {"rods": 9, "vertices": 16, "clamp": "none", "bend": 0.0133, **PLAIN}
    times = tuple(np.linspace(2e-4, 1e-3, 9))
    off = [run({**values, "step": step}, *times).residual.values.max() for step in (4e-7, 2e-7, 1e-7)]
    assert np.log2(off[0] / off[1]) == pytest.approx(2, abs=0.3)
    assert np.log2(off[1] / off[2]) == pytest.approx(2, abs=0.3)
    assert off[0] < 1e-3


def test_a_step_ten_times_too_long_is_shortened():
    values = {**ROD, "bend": 0.02}
    plain, long = run(values, 1e-3), run({**values, "step": 10 * run(values, 1e-5).attrs["longest_stable_step"]}, 1e-3)
    assert plain.attrs["step"] == long.attrs["step"] < plain.attrs["longest_stable_step"]
    assert np.array_equal(plain.tip_position, long.tip_position)


def test_the_longest_stable_step_is_just_that(monkeypatch):
    from solver.wood.stepping import stability
    from solver.wood.stepping.marching import explicit

    params = SOLVER.parse({"rods": 9, "vertices": 12, "bend": 0.01, **PLAIN})
    longest = stability.longest_step(lay(params, 12)) * np.sqrt(1.03)
    from solver.contract import Context

    (fine,) = explicit(lay(params, 12), params, (2e-3,), 0.98 * longest, 1.0, Context())
    assert fine.error < 0.1
    with pytest.raises(SolverError, match=r"balance|blew up"):
        list(explicit(lay(params, 12), params, (2e-3,), 1.03 * longest, 1.0, Context()))


@pytest.mark.parametrize(("fracture", "depth"), [("stress", 0.5), ("stress", 0.0), ("vertex", 0.0)])
def test_a_notched_fibre_breaks_at_its_load(fracture, depth):
    length, speed, limit = 0.1, 0.2, 0.01
    notch = [{"position": 0.0437, "depth": depth, "width": 0.004}] if depth else []
    values = {**ROD, "length": length, "clamp": "both", "pull": (speed, 0, 0), "fracture": fracture, "notches": notch}
    breaking = limit * (1 - depth) ** 2 * length / speed
    found = run(values, 0.99 * breaking, 1.01 * breaking)
    # a straight fibre is as likely to break anywhere; a notched one breaks once
    assert found.broken_rods.values[0] == 0
    assert found.broken_rods.values[1] >= 1
    stress = 10e9 * limit * (1 - depth) ** 2 * 0.99
    assert found.elastic_energy.values[0] == pytest.approx(stress**2 / 2e10 * np.pi * 0.002**2 * length, rel=1e-3)
    if depth:
        assert found.broken_rods.values[1] == 1
        ends = found.rod_position.values[0]
        cut = found.rod_cut.values[1]
        (edge,) = np.flatnonzero(cut >= 0) if (cut >= 0).any() else [np.abs(ends[:, 0, 0] - 0.0437).argmin()]
        place = ends[edge, 0, 0] + max(cut[edge], 0) * (ends[edge, 1, 0] - ends[edge, 0, 0])
        assert abs(place - 0.0437) < 0.0025


def test_breaks_keep_mass_and_momentum_and_hand_bonds_over():
    wood = lay(SOLVER.parse({"rods": 12, "vertices": 12, "clamp": "none"}), 12)
    wood.motion.v[:] = np.random.default_rng(0).normal(size=wood.motion.v.shape)
    mass, momentum = wood.motion.mass.sum(), wood.motion.mass @ wood.motion.v
    stiffness = wood.bonds.s.sum()
    x, r, b = wood.motion.x, wood.rods, wood.bonds
    before = held(x, r, b.i, b.at)[0].copy(), held(x, r, b.j, b.share)[0].copy()
    ratio, place = np.zeros(len(wood.rods.a)), np.zeros(len(wood.rods.a))
    ratio[[4, 15, 30]], place[[4, 15, 30]] = 1.5, [0.0, 0.5, 1.0]
    broken = break_worst(wood, ratio, place, np.inf)
    assert (broken.rods, broken.bonds) == (3, 0)
    now = broken.wood
    assert len(now.motion.x) == 12 * 12 + 2
    assert now.motion.mass.sum() == pytest.approx(mass, rel=1e-14)
    assert now.motion.mass @ now.motion.v == pytest.approx(momentum, rel=1e-12)
    assert now.bonds.s.sum() == pytest.approx(stiffness, rel=1e-14)
    # bonds pull at the places where they pulled
    x, r, b = now.motion.x, now.rods, now.bonds
    ends = held(x, r, b.i, b.at)[0], held(x, r, b.j, b.share)[0]
    for found, expected in zip(ends, before, strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    d = ends[0] - ends[1]
    assert np.linalg.norm(d, axis=1) == pytest.approx(b.rest, rel=1e-9)
    assert r.alive[b.j].all()
    assert r.alive[b.i].all()
    assert (b.at != 0.5).any()
    assert ((b.share < 0) | (b.share > 1)).any()


def test_energy_is_booked_through_a_bundle_s_parting():
    values = {"rods": 12, "vertices": 12, "length": 0.1, "radius": 0.005, "clamp": "both", "pull": (1.0, 0, 0)}
    found = run(values, 5e-4, 3e-3)
    assert found.broken_rods.values[1] >= 12
    assert found.broken_bonds.values[1] > 0
    assert found.lost_energy.values[1] > 0.1 * found.work.values[1]
    assert found.residual.values.max() < 0.01


def test_what_a_body_receives_is_what_the_rods_lose():
    fall = {**ROD, "clamp": "none", "gravity": 9.81, "damping": 200.0}
    box = {"shape": "box", "size": (0.3, 0.1, 0.02), "path": [{"time": 0, "position": (0.075, 0, -0.0102)}]}
    found = run({**fall, "bodies": [box]}, 0.05, 0.1)
    mass = 600 * np.pi * 0.002**2 * 0.15
    gained = np.diff(found.impulse.values[:, 2])[0]
    assert gained == pytest.approx(-mass * 9.81 * 0.05, rel=1e-2)
    assert np.abs(found.impulse.values[:, :2]).max() < 1e-3 * abs(gained)
    assert found.residual.values.max() < 1e-2


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ({"rods": 0}, InvalidInput),
        ({"radius": 0.9}, InvalidGeometry),
        ({"curvature": 90.0, "radius": 0.01}, InvalidGeometry),
        ({"twist": True, "mode": "static"}, InvalidInput),
        ({"notches": [{"position": 1.0, "depth": 0.5}]}, InvalidInput),
        ({"bodies": [{"size": (0, 1, 1), "path": [{"time": 0, "position": (0, 0, 0)}]}]}, InvalidInput),
    ],
)
def test_impossible_parameters_are_refused(values, kind):
    with pytest.raises(kind):
        SOLVER.parse(values)


def test_the_mode_that_is_gone_says_what_to_use_instead():
    with pytest.raises(InvalidInput, match="mass_scaling of 1e4"):
        SOLVER.parse({"mode": "implicit"})


@pytest.mark.parametrize("fracture", ["stress", "vertex"])
def test_an_equilibrium_says_what_it_cannot_bear(fracture):
    borne = 10e9 * np.pi * 0.002**2 * 0.01
    values = {**ROD, "mode": "static", "fracture": fracture, "tip_load": (borne, 0.0, 0.0)}
    # loads grow evenly and are full at 1 s
    with pytest.raises(NotConverged, match=r"1\.02 times the loads a rod") as found:
        run(values, 0.98, 1.02)
    assert found.value.partial is not None
    assert found.value.partial.stage.values.tolist() == [0.98]
    assert "fracture none" in found.value.advice
    assert run({**values, "fracture": "none"}, 1.02).tip_position.values[0, 0] > 0.15


def test_a_bond_of_no_length_stays_finite():
    wood = lay(SOLVER.parse({"rods": 9, "vertices": 6, "clamp": "none"}), 6)
    x, r, b = wood.motion.x, wood.rods, wood.bonds
    away = held(x, r, b.i, b.at)[0] - held(x, r, b.j, b.share)[0]
    x[wood.grid[wood.rod[b.i[0]]]] -= away[0]
    assert np.linalg.norm((held(x, r, b.i, b.at)[0] - held(x, r, b.j, b.share)[0])[0]) < 1e-15
    state = begin(wood)
    assert np.isfinite(state.books).all()
    assert np.isfinite(state.scratch.each).all()
    assert np.isfinite(state.scratch.f).all()


def test_the_sampling_keeps_its_distance_and_the_disk_s_moments():
    for rods in (3, 8, 30, 100):
        params = SOLVER.parse({"rods": rods, **PLAIN})
        wood = lay(params, 4)
        points = wood.motion.x[wood.grid[:, 0]][:, 1:]
        area = np.pi * wood.rods.radius[np.searchsorted(wood.rod, np.arange(len(points)))] ** 2
        assert abs(len(points) - rods) <= max(1, 0.05 * rods)
        assert area.sum() == pytest.approx(np.pi * 1e-4)
        moment = area @ (points**2).sum(1) + (area**2).sum() / (2 * np.pi)
        assert moment == pytest.approx(np.pi * 1e-8 / 2)
        apart = np.linalg.norm(points[:, None] - points[None], axis=-1) + np.eye(len(points))
        assert apart.min() > 0.6 * 0.01 * np.sqrt(0.7 * np.pi / rods)
