"""Stress and strain of rods and bonds, against beams and blocks that are strained evenly."""

import numpy as np
import pytest

from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.model.bundle import lay
from solver.wood.stepping.moment import begin
from solver.wood.stresses import BOND, ROD, Stresses

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}, "unevenness": 0.0}
LENGTH, RADIUS, E = 0.1, 0.002, 10e9
AREA, SECOND = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4


def at_rest(load):
    """Return strain and stress of a single clamped rod's edges."""
    values = {"rods": 1, "vertices": 81, "length": LENGTH, "radius": RADIUS, "tip_load": load, "mode": "static"}
    found = SOLVER.solve(SOLVER.parse({**values, **PLAIN}), Need(stages=(1.0,), fields=ROD))
    assert found.rod_stress.attrs["units"] == "Pa"
    return found.rod_strain.values[0], found.rod_stress.values[0]


def test_a_drawn_rod_has_force_over_area():
    strain, stress = at_rest((50.0, 0.0, 0.0))
    assert strain == pytest.approx(50 / (E * AREA), rel=1e-6)
    assert stress == pytest.approx(50 / AREA, rel=1e-6)


def test_a_bent_rod_has_moment_times_radius_over_its_second_moment():
    """Of the two joints of an edge the one nearer to the clamp: half an edge behind, at the clamp itself."""
    stress = at_rest((0.0, 0.0, -0.05))[1]
    edge = LENGTH / 80
    arm = LENGTH - np.arange(80) * edge
    assert stress == pytest.approx(0.05 * arm * RADIUS / SECOND, abs=0.006 * 0.05 * LENGTH * RADIUS / SECOND)


@pytest.fixture
def bundle():
    params = SOLVER.parse({"rods": 30, "vertices": 9, "transverse": 0.4e9, "shear": 0.8e9, **PLAIN})
    wood = lay(params, 9)
    x = wood.motion.x
    way = x[wood.rods.a[wood.bonds.i]] - x[wood.rods.a[wood.bonds.j]]
    up = way[:, 2] / np.hypot(way[:, 1], way[:, 2])
    return begin(wood), Stresses(params, wood, Need(stages=(0.0,), fields=(*ROD, *BOND))), up


def test_what_is_drawn_out_across_bears_its_modulus_times_the_strain(bundle):
    state, reader, up = bundle
    state.wood.motion.x[:, 2] *= 1 + 1e-5
    found = reader.read(state)
    assert found["bond_tension"] == pytest.approx(0.4e9 * 1e-5 * up**2, rel=1e-4, abs=1.0)
    assert found["bond_shear"] == pytest.approx(0, abs=1e-3)
    assert not found["bond_damage"].any()


def test_what_is_sheared_along_bears_the_shear_modulus_times_the_slope(bundle):
    state, reader, up = bundle
    m = state.wood.motion
    m.x[:, 0] += 1e-5 * m.x[:, 2]
    found = reader.read(state)
    assert found["bond_shear"] == pytest.approx(0.8e9 * 1e-5 * np.abs(up), rel=1e-4, abs=1.0)


def test_what_is_broken_bears_pressure_alone(bundle):
    state, reader, up = bundle
    bonds = state.wood.bonds
    bonds.damage[:] = 1.0
    bonds.on[:] = 2
    bonds.on[::2] = 0
    for sign in (1, -1):
        state.wood.motion.x[:, 2] *= 1 + sign * 1e-5
        found = reader.read(state)["bond_tension"]
        state.wood.motion.x[:, 2] /= 1 + sign * 1e-5
        wanted = np.where(np.arange(len(up)) % 2 == 0, 0.0, min(sign, 0) * 0.4e9 * 1e-5 * up**2)
        assert found == pytest.approx(wanted, rel=1e-4, abs=1.0)


def test_stages_have_all_of_them_and_what_is_cut_bears_nothing():
    values = {"rods": 9, "vertices": 13, "length": 0.06, "radius": 0.004, "clamp": "both", "pull": (5.0, 0, 0)}
    params = SOLVER.parse({**values, "strain_limit": 2e-3})
    found = SOLVER.solve(params, Need(stages=(1e-5, 4e-4), fields=("rod_cut", *ROD, *BOND)))
    assert found.rod_stress.dims == found.rod_cut.dims
    assert found.bond_position.dims == ("stage", "bond", "component")
    cut = found.rod_cut.values[-1] >= 0
    assert cut.any()
    assert not found.rod_strain.values[-1][cut].any()
    assert not found.rod_stress.values[-1][cut].any()
    # before it breaks, what is drawn evenly
    assert found.rod_strain.values[0] == pytest.approx(5e-5 / 0.06, rel=0.1)
    assert (found.bond_damage.values[-1] >= found.bond_damage.values[0]).all()
