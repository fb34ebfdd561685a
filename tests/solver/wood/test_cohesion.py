"""Bonds that give way: what a crack costs, whatever its mix, and what crack each bond stands for."""

import math

import numpy as np
import pytest

from solver.contract import Context, Need
from solver.wood import SOLVER
from solver.wood.cohesion import soften
from solver.wood.fracture import sawed
from solver.wood.model.bundle import lay
from solver.wood.model.joining import longest_edge, resolved
from solver.wood.model.outline import area, chords, corners, sawn_through
from solver.wood.model.plan import KEEP
from solver.wood.model.state import scratch_for

PLAIN = {"grain": {"stiffness": 0.0, "strength": 0.0}}
#: So weak that rods as coarse as these hold less at their strength than cracks cost.
WEAK = {"rods": 9, "vertices": 6, "cleavage": 1e6, "shear_strength": 2e6, **PLAIN}
PLANK = {"outline": [(-0.005, -0.01), (0.005, -0.01), (0.005, 0.01), (-0.005, 0.01)]}


@pytest.mark.parametrize("mix", [0.0, 0.3, 1.0])
def test_taking_a_bond_apart_costs_its_crack(mix):
    """By summing what each growth of damage sets free; Benzeggagh and Kenane between opening and shear."""
    params = SOLVER.parse({**WEAK, "toughness": 200.0, "toughness_sliding": 800.0})
    wood = lay(params, 6)
    b, plan = wood.bonds, scratch_for(wood).plan
    last = np.zeros(len(b.i))
    cost = (200 + 600 * mix**2.0) * b.area
    begin = 1 / ((1 - mix) / b.opens + mix / b.slides)
    freed, broken = np.zeros(len(b.i)), 0
    for way in np.linspace(0, 1.001, 1500)[1:]:
        # to the end of the law, evenly in separation: the root of the energy
        both = (way * cost) ** 2 / begin
        _, parted, _ = soften(plan, b, np.stack([(1 - mix) * both, mix * both]), params.mixing)
        broken += parted
        freed += both * (b.damage - last)
        assert (b.damage >= last).all()
        last = b.damage.copy()
    assert broken == len(b.i)
    assert (b.on == 2).all()
    assert freed == pytest.approx(cost, rel=0.01)
    assert plan.law[:, KEEP][plan.law[:, 0] > 0].max() == 0.0


def test_damage_does_not_heal_and_begins_at_the_strength():
    wood = lay(SOLVER.parse(WEAK), 6)
    b, plan = wood.bonds, scratch_for(wood).plan
    zero = np.zeros(len(b.i))
    assert soften(plan, b, np.stack([0.99 * b.opens, zero]), 2.0) == (0, 0, 0)
    assert soften(plan, b, np.stack([zero, 0.99 * b.slides]), 2.0) == (0, 0, 0)
    taken, *gone = soften(plan, b, np.stack([1.5 * b.opens, zero]), 2.0)
    assert (b.damage > 0).all()
    assert gone == [0, 0]
    # a part of the stiffness is gone where it is drawn out to: as much of the energy
    assert taken == pytest.approx(1.5 * b.damage @ b.opens, rel=1e-12)
    half = b.damage.copy()
    assert ((half > 0) & (half < 1)).all()
    assert soften(plan, b, np.stack([1.1 * b.opens, zero]), 2.0) == (0, 0, 0)
    assert np.array_equal(b.damage, half)
    assert soften(plan, b, np.stack([1e9 * b.opens, zero]), 2.0)[1] == len(b.i)
    # broken ones that are far from what they joined are forgotten
    assert soften(plan, b, np.stack([b.k * b.rest, zero]), 2.0)[2] == len(b.i)
    assert (b.on == 0).all()


def test_coarse_bonds_are_weaker_and_as_tough():
    # edges so short that they resolve any strength
    wood = lay(SOLVER.parse({**WEAK, "cleavage": 1e8}), 600)
    b, plan = wood.bonds, scratch_for(wood).plan
    zero = np.zeros(len(b.i))
    assert (b.opens > b.torn).all()
    assert soften(plan, b, np.stack([0.9 * b.torn, zero]), 2.0)[0] == 0
    assert soften(plan, b, np.stack([1.1 * b.torn, zero]), 2.0)[1] == len(b.i)


