"""Start shapes and what holds them, before any growth."""

import numpy as np
import pytest

from solver import shell
from solver.growth.fresh import fresh
from solver.growth.params import GrowthParams
from solver.growth.shapes import start


@pytest.mark.parametrize("axes", [("x", "y", "z"), ("z",)])
def test_held_vertices_start_where_the_perfect_shape_has_them(axes):
    """Along the axes that are held; all else is off by the imperfection."""
    held = {"where": {"kind": "band", "along": "x", "low": 0.0, "high": 0.6}, "axes": axes}
    params = GrowthParams.parse({"shape": "sphere", "attached": [held], "imperfection": 0.2})
    mesh = start(params.shape, 300, params.aspect)
    state = fresh(params, mesh)
    assert 0 < state.held.any(axis=1).sum() < len(mesh.x)
    assert np.array_equal(state.x[state.held], mesh.x[state.held])
    off = (state.x - mesh.x)[~state.held.any(axis=1)]
    assert (np.abs(off).max(axis=1) > 0).all()
    # normally distributed along the normals, with the imperfection's share of the thickness as deviation
    assert np.sqrt(np.square(off).sum(axis=1).mean()) == pytest.approx(0.2 * params.thickness, rel=0.2)


@pytest.mark.parametrize("vertices", [300, 2000])
@pytest.mark.parametrize("shape", ["sphere", "disc", "half_disc", "strip", "square", "tube"])
def test_a_start_has_about_as_many_vertices_as_asked_for(shape, vertices):
    mesh = start(shape, vertices, 3.0)
    assert len(mesh.x) == pytest.approx(vertices, rel=0.25)
    assert np.array_equal(np.unique(mesh.triangles), np.arange(len(mesh.x)))
    area = shell.areas(shell.metric(mesh.x, mesh.triangles)).sum()
    exact = {"sphere": 4 * np.pi, "disc": np.pi, "half_disc": np.pi / 2, "strip": 3, "square": 1, "tube": 6 * np.pi}
    assert area == pytest.approx(exact[shape], rel=0.05)
