"""Flesh in meshes of one's own: tetrahedra that are whole, near the surface, and move as a fruit's do."""

import numpy as np
import pytest
import trimesh

from solver.contract import InvalidGeometry, InvalidInput, Need
from solver.decay import SOLVER, DecayParams
from solver.decay.body import embedded
from solver.decay.body.rind import rind
from solver.decay.body.solid import volumes
from solver.decay.fields.skin import laid
from solver.decay.surfaces.surface import lay
from solver.geometry.inside import inside
from solver.geometry.nearest import nearest
from solver.geometry.stuffing import boundary, pieces, stuffed, touched

BODY = ("mesh_position", "triangle", "volume", "density", "mass", "water_lost", "least_jacobian")
STILL = {"rot_collapse": 0.0, "rot_softness": 0.0, "rot_respired": 0.0}


def given(mesh: trimesh.Trimesh) -> dict:
    return {"points": np.asarray(mesh.vertices).tolist(), "faces": np.asarray(mesh.faces).tolist()}


def torus(around: int = 48, across: int = 24) -> trimesh.Trimesh:
    """A ring of tube 0.4 that lies on the floor."""
    found = trimesh.creation.torus(1, 0.4, major_sections=around, minor_sections=across)
    found.vertices = found.vertices[:, [0, 2, 1]] * [1, 1, -1]
    return found


def bent() -> trimesh.Trimesh:
    """A banana: a tapering tube along an arc, closed at both ends."""
    found = trimesh.creation.icosphere(subdivisions=4)
    x, y, z = np.asarray(found.vertices).T
    along, thick = 1.2 * x, 0.45 * (0.35 + 0.65 * np.sqrt(np.maximum(1 - x**4, 0)))
    found.vertices = np.stack(
        [(1.5 + thick * y) * np.sin(along), (1.5 + thick * y) * -np.cos(along), -thick * z], axis=1
    )
    return found


