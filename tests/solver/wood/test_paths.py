"""Paths of bodies against NumPy's interpolation."""

import numpy as np
import pytest

from solver.wood import SOLVER
from solver.wood.contact.posing import pose
from solver.wood.model.bundle import lay
from solver.wood.model.state import scratch_for


@pytest.mark.parametrize("time", [-1.0, 0.5, 1.0, 1.3, 3.0, 4.9, 5.0, 9.0])
def test_bodies_go_straight_from_place_to_place(time):
    """Piece after piece, and at rest before and after: `numpy.interp`, and its differences."""
    times = [0.5, 1.5, 2.0, 5.0]
    places = np.random.default_rng(3).normal(0, 0.1, (4, 3))
    path = [{"time": t, "position": tuple(p)} for t, p in zip(times, places, strict=True)]
    rods = {"rods": 2, "vertices": 4, "length": 0.1, "radius": 0.004}
    wood = lay(SOLVER.parse({**rods, "bodies": [{"size": (0.01, 0.01, 0.01), "path": path}]}), 4)
    poses = scratch_for(wood).poses
    pose(wood.bodies, time, poses)

    def at(moment: float) -> np.ndarray:
        return np.array([np.interp(moment, times, places[:, c]) for c in range(3)])

    assert poses.centre[0] == pytest.approx(at(time), abs=1e-15)
    if time not in times:
        assert poses.speed[0] == pytest.approx((at(time + 1e-3) - at(time - 1e-3)) / 2e-3, abs=1e-12)
