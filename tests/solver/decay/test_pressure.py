"""A painted pressure against its own words."""

import numpy as np
import pytest

from solver.decay import SOLVER
from solver.decay.body.flesh import Softened
from solver.decay.body.pressure import pressed
from solver.decay.body.solid import fill


def test_a_painted_pressure_fades_evenly_with_depth():
    """Painted all over a ball: full on the skin, half at half its depth, none below; flesh and stiffness alike."""
    ball = {"radii": (1.0,) * 8, "exocarp_thickness": 0.05, "stone": (0.0, 0.0), "flesh": {"gravity": 0}}
    paint = {"values": np.ones((8, 16)).tolist(), "length": 0.8, "stiffness": 3.0, "depth": 0.4}
    params = SOLVER.parse({**ball, "body": "quasi-static", "wounds": (), "pressure_map": paint})
    solid = fill(params, 6)
    one = np.ones(len(solid.tets))
    found = pressed(Softened(one, one, one), params, solid)
    radius = np.linalg.norm(solid.points, axis=1)
    share = np.interp(radius, [radius.max() - 0.4, radius.max()], [0, 1])[solid.tets].mean(axis=1)
    assert found.shrinkage == pytest.approx(0.8**share, rel=1e-9)
    assert found.young == pytest.approx(3.0**share, rel=1e-9)
    assert share.min() == 0
    assert share.max() > 0.6