def cap(subdivisions: int = 3) -> trimesh.Trimesh:
    """An open half of a ball of radius 1."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    return ball.submesh([ball.triangles_center[:, 1] < 0.02], append=True)


def lay_of(mesh: trimesh.Trimesh):
    return laid(SOLVER.parse({"mesh": given(mesh)}, preset="apple"), 12)


def run(mesh: trimesh.Trimesh, stages=(0.0, 10.0), fields=BODY, **values):
    params = SOLVER.parse({"mesh": given(mesh), "body": "quasi-static", **values}, preset="apple")
    return SOLVER.solve(params, Need(fields=fields, stages=stages, quality="preview"))


@pytest.mark.parametrize(("mesh", "euler"), [(torus(96, 48), 0), (bent(), 2), (trimesh.creation.box(), 2)])
def test_flesh_is_whole_and_of_second_order(mesh: trimesh.Trimesh, euler: int) -> None:
    points, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    errors, size = [], float(mesh.volume ** (1 / 3))
    for edge in (0.16, 0.08):
        found = stuffed(points, faces, edge * size)
        own = volumes(found.points, found.tets)
        outside = trimesh.Trimesh(found.points, boundary(found.tets), process=False)
        assert own.min() > 0.02 * own.mean()  # no sliver
        assert outside.is_watertight
        assert outside.is_winding_consistent
        assert outside.euler_number == euler
        assert outside.volume == pytest.approx(own.sum())
        assert pieces(found.tets, len(found.points))[0] == 1
        errors.append(abs(own.sum() / mesh.volume - 1))
    assert errors[1] < 0.012
    assert errors[0] / errors[1] > 2.5


def test_what_is_inside_does_not_hang_on_winding_or_overlaps() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    points, faces = np.asarray(ball.vertices, float), np.asarray(ball.faces, np.int64)
    nodes = np.stack(np.meshgrid(*[np.linspace(-1.6, 1.6, 17)] * 3, indexing="ij"), axis=-1)
    far = np.linalg.norm(nodes, axis=-1)
    low, step = np.full(3, -1.6), 0.2
    for wound in (faces, faces[:, ::-1]):
        found = inside(low, step, (17, 17, 17), points, np.ascontiguousarray(wound))
        assert found[far < 0.97].all()
        assert not found[far > 1.001].any()
    two = np.concatenate([points, points + np.array([0.5, 0, 0])])
    found = inside(low, step, (17, 17, 17), two, np.concatenate([faces, faces + len(points)]))
    assert found[(far < 0.97) | (np.linalg.norm(nodes - [0.5, 0, 0], axis=-1) < 0.97)].all()


def test_nearest_is_what_trying_all_triangles_finds() -> None:
    rng = np.random.default_rng(2)
    mesh = torus(20, 10)
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    points = rng.uniform(-1.5, 1.5, (40, 3))
    found = nearest(points, vertices, faces)
    for point, face, shares, far in zip(points, *found, strict=True):
        places = trimesh.triangles.closest_point(vertices[faces], np.repeat(point[None], len(faces), axis=0))
        assert far == pytest.approx(np.linalg.norm(places - point, axis=1).min(), abs=1e-12)
        assert np.linalg.norm(shares @ vertices[faces[face]] - point) == pytest.approx(far, abs=1e-12)


def test_a_floating_ring_shrinks_evenly_and_keeps_its_water_books() -> None:
    found = run(torus(32, 16), flesh={**STILL, "gravity": 0.0}, wounds=[])
    fresh, dry = found.mesh_position.values.astype(float)
    share = float(found.water_lost[1])
    assert share > 0.01
    assert float(found.mass[1]) == pytest.approx(1 - share, abs=1e-9)
    scale = (1 - share) ** (1 / 3)
    middle = fresh.mean(axis=0)
    assert np.abs(dry - dry.mean(axis=0) - scale * (fresh - middle)).max() < 1e-5
    assert float(found.density[1]) == pytest.approx(1.0, abs=1e-4)


def test_the_fruit_s_own_mesh_settles_as_the_fruit_does() -> None:
    fresh = lay(DecayParams.model_validate({"stone": (0, 0)}), 24)
    soft = {"stone": (0, 0), "firmness": 4.0, "wounds": [], "humidity": 20.0}
    own = run(trimesh.Trimesh(fresh.points, fresh.faces, process=False), (15.0,), **soft)
    own_skin = {"radii": (1.0,) * 8, "exocarp_thickness": 0.04}
    params = SOLVER.parse({"body": "quasi-static", **own_skin, **soft}, preset="apple")
    fruit = SOLVER.solve(params, Need(fields=BODY, stages=(15.0,), quality="preview"))
    for name in ("volume", "mass", "water_lost", "density"):
        assert float(own[name][0]) == pytest.approx(float(fruit[name][0]), rel=0.01), name
    heights = [np.ptp(x.mesh_position[0].values[:, 1]) for x in (own, fruit)]
    assert heights[0] == pytest.approx(heights[1], rel=0.02)


def test_a_rotten_banana_rests_on_its_floor() -> None:
    mesh = bent()
    found = run(mesh, (0.0, 12.0), wounds=[{"vertex": 5}])
    fresh, rotten = found.mesh_position.values
    assert np.abs(fresh - mesh.vertices).max() < 0.02  # its ends sag: as a beam of that length and thickness 0.005
    assert rotten[:, 1].min() > float(np.asarray(mesh.vertices)[:, 1].min()) - 1e-3
    assert np.abs(rotten - fresh).max() > 0.05
    assert float(found.least_jacobian.min()) > 0
    assert 0.8 < float(found.density[1]) < 1.15
    assert np.array_equal(found.triangle.values, mesh.faces)


def test_flesh_reaches_as_low_as_its_mesh() -> None:
    """Points of the flesh lie within the mesh: what rests on the floor is what they stand for."""
    params = SOLVER.parse({"mesh": given(bent()), "body": "quasi-static"}, preset="apple")
    surface = laid(params, 12)
    flesh = embedded.Embedded(params, surface, 3)
    lowest = surface.points[:, 1].min()
    assert flesh.solid.points[:, 1].min() > lowest + 1e-4
    assert (flesh.solid.points[:, 1] + flesh.hanging).min() == pytest.approx(lowest, abs=1e-12)


def test_what_cannot_hold_flesh_says_so_and_where(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embedded, "_MOST", 10_000)
    turned = cap()
    turned.faces[7] = turned.faces[7][::-1]
    with pytest.raises(InvalidGeometry, match=r"wound opposite ways at \("):
        run(turned)
    fin = cap()
    a, b = fin.faces[7][:2]
    fin = trimesh.Trimesh(np.vstack([fin.vertices, [[0, 2, 0]]]), np.vstack([fin.faces, [[a, b, len(fin.vertices)]]]))
    with pytest.raises(InvalidGeometry, match=r"3 triangles share an edge at \("):
        run(fin)
    with pytest.raises(InvalidInput, match="no density"):
        run(cap(), fields=("density",))
    far = trimesh.creation.icosphere(subdivisions=2)
    other = far.copy()
    other.apply_scale(0.2).apply_translation([3.0, 0, 0])
    with pytest.raises(InvalidGeometry, match=r"about \((2.9|3).*does not hang together"):
        run(trimesh.util.concatenate([far, other]))
    needle = trimesh.creation.icosphere(subdivisions=2)
    needle.vertices = np.where(needle.vertices[:, :1] > 0.999, [[3.0, 0, 0]], needle.vertices)
    with pytest.raises(InvalidGeometry, match=r"(too thin at|about) \((2|3)"):
        run(needle)


def test_an_open_mesh_gets_a_rind_of_flesh_on_the_side_that_it_faces_from() -> None:
    mesh = cap()
    points, faces = rind(np.asarray(mesh.vertices), np.asarray(mesh.faces), 0.2)
    closed = trimesh.Trimesh(points, faces, process=False)
    assert closed.is_watertight
    assert closed.is_winding_consistent
    solid_angle = float(mesh.area)  # of facets: 1 % below the ball's
    assert closed.volume == pytest.approx(solid_angle * (1 - 0.8**3) / 3, rel=0.02)
    fields = ("mesh_position", "triangle", "mass", "water_lost")
    found = run(mesh, fields=fields, flesh={**STILL, "gravity": 0.0, "rind": 0.2}, wounds=[])
    fresh, dry = found.mesh_position.values.astype(float)
    # what only dries shrinks alike everywhere, and its mass is what has not evaporated
    share = float(found.water_lost[1])
    assert share > 0.01
    assert float(found.mass[1]) == pytest.approx(1 - share, abs=1e-9)
    scale = (1 - share) ** (1 / 3)
    middle = fresh.mean(axis=0)
    assert np.abs(dry - dry.mean(axis=0) - scale * (fresh - middle)).max() < 1e-5
    # and what has a weight rests on its floor
    lying = run(mesh, (12.0,), fields=("mesh_position", "triangle", "least_jacobian"), wounds=[{"vertex": 3}])
    assert lying.mesh_position.values[0, :, 1].min() > float(mesh.vertices[:, 1].min()) - 1e-3
    assert np.abs(lying.mesh_position.values[0] - mesh.vertices).max() > 0.1
    assert float(lying.least_jacobian[0]) > 0


def test_a_body_shrinks_where_it_was_drawn() -> None:
    """Moved by a vector the same run is moved by that vector: nothing is drawn to the middle of the world."""
    away = np.array([9.0, 4.0, -6.0])
    ring, moved = torus(32, 16), torus(32, 16)
    moved.vertices = moved.vertices + away
    here, there = (run(mesh, wounds=[], flesh=STILL) for mesh in (ring, moved))
    gap = np.abs(there.mesh_position.values - here.mesh_position.values - away)
    assert float(here.water_lost[-1]) > 0.01
    assert gap.max() < 2e-4
    middle = here.mesh_position.values.mean(axis=1)
    assert np.abs(middle[-1, [0, 2]] - middle[0, [0, 2]]).max() < 2e-4


def test_a_tip_too_sharp_for_any_lattice_goes_along() -> None:
    """A cone on a ball: the first lattices miss more than its tip, and none has so small an edge as a tip."""

    def horned(radius: float) -> trimesh.Trimesh:
        ball = trimesh.creation.icosphere(subdivisions=5)
        points = np.asarray(ball.vertices).copy()
        out = np.hypot(points[:, 0], points[:, 2])
        horn = (points[:, 1] > 0) & (out < radius)
        points[horn, 1] += 1 - out[horn] / radius
        ball.vertices = points
        return ball

    mesh = horned(0.35)
    found = run(mesh, wounds=[], flesh=STILL)
    tip = int(np.argmax(np.asarray(mesh.vertices)[:, 1]))
    shrunk = float(np.cbrt(found.volume[-1] / found.volume[0]))
    high = found.mesh_position.values[:, tip, 1] - found.mesh_position.values[:, :, 1].min(axis=1)
    assert high[0] == pytest.approx(3, rel=0.02)
    assert high[-1] / high[0] == pytest.approx(shrunk, rel=0.02)
    # a needle as long as the ball is wide is no detail
    with pytest.raises(InvalidGeometry, match="too thin at"):
        run(horned(0.04), wounds=[], flesh=STILL)


@pytest.mark.parametrize("scale", [0.01, 100.0])
def test_a_mesh_in_other_units_is_refused_with_the_factor(scale: float) -> None:
    ring = torus(16, 8)
    ring.vertices = ring.vertices * scale
    with pytest.raises(InvalidInput, match=f"multiply its points by {1 / 1.4 / scale:.3g}"):
        SOLVER.parse({"mesh": given(ring)}, preset="apple")


def test_parts_that_overlap_are_one_body() -> None:
    """Two balls that are in each other: what of one is in the other is deep in flesh."""
    left = trimesh.creation.icosphere(subdivisions=3)
    right = left.copy()
    right.apply_translation([1.2, 0, 0])
    both = trimesh.util.concatenate([left, right])
    found = run(both, wounds=[], flesh={**STILL, "gravity": 0.0})
    fresh, dry = found.mesh_position.values.astype(float)
    assert np.abs(fresh - both.vertices).max() < 1e-6
    scale = (1 - float(found.water_lost[1])) ** (1 / 3)
    assert scale < 0.999
    assert np.abs(dry - dry.mean(axis=0) - scale * (fresh - fresh.mean(axis=0))).max() < 1e-5
    # what is buried in one ball does not hang from the other's skin down to a floor
    flesh = embedded.Embedded(SOLVER.parse({"mesh": given(both)}, preset="apple"), lay_of(both), 8)
    assert flesh.hanging.min() > -0.2
    assert (flesh.solid.points[:, 1] + flesh.hanging).min() == pytest.approx(-1.0, abs=1e-3)


def test_a_carrot_is_a_body() -> None:
    """A cone's tip is longer than an edge of its first lattice, and no finer one that can be had comes nearer."""
    cone = trimesh.creation.cone(0.5, 2, sections=32).subdivide_to_size(0.1)
    found = run(cone, wounds=[], flesh={**STILL, "gravity": 0.0})
    fresh, dry = found.mesh_position.values.astype(float)
    scale = (1 - float(found.water_lost[1])) ** (1 / 3)
    assert np.abs(dry - dry.mean(axis=0) - scale * (fresh - fresh.mean(axis=0))).max() < 1e-3
    assert float(found.least_jacobian.min()) > 0


