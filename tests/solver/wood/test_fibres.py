"""Fibres that deviate: spiral grain, knots and what is hewn out of them; at rest they cost nothing."""

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from solver.contract import InvalidInput, Need
from solver.wood import SOLVER, WoodParams
from solver.wood.accuracy import expected_error
from solver.wood.fibres.hewing import hewn
from solver.wood.fibres.paths import crowded, named, placed
from solver.wood.forces.hessian import Stiffness
from solver.wood.model.bundle import lay
from solver.wood.model.outline import covered, drawn_in
from solver.wood.model.state import Wood, scratch_for
from solver.wood.stepping.explicit import forces

LENGTH, RADIUS = 0.15, 0.01
KNOT = {"at": (0.075, 0.0, 0.01), "radius": 0.003}
TEN = float(np.tan(np.radians(10)))
WAYS = {
    "spiral": {"spiral": 17.6},
    "sawn": {"spiral": TEN, "pith": (0.0, 1.0)},
    "knot": {"knots": [KNOT]},
    "both": {"spiral": 8.0, "knots": [KNOT, {"at": (0.03, 0.008, 0.0), "radius": 0.002}]},
    "sawn knot": {"pith": (0.002, -0.03), "knots": [{"at": (0.075, 0.001, 0.0), "radius": 0.004}]},
}


def params(grain: dict[str, object], **values: object) -> WoodParams:
    found = SOLVER.parse(
        {"rods": 40, "vertices": 16, "fracture": "none", "grain": {"strength": 0.0, **grain}, **values}
    )
    assert isinstance(found, WoodParams)
    return found


def pushed(wood: Wood) -> tuple[np.ndarray, np.ndarray]:
    """Return energies (4,) [J] and forces on what is free (n, 3) [N]."""
    scratch, books, m = scratch_for(wood), np.zeros(6), wood.motion
    forces(m, wood.rods, wood.turns, wood.bodies, scratch, wood.turning, 0.0, 1.0, books)
    return books[:4], scratch.f[m.held == 0]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("clamp", ["none", "start", "both"])
def test_at_rest_nothing_is_stretched_bent_sheared_or_twisted(way, clamp):
    asked = params(WAYS[way], clamp=clamp)
    wood = hewn(lay(asked, 16), asked)
    energy, force = pushed(wood)
    stiff = float(wood.rods.k.max())
    assert energy.max() < 1e-20
    assert np.abs(force).max() < 1e-12 * stiff


@pytest.mark.parametrize("way", ["spiral", "sawn", "both"])
def test_forces_are_the_energy_s_differences(way):
    asked = params(WAYS[way])
    wood = hewn(lay(asked, 16), asked)
    m, generator = wood.motion, np.random.default_rng(1)
    free = m.held == 0
    kept = [a.copy() for a in m]
    shake = np.where(free[:, None], generator.normal(size=m.x.shape), 0.0) * 0.02 * wood.rods.rest.min()
    way_ = np.where(free[:, None], generator.normal(size=m.x.shape), 0.0)
    h, found = 1e-7 * float(wood.rods.rest.min()), []
    for step in (0.0, h, -h):
        for now, was in zip(m, kept, strict=True):
            now[:] = was
        m.x[:] += shake + step * way_
        energy, force = pushed(wood)
        found.append((energy.sum(), force))
    assert found[0][0] > 1e-6
    assert (found[0][1] * way_[free]).sum() * h == pytest.approx((found[2][0] - found[1][0]) / 2, rel=1e-5)


def test_a_spiral_s_fibres_have_the_slope_that_is_their_distance_s():
    asked = params({"spiral": 12.0, "pith": (0.001, 0.0)})
    fibre = np.zeros((3, 2, 3))
    fibre[:, :, 1], fibre[:, :, 2] = 0.001, np.array([0.002, 0.005, 0.009])[:, None]
    fibre[:, :, 0] = 0.0749, 0.0751
    way = np.diff(placed(fibre, asked), axis=1)[:, 0]
    assert np.hypot(*way[:, 1:].T) / way[:, 0] == pytest.approx(12.0 * fibre[:, 0, 2], rel=1e-4)


