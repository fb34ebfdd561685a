"""Grips: on their paths, with the force that a beam's formula has, and every joule booked."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from solver.contract import InvalidGeometry, InvalidInput, Need
from solver.wood import SOLVER
from solver.wood.model.bundle import lay

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}
BAR = {"rods": 9, "vertices": 8, "length": 0.15, "radius": 0.01, "clamp": "start", **PLAIN}
END = {"low": (0.1499, -1, -1), "high": (0.1501, 1, 1)}
SUMS = ("grip_impulse", "grip_moment", "work", "elastic_energy", "kinetic_energy")
FIELDS = (*SUMS, "grip_torque", "grip_turn", "rod_position")


def run(values, *stages):
    return SOLVER.solve(SOLVER.parse(values), Need(stages=stages, fields=FIELDS, dtype="float64"))


def test_a_bar_pulled_by_a_grip_bears_e_times_strain():
    path = [{"time": 0.0}, {"time": 0.004, "shift": (1e-5, 0, 0)}]
    found = run({**BAR, "grips": [{**END, "path": path}], "damping": 2000.0}, 0.0036, 0.004)
    force = np.diff(found.grip_impulse.values[:, 0], axis=0)[0] / 0.0004
    # in the middle of the interval
    assert force[0] == pytest.approx(10e9 * np.pi * 1e-4 * 0.95e-5 / 0.15, rel=0.03)
    assert np.abs(force[1:]).max() < 0.01 * force[0]
    assert found.residual.values.max() < 1e-3


def test_a_grip_that_turns_takes_its_end_along_and_needs_a_moment():
    turn = np.array([0.02, 0.0, 0.0])
    path = [{"time": 0.0}, {"time": 0.003, "turn": tuple(turn)}]
    values = {**BAR, "grips": [{**END, "path": path}], "damping": 1000.0}
    found, wood = run(values, 0.0025, 0.003), lay(SOLVER.parse(values), 8)
    course = wood.grips[0]
    there = course.pivot + Rotation.from_rotvec(turn).apply(course.rest - course.pivot)
    ends = found.rod_position.values[-1, :, 1]
    last = ends[np.argsort(ends[:, 0])[-len(there) :]]
    gap = np.linalg.norm(last[:, None] - there[None], axis=-1).min(0)
    assert gap.max() < 1e-9
    moment = np.diff(found.grip_moment.values[:, 0], axis=0)[0]
    assert moment[0] > 0
    assert np.abs(moment[1:]).max() < 0.2 * moment[0]
    # what stands beside the mean moment is the mean turn of the same time
    assert found.grip_turn.values[:, 0] == pytest.approx(np.outer([0.5 * 0.0025 / 0.003, 2.75 / 3], turn))
    assert found.grip_torque.values[1, 0] == pytest.approx(moment / 0.0005)
    assert found.residual.values.max() < 1e-3


def test_what_grips_put_in_is_booked_at_a_jump_of_their_speed():
    path = [{"time": 0.0}, {"time": 2e-4, "shift": (0, 0, 1e-4)}, {"time": 4e-4, "shift": (0, 0, -1e-4)}]
    found = run({**BAR, "grips": [{**END, "path": path, "holds": "z"}]}, 2e-4, 4e-4, 8e-4)
    assert found.residual.values.max() < 2e-3
    assert found.work.values.max() > 0


def test_a_grip_in_the_air_and_one_too_many_are_refused():
    with pytest.raises(InvalidGeometry, match="holds no vertex"):
        lay(SOLVER.parse({**BAR, "grips": [{"low": (1, 1, 1), "high": (2, 2, 2)}]}), 8)
    with pytest.raises(InvalidGeometry, match="what others hold"):
        lay(SOLVER.parse({**BAR, "grips": [END, END]}), 8)
    with pytest.raises(InvalidInput, match="low"):
        SOLVER.parse({**BAR, "grips": [{"low": (1, 1, 1), "high": (0, 2, 2)}]})
    with pytest.raises(InvalidInput, match="no grips"):
        SOLVER.parse({**BAR, "mode": "static", "grips": [END]})