def test_a_lattice_is_counted_before_it_is_laid() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    points, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    whole = 12 * ball.volume / 0.1**3
    # all within, and what the skin cuts: a layer of the lattice's edge
    assert whole < touched(points, faces, 0.1) < whole + 12 * ball.area / 0.1**2
    assert touched(points, faces, 0.3) >= len(np.unique(stuffed(points, faces, 0.3).tets[:, 0]))
    assert touched(points, faces, 1e-3) == np.inf


@pytest.mark.parametrize(("thick", "tilted"), [(0.005, 0.0), (1e-7, 0.7)])
def test_a_thin_leaf_is_refused_before_a_huge_lattice_is_laid(
    monkeypatch: pytest.MonkeyPatch, thick: float, tilted: float
) -> None:
    leaf = trimesh.creation.icosphere(subdivisions=4)
    leaf.vertices = leaf.vertices * [1, thick, 1]
    leaf.apply_transform(trimesh.transformations.rotation_matrix(tilted, [1, 0, 1]))
    laid_out = []

    def counted(*given):
        laid_out.append(stuffed(*given))
        return laid_out[-1]

    monkeypatch.setattr(embedded, "stuffed", counted)
    with pytest.raises(InvalidGeometry, match=r"too thin (at \(|for its size).*an open mesh gets a rind"):
        embedded._filled(np.asarray(leaf.vertices), np.asarray(leaf.faces), 6, embedded._FAR)
    assert all(len(found.tets) <= embedded._MOST for found in laid_out)


def test_a_leaf_that_only_a_huge_lattice_holds_is_refused() -> None:
    leaf = trimesh.creation.box((2, 2, 0.01)).subdivide_to_size(0.2)
    with pytest.raises(InvalidGeometry, match="thinner than the lattice"):
        embedded._filled(np.asarray(leaf.vertices), np.asarray(leaf.faces), 6, embedded._FAR)