def test_fibres_pass_round_a_knot_and_keep_their_shell():
    asked = params({"knots": [KNOT]})
    generator = np.random.default_rng(2)
    fibre = np.column_stack([generator.uniform(0, LENGTH, 4000), generator.normal(0, 0.006, (4000, 2))])
    where = placed(fibre, asked)
    away = np.hypot(where[:, 1], where[:, 2])
    assert away == pytest.approx(np.hypot(fibre[:, 1], fibre[:, 2]), rel=1e-9)
    # none is inside the cone, which is 1.5 times as long as wide
    around = away * np.arctan2(where[:, 1], where[:, 2])
    wide = 0.003 * np.minimum(away / 0.01, 1.0)
    assert np.hypot((where[:, 0] - 0.075) / 1.5, around).min() > 0
    assert (np.hypot((where[:, 0] - 0.075) / 1.5, around) / wide).min() > 0.97
    # and behind it they are where they were
    far = np.abs(fibre[:, 0] - 0.075) > 0.05
    assert np.abs(where - fibre)[far].max() < 1e-4
    assert np.abs(where - fibre).max() > 1e-3
    assert named(where, asked) == pytest.approx(fibre, abs=1e-9)


def test_fibres_crowd_as_their_distances_do():
    """The section over that far away, against differences; beside a post of the flow there is half of it."""
    asked = params({"knots": [KNOT]})
    fibre = np.array([[0.075, 0.002, 0.008], [0.077, 0.0045, 0.007], [0.09, 0.001, 0.009], [0.075, 1e-5, 0.01]])
    angle = np.arctan2(fibre[:, 1], fibre[:, 2])
    r, h = np.hypot(fibre[:, 1], fibre[:, 2]), 1e-6
    ends = []
    for sign in (1, -1):
        turned = angle + sign * h
        near = placed(np.column_stack([fibre[:, 0], r * np.sin(turned), r * np.cos(turned)]), asked)
        ends.append(np.arctan2(near[:, 1], near[:, 2]))
    assert crowded(fibre, asked) == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-4)
    assert crowded(fibre, asked)[3] == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("way", ["sawn", "sawn knot"])
def test_what_is_hewn_has_its_outline_its_weight_and_its_load(way):
    asked = params(WAYS[way], gravity=9.81, tip_load=(0.0, 3.0, 0.0), rods=100)
    wood = hewn(lay(asked, 16), asked)
    whole, free = (wood.rods.alive == 1) & (wood.rods.k > 0), wood.motion.held == 0
    for end in (wood.rods.a[whole], wood.rods.b[whole]):
        assert np.hypot(*wood.straight[end, 1:].T).max() < RADIUS
    full = np.pi * RADIUS**2 * LENGTH * 600
    # half an edge of it is the clamp's; chips are left out, the more as rods have only part of a section at the rim
    assert wood.motion.mass[free].sum() == pytest.approx(full * (1 - 0.5 / 15), rel=0.04)
    assert wood.motion.load[free, 1].sum() == pytest.approx(3.0)
    assert wood.motion.load[free, 2].sum() == pytest.approx(-9.81 * wood.motion.mass[free].sum())
    on = wood.bonds.on > 0
    for edge in (wood.bonds.i[on], wood.bonds.j[on]):
        assert wood.rods.alive[edge].all()
    # bonds on the stubs of what is cut
    assert ((wood.bonds.at[on] < 0) | (wood.bonds.at[on] > 1)).any()


def test_bonds_are_square_to_fibres():
    asked = params({"spiral": 17.6}, rods=60)
    wood = lay(asked, 16)
    inside = (wood.bonds.share > 0) & (wood.bonds.share < 1)
    assert np.abs(wood.bonds.cosine[inside]).mean() < 0.02
    plain = lay(params({}, rods=60), 16)
    assert np.median(wood.bonds.rest / plain.bonds.rest) < 1.0


