"""Meshes of the user's own as the surface: the fruit's own mesh gives the same rot, patches and bad triangles hold."""

import numpy as np
import pytest

from solver.contract import InvalidGeometry, InvalidInput, Need
from solver.decay import SOLVER, DecayParams
from solver.decay.surfaces.imported import Mesh, extent_of, rays_from
from solver.decay.surfaces.surface import geodesic, lay, triangulated

QUICK = {"climate": "paper", "growth_rate": 100.0, "spawning": 0.0, "rot_spawning": 0.0}


def mesh(points: np.ndarray, faces: np.ndarray) -> dict:
    return {"points": points.tolist(), "faces": faces.tolist()}


def patch() -> tuple[np.ndarray, np.ndarray]:
    """Return the part of a sphere of radius 1.04 about (3, 0, 0) that lies beyond x = 3.4."""
    points, faces = geodesic(16)
    kept = faces[(points[faces][..., 0] > 0.4).all(axis=1)]
    used, faces = np.unique(kept, return_inverse=True)
    return 1.04 * points[used] + [3.0, 0, 0], faces.reshape(-1, 3)


def grown(given: dict, fields=("rot", "mould", "rotten_share", "budget_error"), stages=(2.0,), **values):
    return SOLVER.solve(
        SOLVER.parse({**QUICK, "mesh": given, **values}), Need(fields=fields, stages=stages, quality="preview")
    )


def test_the_fruit_s_own_mesh_rots_as_the_fruit():
    fresh = lay(DecayParams(), 32)
    fields = ("rot", "mould", "rotten_share", "mean_mould", "water_lost", "volume", "mesh_position", "triangle")
    own = grown(mesh(fresh.points, fresh.faces), fields)
    fruit = SOLVER.solve(SOLVER.parse(QUICK), Need(fields=fields, stages=(2.0,), quality="preview"))
    assert own.rot.dims == ("stage", "vertex")
    for name in ("rotten_share", "mean_mould", "water_lost", "volume"):
        assert float(own[name][0]) == pytest.approx(float(fruit[name][0]), rel=2e-3), name
    assert own.mesh_position[0].values == pytest.approx(fresh.points, abs=1e-6)
    assert np.array_equal(own.triangle.values, fresh.faces)


def test_a_position_is_that_of_the_mesh():
    points, faces = patch()
    run = grown(mesh(points, faces), ("position", "rot"))
    assert set(run.data_vars) >= {"mesh_position", "triangle", "rot"}
    assert "position" not in run
    assert run.mesh_position[0].values == pytest.approx(points, abs=1e-6)


def test_an_open_patch_rots_from_a_vertex_and_keeps_the_budget():
    points, faces = patch()
    run = grown(mesh(points, faces), wounds=[{"vertex": 7}])
    rot = run.rot[0].values
    assert float(run.budget_error[0]) < 1e-12
    assert 0 < float(run.rotten_share[0]) < 0.9
    near = np.linalg.norm(points - points[7], axis=1)
    assert rot[near < 0.1].min() > 0.1 > rot[near > 1.2].max()


def test_a_patch_is_seen_from_the_centre_of_its_sphere():
    points, _ = patch()
    assert rays_from(points) == pytest.approx((points - [3, 0, 0]) / 1.04, abs=1e-9)
    flat = np.array([[x, 0.0, z] for x in range(3) for z in range(3)], float)
    assert np.linalg.norm(rays_from(flat), axis=1) == pytest.approx(np.ones(9))


def test_slivers_and_an_inverted_mesh_stay_finite_and_in_budget():
    points, faces = geodesic(12)
    squeezed = points * [1.0, 0.03, 1.0]
    for wound in (faces, faces[:, ::-1]):
        run = grown(mesh(squeezed, wound), ("rot", "mould", "budget_error", "volume"))
        assert float(run.budget_error[0]) < 1e-12
        assert 0 <= float(run.rot.min()) < float(run.rot.max()) <= 1
        assert float(run.volume[0]) == pytest.approx(4 / 3 * np.pi * 0.03, rel=0.03)


def test_area_and_volume_of_a_box():
    corners = np.array([[x, y, z] for x in (0.0, 2) for y in (0.0, 3) for z in (0.0, 4)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    assert extent_of(triangulated(corners, faces)) == pytest.approx((52.0, 24.0))
    assert extent_of(triangulated(corners, faces[:-1])) is None


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"body": "table"}, "knows no imported mesh"),
        ({"seeds": "contacts"}, "neither stem nor floor"),
        ({"wounds": [{"vertex": 10**6}]}, "vertices 0 to"),
        ({"mesh": {"points": [[0, 0, 0]] * 3, "faces": [[0, 1, 3]]}}, "not there"),
        ({"mesh": None, "wounds": [{"vertex": 0}]}, "only an imported mesh"),
        ({"wounds": [{"vertex": 0, "position": [1, 0, 0]}]}, "not both"),
    ],
)
def test_what_does_not_fit_a_mesh_is_refused(values, said):
    with pytest.raises(InvalidInput, match=said):
        SOLVER.parse({"mesh": mesh(*patch()), **values})


def test_what_a_mesh_does_not_have_is_refused():
    points, faces = patch()
    with pytest.raises(InvalidInput, match="no lattice"):
        grown(mesh(points, faces), ("displacement",))
    with pytest.raises(InvalidInput, match="open mesh has no volume"):
        grown(mesh(points, faces), ("volume",))
    with pytest.raises(InvalidGeometry, match="no triangle of positive area"):
        grown(mesh(np.concatenate([points, [[9.0, 9, 9]]]), faces))
    assert Mesh.model_validate(mesh(points, faces)).faces[0] == tuple(faces[0])


def test_a_file_name_in_place_of_a_mesh_is_told_how_to_be_read():
    with pytest.raises(InvalidInput, match="mesh=@FILE"):
        SOLVER.parse({"mesh": "fruit.obj"})


def test_known_names_are_said_once_and_never_for_a_group():
    with pytest.raises(InvalidInput) as all_strange:
        SOLVER.parse({"qqqq": 1, "xxxx": 2})
    assert str(all_strange.value).count("known:") == 1
    with pytest.raises(InvalidInput) as nested:
        SOLVER.parse({"neighbours": [{"centre": [0, 0, 3], "radius": 1}]})
    assert "did you mean" not in str(nested.value)
