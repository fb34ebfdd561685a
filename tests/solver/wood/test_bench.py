"""What a test bench reads of a run: forces over ways, and the list of fragments."""

import numpy as np
import pytest

from solver.contract import Need
from solver.wood import SOLVER

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}
BAR = {"rods": 9, "vertices": 8, "length": 0.15, "radius": 0.01, **PLAIN}
END = {"low": (0.1499, -1, -1), "high": (0.1501, 1, 1)}


def test_force_over_way_is_the_bar_s_stiffness():
    """E A / L of a bar that a grip pulls; the grip's way is that of the middle of each interval."""
    path = [{"time": 0.0}, {"time": 0.004, "shift": (1e-5, 0, 0)}]
    fields = ("grip_force", "grip_shift", "grip_torque")
    stages = (0.0028, 0.0032, 0.0036, 0.004)
    values = {**BAR, "grips": [{**END, "path": path}], "damping": 2000.0}
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=stages, fields=fields, dtype="float64"))
    assert set(found.data_vars) >= set(fields)
    assert "grip_impulse" not in found
    force, way = found.grip_force.values[1:, 0, 0], found.grip_shift.values[1:, 0, 0]
    assert way == pytest.approx([0.75e-5, 0.85e-5, 0.95e-5])
    assert force / way == pytest.approx(np.full(3, 10e9 * np.pi * 1e-4 / 0.15), rel=0.04)
    assert np.abs(found.grip_torque.values).max() < 0.05 * force.max() * 0.01


def test_a_body_feels_what_the_rods_press_with():
    """At rest on a block, the bundle's weight, beside its middle; means between stages add up to the impulse."""
    block = {"shape": "box", "size": (0.3, 0.1, 0.01), "friction": 0.0}
    block["path"] = [{"time": 0, "position": (0.06, 0, -0.0152)}]
    values = {**BAR, "clamp": "none", "bodies": [block], "gravity": 9.81, "damping": 100.0}
    stages, fields = (0.0, 0.1, 0.15, 0.2), ("body_force", "body_impulse", "body_torque", "body_moment")
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=stages, fields=fields))
    weight = 9.81 * 600 * np.pi * 1e-4 * 0.15
    for mean, since, wanted in (
        (found.body_force, found.body_impulse, [0, 0, -weight]),
        (found.body_torque, found.body_moment, [0, 0.015 * weight, 0]),
    ):
        one = mean.values[:, 0]
        assert np.array_equal(one[0], np.zeros(3))
        # what still rocks on the block is a twentieth
        assert one[-1] == pytest.approx(wanted, abs=0.05 * np.abs(wanted).max())
        sums = (one * np.diff([0.0, *stages])[:, None]).cumsum(0)
        assert sums == pytest.approx(since.values[:, 0], abs=1e-12)


def test_forces_and_moments_of_a_loaded_beam_are_in_equilibrium():
    """Pressed off its middle on two supports: shares by the lever, no sum of forces, none of moments."""
    size, at = (0.01, 0.06, 0.0), np.array([[0.03, 0, -0.0048], [0.13, 0, -0.0048], [0.06, 0, 0.0046]])
    bodies = [{"shape": "cylinder", "size": size, "friction": 0.0, "path": [{"time": 0, "position": p}]} for p in at]
    values = {**BAR, "rods": 1, "vertices": 25, "clamp": "none", "bodies": bodies, "damping": 300.0, "radius": 0.005}
    values["mass_scaling"] = 100.0
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.1, 0.12), fields=("body_force", "body_torque")))
    force, torque = found.body_force.values[-1, :, :], found.body_torque.values[-1]
    top = force[2, 2]
    assert top > 1.0
    assert force[:2, 2] == pytest.approx([-0.7 * top, -0.3 * top], rel=0.02)
    assert np.abs(force.sum(0)).max() < 1e-3 * top
    assert np.abs((torque + np.cross(at, force)).sum(0)).max() < 1e-3 * top * 0.1
    # what presses without friction goes through the cylinder's axis
    assert np.abs(torque[:, 1]).max() < 1e-9 * top


def test_fragments_are_what_saw_cuts_leave():
    """Cut across at a third: two pieces of a third and two thirds of the mass, as long as that, where they lie."""
    cut = {"low": (0.05, -1, -1), "high": (0.05, 1, 1)}
    values = {**BAR, "rods": 20, "vertices": 16, "unevenness": 0.0, "clamp": "none", "cuts": [cut], "mass_scaling": 100}
    fields = ("fragments", "fragment_mass", "fragment_place", "fragment_length")
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.0,), fields=fields, dtype="float64"))
    assert found.fragments.values.tolist() == [2]
    whole = 600 * np.pi * 1e-4 * 0.15
    assert found.fragment_mass.values[0, :3] == pytest.approx([whole * 2 / 3, whole / 3, 0], rel=0.01)
    assert found.fragment_length.values[0, :2] == pytest.approx([0.1, 0.05], rel=0.03)
    assert found.fragment_place.values[0, :2, 0] == pytest.approx([0.1, 0.025], rel=0.02)