@pytest.mark.parametrize("values", [{}, PLANK])
@pytest.mark.parametrize("rods", [24, 96])
def test_a_straight_crack_costs_its_area_whatever_the_rods(values, rods):
    """Bonds that lines of the section cross, none of them those that widths were fitted to."""
    params = SOLVER.parse({"rods": rods, "vertices": 4, **values, **PLAIN})
    wood = lay(params, 4)
    b, m, found = wood.bonds, wood.motion, []
    for angle in np.linspace(0, np.pi, 9)[:-1]:
        n = np.array([np.cos(angle), np.sin(angle)])
        for off in (-0.0031, 0.0007, 0.0029):
            one, other = (m.x[i][:, 1:] @ n - off for i in (wood.rods.a[b.i], wood.rods.a[b.j]))
            crack = b.area[(one < 0) != (other < 0)].sum()
            found.append(crack / (chords(corners(params), n[None], np.array([off]))[0] * params.length))
    assert np.mean(found) == pytest.approx(1, abs=0.05)
    assert np.std(found) < 0.12


def test_rods_in_an_outline_have_its_area_and_moments():
    params = SOLVER.parse({"rods": 40, **PLANK})
    wood = lay(params, 4)
    points = wood.motion.x[wood.grid[:, 1]][:, 1:]
    own = np.pi * wood.rods.radius[np.searchsorted(wood.rod, np.arange(len(points)))] ** 2
    assert area(corners(params)) == pytest.approx(2e-4)
    assert own.sum() == pytest.approx(2e-4)
    assert own @ points == pytest.approx([0, 0], abs=1e-12)
    moments = own @ points**2 + (own**2).sum() / (4 * np.pi)
    assert moments == pytest.approx([0.02 * 0.01**3 / 12, 0.01 * 0.02**3 / 12], rel=0.01)
    line = chords(corners(params), np.array([[1.0, 0], [0, 1], [0.6, 0.8]]), np.array([0.002, 0.002, 0.0]))
    assert line == pytest.approx([0.02, 0.01, 0.0125])


@pytest.mark.parametrize("outline", [[(0, 0), (1e-2, 0)], [(0, 0), (1e-2, 0), (2e-2, 0)]])
def test_what_encloses_nothing_is_no_outline(outline):
    with pytest.raises(Exception, match="outline"):
        SOLVER.parse({"outline": outline})


def test_an_outline_does_not_cross_itself():
    with pytest.raises(Exception, match="crosses itself"):
        SOLVER.parse({"outline": [(0, 0), (3e-2, 1e-2), (0, 1e-2), (2e-2, 0), (1e-2, 2e-2)]})


def test_a_saw_cut_along_the_grain_breaks_the_bonds_that_it_passes():
    cut = {"low": (-1, -1, 0), "high": (0.06, 1, 0)}
    params = SOLVER.parse({"rods": 24, "vertices": 16, "cuts": [cut], "clamp": "none", **PLANK})
    wood = lay(params, 16)
    b, x = wood.bonds, wood.motion.x
    apart = (x[wood.rods.a[b.i], 2] > 0) != (x[wood.rods.a[b.j], 2] > 0)
    assert np.array_equal(b.on == 2, apart & (x[[wood.rods.a[b.i], wood.rods.b[b.i]], 0].mean(0) <= 0.06))
    assert np.array_equal(b.damage == 1, b.on == 2)
    assert 0.02 * len(b.i) < (b.on == 2).sum() < 0.2 * len(b.i)
    assert wood.rods.alive.all()


