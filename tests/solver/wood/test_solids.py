"""Bodies in meshes, against trimesh; presets' own stages."""

import numpy as np
import pytest
import trimesh

from solver.meshes import Frame
from solver.wood import SOLVER, Body, WoodParams
from solver.wood.looks import LOOKS
from solver.wood.presets import PRESETS, STAGES
from solver.wood.surface.solids import among, solid

PATH = [{"time": 0.5, "position": (1.0, 2.0, 3.0)}, {"time": 1.5, "position": (1.0, 2.0, 5.0)}]


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize(("shape", "size"), [("box", (0.1, 0.2, 0.3)), ("cylinder", (0.1, 0.3, 0.0))])
def test_a_body_is_closed_and_as_large_as_it_should_be(shape, size, axis):
    points, faces = solid(Body(shape=shape, size=size, axis=axis, path=PATH), 1.0)
    found = trimesh.Trimesh(points, faces)
    found.merge_vertices()
    assert found.is_watertight
    assert found.is_winding_consistent
    # positive only if its triangles look outwards
    if shape == "box":
        assert found.volume == pytest.approx(0.006, rel=1e-9)
        wanted = np.array(size)
    else:
        assert found.volume == pytest.approx(np.pi * 0.05**2 * 0.3, rel=5e-3)
        wanted = np.where(np.arange(3) == "xyz".index(axis), 0.3, 0.1)
    assert found.extents == pytest.approx(wanted, rel=1e-9)
    assert found.centroid == pytest.approx([1.0, 2.0, 4.0], abs=1e-9)


@pytest.mark.parametrize(("time", "height"), [(0.0, 3.0), (0.5, 3.0), (0.75, 3.5), (1.5, 5.0), (9.0, 5.0)])
def test_a_body_is_on_its_path_and_rests_before_and_after(time, height):
    points, _ = solid(Body(size=(0.1, 0.1, 0.1), path=PATH), time)
    assert points.mean(0) == pytest.approx([1.0, 2.0, height])


def test_a_mesh_is_drawn_with_sharp_edges_and_smooth_sides():
    """A cylinder: its wall is one sheet, its ends are others; of a box every face is."""
    for made, sheets, vertices in (
        (trimesh.creation.cylinder(0.02, 0.1, sections=24), 3, 4 * 24 + 2),
        (trimesh.creation.box((0.1, 0.2, 0.3)), 6, 24),
    ):
        mesh = {"points": made.vertices.tolist(), "faces": made.faces.tolist()}
        points, faces = solid(Body(shape="mesh", mesh=mesh, path=PATH), 0.0)
        drawn = trimesh.Trimesh(points, faces, process=False)
        assert len(points) == vertices
        assert drawn.body_count == sheets
        assert drawn.volume == pytest.approx(made.volume)
        assert points.mean(0) == pytest.approx([1.0, 2.0, 3.0])


def test_bodies_follow_the_wood_and_are_told_apart():
    wood = Frame(np.eye(3), np.array([[0, 1, 2]], np.int32), {"inside": np.array([0.0, 1.0, 0.0])})
    body = {"size": (0.1, 0.1, 0.1), "path": PATH}
    params = SOLVER.parse({"bodies": [body, {**body, "shape": "cylinder", "size": (0.1, 0.2, 0.0)}]})
    assert isinstance(params, WoodParams)
    found = among(wood, params, 0.0)
    assert found.triangles.dtype == np.int32
    assert np.array_equal(found.triangles[0], [0, 1, 2])
    assert found.triangles[1:].min() == 3
    assert found.triangles.max() == len(found.vertices) - 1
    assert np.array_equal(np.flatnonzero(found.fields["body"] == 0), [0, 1, 2])
    assert len(found.fields["inside"]) == len(found.vertices)
    skin = LOOKS.paint(found.fields, {})
    assert skin is not None
    assert np.ptp(skin.colour[3:], axis=0).max() == 0
    assert np.abs(skin.colour[3] - skin.colour[[0, 1]]).max(1).min() > 0.1
    # a result without the field looks as before
    old = LOOKS.paint({"inside": found.fields["inside"]}, {})
    assert old is not None
    assert np.array_equal(old.colour[:3], skin.colour[:3])


def test_every_preset_has_stages_of_its_own_that_reach_its_event():
    assert set(STAGES) == set(PRESETS)
    for name, values in PRESETS.items():
        stages = np.array(STAGES[name])
        assert (np.diff(stages) > 0).all()
        assert stages[-1] <= SOLVER.stages.highest
        for body in values.get("bodies", ()):
            # a body that moves has come to its end
            assert stages[-1] >= body["path"][-1]["time"] - 1e-12 or len(body["path"]) == 1
