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
    """At rest on a block, the bundle's weight; means between stages add up to the impulse."""
    block = {"shape": "box", "size": (0.3, 0.1, 0.01), "friction": 0.0}
    block["path"] = [{"time": 0, "position": (0.075, 0, -0.0152)}]
    values = {**BAR, "clamp": "none", "bodies": [block], "gravity": 9.81, "damping": 100.0}
    stages = (0.0, 0.1, 0.15, 0.2)
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=stages, fields=("body_force", "body_impulse")))
    force = found.body_force.values[:, 0]
    assert np.array_equal(force[0], np.zeros(3))
    assert force[-1] == pytest.approx([0, 0, -9.81 * 600 * np.pi * 1e-4 * 0.15], abs=0.02)
    sums = (force * np.diff([0.0, *stages])[:, None]).cumsum(0)
    assert sums == pytest.approx(found.body_impulse.values[:, 0], abs=1e-12)


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