def sag(asked: WoodParams) -> float:
    """Return the deflection [m/N] of the tip under a small dead load, by the linear equations of rest."""
    wood = hewn(lay(asked, asked.vertices), asked)
    m, free = wood.motion, wood.motion.held == 0
    k = Stiffness(m.x, wood.rods, wood.bonds, free).matrix(m.x, wood.rods, wood.bonds).tocsc()
    # symmetric and definite: ordered as such, a third of the work
    factor = splu(k, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    moved = factor.solve(m.load[free].ravel()).reshape(-1, 3)[:, 2]
    load = m.load[free, 2]
    return float(load @ moved / load.sum() ** 2)


def test_sloped_grain_is_softer_and_knots_are_too():
    loads: dict[str, object] = {"tip_load": (0.0, 0.0, -1.0), "length": 0.3, "vertices": 31}
    straight = sag(params({}, **loads))
    slope = straight / sag(params({"spiral": TEN, "pith": (0.0, 1.0)}, **loads))
    # the beam of oblique fibres has 0.73
    assert 0.64 < slope < 0.76
    assert straight / sag(params({"spiral": TEN / 2, "pith": (0.0, 1.0)}, **loads)) > slope + 0.1
    knot = {"at": (0.03, 0.0, 0.01), "radius": 0.004}
    assert 0.8 < straight / sag(params({"knots": [knot]}, **loads)) < 0.99


def test_what_cannot_be_is_refused():
    with pytest.raises(InvalidInput, match="spiral grain and knots need the explicit mode"):
        SOLVER.parse({"mode": "static", "grain": {"spiral": 1.0}})
    with pytest.raises(InvalidInput, match="wider than half its distance"):
        SOLVER.parse({"grain": {"knots": [{"at": (0.07, 0.0, 0.01), "radius": 0.006}]}})
    with pytest.raises(InvalidInput, match="beyond an end"):
        SOLVER.parse({"grain": {"knots": [{"at": (0.2, 0.0, 0.01), "radius": 0.003}]}})
    with pytest.raises(InvalidInput, match="steeper"):
        SOLVER.parse({"grain": {"spiral": 60.0}})
    with pytest.raises(InvalidInput, match="deviating grain"):
        expected_error(params({"knots": [KNOT]}), "preview", 1.0)


def test_a_hewn_stick_stays_at_rest_until_it_is_loaded_and_has_a_surface():
    asked = params(WAYS["sawn"], clamp="none", rods=20)
    found = SOLVER.solve(asked, Need(stages=(0.0, 1e-4), quality="preview", fields=("kinetic_energy", "mesh_position")))
    assert found.kinetic_energy.values.max() < 1e-20
    mesh = found.mesh_position.values[0]
    mesh = mesh[np.isfinite(mesh).all(-1)] if mesh.ndim == 2 else mesh
    assert np.abs(mesh[..., 1:]).max() < 1.6 * RADIUS


def test_cells_are_covered_as_far_as_the_outline_reaches():
    """And stand for what is left of them at its centroid."""
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    points, wide = np.array([(0.0, 0.0), (1.0, 0.0), (0.9, 0.2), (1.1, 0.2), (1.3, 0.0), (0.0, -1.05)]), np.full(6, 0.4)
    there = drawn_in(square, points, wide)
    assert covered(square, there, wide) == pytest.approx([1.0, 0.5, 0.75, 0.25, 0.0, 0.375])
    # from 0.8, 0.7 and 0.9 to the side
    assert there[1:4, 0] == pytest.approx([0.9, 0.85, 0.95])
    assert there[0] == pytest.approx(points[0])


def test_a_little_slope_changes_little():
    """What runs out is cut obliquely: sticks of a twentieth of slope are as stiff as the beam, within a tenth."""
    loads: dict[str, object] = {"tip_load": (0.0, 0.0, -1.0), "length": 0.3, "vertices": 31, "rods": 24}
    straight = sag(params({}, **loads))
    for slope, wanted in ((0.005, 1.0), (0.05, 1 / (1 + 0.05**2 * 10e9 / 0.7e9))):
        for pith in ((1.0, 0.0), (0.0, 1.0)):
            assert straight / sag(params({"spiral": slope, "pith": pith}, **loads)) == pytest.approx(wanted, rel=0.1)
