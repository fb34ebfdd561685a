"""Start shapes: as many vertices as asked for, even triangles that face outwards, the area that they should have."""

import numpy as np
import pytest

from solver import shell
from solver.geometry.crossings import crossings
from solver.growth.shapes import start

PI = np.pi
#: Area, and number of borders' loops (Euler's number 2 - 2 genus - loops) for an aspect of 2.
SHAPES = {
    "triangle": (1.0, 1),
    "stem": (4 * PI + 2 * PI, 1),
    "capsule": (4 * PI + 4 * PI, 2),
    "cone": (PI * 5**0.5, 1),
    "torus": (4 * PI**2 / 2, 0),
    "sphere": (4 * PI, 2),
    "tube": (4 * PI, 0),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("count", [150, 900])
def test_a_start_shape_is_what_it_says(shape, count):
    mesh = start(shape, count, 2.0)
    top = shell.topology(mesh.triangles, len(mesh.x))
    area, euler = SHAPES[shape]
    g = shell.metric(mesh.x, mesh.triangles)
    assert 0.8 * count <= len(mesh.x) <= 1.25 * count
    # flat triangles cut curves: by h^2 / 8 of their radius
    assert shell.areas(g).sum() == pytest.approx(area, rel=0.1 if count < 500 else 0.02)
    assert len(mesh.x) - len(top.edges) + len(mesh.triangles) == euler
    assert not crossings(mesh.x, mesh.triangles).count
    p = mesh.x[mesh.triangles]
    sides = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=-1)
    assert np.median(shell.areas(g)) > 0.7 * np.sqrt(3) / 4 * np.median(sides) ** 2
    assert (shell.areas(g) > 0.05 * sides.max(axis=1) ** 2).all()
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    if shape == "triangle":
        assert (normal[:, 2] > 0).all()
    else:
        middle = p.mean(axis=1)
        # out of the axis, or of the circle within the torus' tube
        core = middle * [1, 1, 0] / np.linalg.norm(middle[:, :2], axis=1, keepdims=True) if shape == "torus" else None
        out = middle - core if core is not None else middle
        if shape in ("stem", "cone", "tube"):
            out = out * [1, 1, 0] + [0, 0, 1e-3]
        assert ((normal * out).sum(axis=1) > 0).all()
