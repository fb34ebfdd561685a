"""Meshes of one's own: taken as they are where they are a surface, else refused with what to change."""

import numpy as np
import pytest

from solver import shell
from solver.contract import Context, InvalidInput, Need
from solver.growth import SOLVER
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.shapes import start

SPOT = {"kind": "spot", "at": (0.0, 0.0, 1.0), "radius": 0.6, "stretch": (1.5, 1.5)}


def words(points, faces) -> dict:
    return {"mesh": {"points": np.asarray(points).tolist(), "faces": np.asarray(faces).tolist()}}


def test_a_mesh_grows_as_the_shape_that_it_was_taken_from():
    """The same bytes, with a point that no triangle has left out."""
    mesh = start("sphere", 162, 1.0)
    own = words(np.concatenate([[[9.0, 9.0, 9.0]], mesh.x]), mesh.triangles + 1)
    common = {"tools": [SPOT], "step": 0.25, "thickness": 0.05}
    found = [Engine(GrowthParams.parse(common | extra), 162).reach(0.5, Context()).x for extra in ({}, own)]
    assert np.array_equal(*found)
    run = SOLVER.solve(GrowthParams.parse(common | own), Need.parse({"stages": [0.25], "fields": ["mesh_position"]}))
    assert np.isfinite(run["mesh_position"].values).all()
    assert run.sizes["vertex"] >= 162


def test_open_and_closed_meshes_are_taken():
    for shape in ("torus", "cone", "triangle"):
        mesh = start(shape, 120, 2.0)
        engine = Engine(GrowthParams.parse(words(mesh.x, mesh.triangles)), 7)
        assert len(engine.state.x) == len(mesh.x), "quality has no say"
        assert shell.areas(engine.state.g).sum() == pytest.approx(
            shell.areas(shell.metric(mesh.x, mesh.triangles)).sum()
        )


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("points", "faces", "said"),
    [
        ([*SQUARE, [0.5, 0, 1]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]], "three or more triangles"),
        (SQUARE, [[0, 1, 2], [0, 3, 2], [0, 1, 3]][:2], "Orient the mesh"),
        (SQUARE, [[0, 1, 1]], "Remove collapsed"),
        (SQUARE, [[0, 1, 4]], "not there"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], "no area"),
        ([*SQUARE, [2, 1, 0], [2, 2, 0]], [[0, 1, 2], [2, 4, 5]], "Split them"),
    ],
    ids=["non-manifold", "turned", "collapsed", "missing", "flat", "pinched"],
)
def test_what_is_no_surface_is_refused(points, faces, said):
    with pytest.raises(InvalidInput) as caught:
        GrowthParams.parse(words(points, faces))
    assert said in str(caught.value)


def test_a_pinch_of_two_closed_bodies_is_found():
    one = start("sphere", 42, 1.0)
    top = int(np.argmax(one.x[:, 2]))
    # the second, mirrored through the top of the first, shares that point alone
    x = np.concatenate([one.x, 2 * one.x[top] - one.x])
    faces = np.concatenate([one.triangles, one.triangles[:, ::-1] + len(one.x)])
    faces[faces == top + len(one.x)] = top
    with pytest.raises(InvalidInput, match="1 vertices hold parts together"):
        GrowthParams.parse(words(x, faces))