def test_a_saw_cut_across_the_grain_parts_the_rods_that_it_passes():
    cut = {"low": (0.06, -1, 0.001), "high": (0.062, 1, 1)}
    params = SOLVER.parse({"rods": 24, "vertices": 16, "cuts": [cut], "clamp": "none", **PLANK})
    whole = lay(params, 16)
    wood = sawed(whole.copied())
    passed = int((whole.motion.x[whole.grid[:, 0], 2] > 0.001).sum())
    parents = len(wood.motion.x) - len(whole.motion.x)
    # each at a vertex halfway through the cut, which is split
    assert parents == passed == int((wood.rods.whole == 0).sum())
    assert wood.rods.alive.all()
    assert wood.straight[wood.parent[-parents:], 0] == pytest.approx(np.full(parents, 0.061), abs=1e-15)
    assert wood.motion.mass.sum() == pytest.approx(whole.motion.mass.sum(), rel=1e-12)


@pytest.mark.parametrize("rods", [24, 96])
def test_a_plank_sawn_along_has_halves_of_the_beam_s_stiffness_and_a_crack_of_its_width(rods):
    """A b h and b h^3 / 12 of each half; rods that lay across the cut made them 1.26 times as stiff at 24."""
    cut = {"low": (0.1, -1, 0), "high": (1, 1, 0)}
    params = SOLVER.parse({"rods": rods, "vertices": 4, "cuts": [cut], **PLANK, **PLAIN})
    assert sawn_through(params) == [(1, 0.0)]
    wood = lay(params, 4)
    points = wood.motion.x[wood.grid[:, 1]][:, 1:]
    own = np.pi * wood.rods.radius[np.searchsorted(wood.rod, np.arange(len(points)))] ** 2
    for half in (points[:, 1] > 0, points[:, 1] < 0):
        z, a = points[half, 1], own[half]
        assert a.sum() == pytest.approx(1e-4, rel=1e-3)
        second = a @ (z - a @ z / a.sum()) ** 2 + (a**2).sum() / (4 * np.pi)
        assert second == pytest.approx(0.01 * 0.01**3 / 12, rel=0.06)
    b, x = wood.bonds, wood.motion.x
    apart = (x[wood.rods.a[b.i], 2] > 0) != (x[wood.rods.a[b.j], 2] > 0)
    assert b.area[apart].sum() == pytest.approx(0.01 * params.length, rel=1e-9)


def test_cuts_that_part_nothing_from_rim_to_rim_move_no_rods():
    aside = [{"low": (0, 0, 0), "high": (1, 1, 0)}, {"low": (0.1, 0, -1), "high": (0.1, 1, 0)}]
    assert sawn_through(SOLVER.parse({"cuts": aside, **PLANK})) == []


def test_strength_of_coarse_rods_is_what_their_edges_resolve():
    params = SOLVER.parse(PLANK)
    outline = corners(params)
    # t = 2 A / perimeter
    thick = 2 * 2e-4 / 0.06
    assert resolved(params, 1e-3, outline) == (4e6, 8e6)
    opens, slides = resolved(params, 0.005, outline)
    assert (10e9 * 250 * thick**3 / opens**2) ** 0.25 == pytest.approx(4 * 0.005)
    assert (10e9 * 700 * thick / slides**2) ** 0.5 == pytest.approx(5.5 * 0.005)
    assert resolved(params, 0.1, outline) == (1e6, 2e6)


def test_edges_that_feel_no_crack_are_named_before_any_work():
    """At the length named no bond is weaker than its floor, beyond it one would have to be; a run says so first."""
    params = SOLVER.parse(PLANK)
    outline, most = corners(params), longest_edge(SOLVER.parse(PLANK), corners(params))
    assert resolved(params, 0.99 * most, outline)[0] > 1e6
    assert 1e6 in resolved(params, 1.01 * most, outline)
    told = []
    for edges, said in ((math.ceil(params.length / most), False), (math.floor(params.length / most) - 1, True)):
        values = {**PLANK, "rods": 4, "vertices": edges + 1, "unevenness": 0.0}
        watch = Context(lambda _, message: told.append(message))
        found = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.0,), fields=("crack_area",)), watch)
        assert ("longer than" in found.attrs.get("note", "")) is said
        assert ("longer than" in told[0]) is said
        told.clear()
