"""The surface of a bundle: closed, of the cylinder's volume, turned as the bundle is, open where it breaks."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from solver import meshes
from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.fracture import _split, sever
from solver.wood.model.bundle import lay
from solver.wood.model.section import areas
from solver.wood.surface.align import aligned, bonded, corners, meeting
from solver.wood.surface.cells import section
from solver.wood.surface.rows import rows, spans
from solver.wood.surface.skin import Skin


def laid(**values):
    params = SOLVER.parse({"vertices": 9, **values})
    wood = lay(params, params.vertices)
    return params, wood, Skin(wood, params)


def solid(frame):
    return trimesh.Trimesh(np.asarray(frame.vertices, float), frame.triangles)


def area(places):
    return 0.5 * (places[:, 0] * np.roll(places[:, 1], -1) - places[:, 1] * np.roll(places[:, 0], -1)).sum()


@pytest.mark.parametrize("rods", [1, 2, 7, 60])
def test_cells_have_the_areas_that_quadrature_finds(rods):
    params = SOLVER.parse({"rods": rods, "seed": 3})
    cells = section(params)
    own = [area(cells.places[cells.corner[a:b]]) for a, b in zip(cells.start[:-1], cells.start[1:], strict=True)]
    disk = np.pi * params.radius**2
    assert sum(own) == pytest.approx(disk, rel=1e-9)
    assert own == pytest.approx(areas(cells.points, params.radius), abs=0.04 * disk / rods)


@pytest.mark.parametrize("rods", [1, 2, 5, 19, 80])
def test_an_unbroken_bundle_is_one_closed_cylinder(rods):
    params, wood, skin = laid(rods=rods)
    frame = skin.frame(wood)
    found = solid(frame)
    cylinder = np.pi * params.radius**2 * params.length
    assert found.is_watertight
    assert found.is_winding_consistent
    assert found.body_count == 1
    assert found.volume == pytest.approx(cylinder, rel=1e-9)
    # nothing is turned inside out: bark looks away from the axis, ends along it
    normal, middle = found.face_normals, found.triangles_center
    end = (np.abs(middle[:, 0]) < 1e-9) | (np.abs(middle[:, 0] - params.length) < 1e-9)
    assert (normal[end, 0] * np.sign(middle[end, 0] - params.length / 2) > 0.999).all()
    assert ((normal[~end, 1:] * middle[~end, 1:]).sum(1) > 0).all()
    # inner rods cost their ends only
    whole = skin.frame(wood, covered=True)
    assert solid(whole).volume == pytest.approx(cylinder, rel=1e-9)
    assert len(whole.triangles) >= len(frame.triangles)
    if rods == 80:
        assert len(whole.triangles) > 2 * len(frame.triangles)


@pytest.mark.parametrize("values", [{"bend": 0.03}, {"curvature": 8.0}])
def test_a_bent_bundle_stays_closed_and_keeps_its_volume(values):
    params, wood, skin = laid(rods=30, vertices=30, **values)
    found = solid(skin.frame(wood))
    stretched = np.linalg.norm(wood.motion.x[wood.rods.b] - wood.motion.x[wood.rods.a], axis=1)
    real = wood.rods.k > 0
    grown = float((stretched * wood.rods.radius**2)[real].sum() / (wood.rods.rest * wood.rods.radius**2)[real].sum())
    assert found.is_watertight
    assert found.volume == pytest.approx(grown * np.pi * params.radius**2 * params.length, rel=2e-3)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.3, -0.5, 0.8)])
def test_the_mesh_turns_with_the_bundle(axis):
    _, wood, skin = laid(rods=19, bend=0.01)
    turn, shift = Rotation.from_rotvec(1.1 * np.array(axis)), np.array([0.1, 0.2, -0.3])
    before = skin.frame(wood)
    wood.motion.x[:] = turn.apply(wood.motion.x) + shift
    after = skin.frame(wood)
    np.testing.assert_array_equal(before.triangles, after.triangles)
    np.testing.assert_allclose(after.vertices, turn.apply(before.vertices) + shift, atol=1e-12)


def test_corners_meet_where_the_thesis_iterations_end():
    """Sutherland 2012, 5.2: a corner goes to the mean of itself and its associates, many times over."""
    params, wood, skin = laid(rods=12, seed=2, vertices=5)
    wood.bonds.on[::3] = 0
    span, pairs = spans(wood, params.length), meeting(skin.section)
    found, holds = rows(wood, span, 0.0), bonded(wood, span, pairs)
    begin, row, number = corners(found, skin.section)
    single = np.random.default_rng(1).normal(size=(len(row), 3))
    group, places = aligned(single, begin, found, skin.section, pairs, holds)
    where = {
        (int(found.rod[r]), int(found.station[r]), int(n)): i for i, (r, n) in enumerate(zip(row, number, strict=True))
    }
    links = [[i] for i in range(len(row))]
    for m, pair in enumerate(pairs.pair):
        for k in np.flatnonzero(holds[pair]):
            one = where[int(pairs.p[pair]), int(k), int(pairs.here[m])]
            other = where[int(pairs.q[pair]), int(k), int(pairs.there[m])]
            links[one].append(other)
            links[other].append(one)
    step = np.zeros((len(links), len(links)))
    for i, mine in enumerate(links):
        np.add.at(step[i], mine, 1 / len(mine))
    moved = single
    for _ in range(300):
        moved = step @ moved
    assert max(map(len, links)) > 1
    np.testing.assert_allclose(places[group], moved, atol=1e-9)


@pytest.mark.parametrize("inside", [False, True])
def test_a_broken_rod_is_two_closed_parts(inside):
    params, wood, skin = laid(rods=1, clamp="none")
    if inside:
        sever(wood, 4, 0.4)
        place = float((wood.motion.x[4] + 0.4 * (wood.motion.x[5] - wood.motion.x[4]))[0])
        far = wood.motion.x[:, 0] > place
    else:
        wood = _split(wood, 3)
        place = float(wood.motion.x[4, 0])
        far = wood.motion.x[:, 0] > place
        far[-1] = True  # the new vertex begins the far part
    together = solid(skin.frame(wood)).volume
    wood.motion.x[far] += [0.05, 0.0, 0.02]
    frame = skin.frame(wood)
    parts = solid(frame).split(only_watertight=True)
    assert len(parts) == 2
    assert solid(frame).is_watertight
    volumes = sorted(part.volume for part in parts)
    whole = np.pi * params.radius**2 * params.length
    assert sum(volumes) == pytest.approx(together, rel=1e-9) == pytest.approx(whole, rel=1e-6)
    # rough within the splinters' reach
    reach = 2.5 * params.radius / params.length
    assert abs(min(volumes) / whole - min(place, params.length - place) / params.length) < reach
    rough = frame.vertices[(frame.fields["inside"] == 1) & (frame.vertices[:, 0] > 0.05)]
    assert np.ptp(rough[rough[:, 0] < params.length / 2 + 0.05, 0]) > 0.2 * params.radius


def test_associations_end_with_their_bonds():
    params, wood, skin = laid(rods=2, clamp="none")
    late = wood.motion.x[wood.rods.b[wood.bonds.i], 0] > 0.6 * params.length
    wood.bonds.on[late] = 0
    second = np.isin(np.arange(len(wood.motion.x)), wood.grid[1]) & (wood.motion.x[:, 0] > 0.6 * params.length)
    apart = wood.motion.x[wood.grid[1, 0]] - wood.motion.x[wood.grid[0, 0]]
    closed = skin.frame(wood)
    wood.motion.x[second] += 0.5 * apart
    opened = skin.frame(wood)
    split = solid(opened)
    assert split.is_watertight
    assert split.body_count == 1
    crack = opened.vertices[opened.fields["inside"] == 1]
    # it begins at the last station that holds
    assert ((crack[:, 0] > 0.49 * params.length) | (crack[:, 0] < 1e-9)).all()
    assert len(opened.triangles) == len(closed.triangles)


def test_a_run_that_breaks_stays_closed_and_meshes_only_when_asked():
    values = {"rods": 12, "vertices": 12, "length": 0.05, "radius": 0.003, "clamp": "both", "pull": (20.0, 0, 0)}
    params = SOLVER.parse(values)
    stages = (2e-5, 6e-5)
    run = SOLVER.solve(params, Need(stages=stages, fields=("mesh_position", "inside", "broken_rods"), dtype="float64"))
    assert run.broken_rods[-1] > 0
    for index in range(2):
        found = meshes.frame(run, index)
        edges = np.sort(solid(found).edges, axis=1)
        assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all()
        assert set(np.unique(found.fields["inside"])) == {0.0, 1.0}
    alone = SOLVER.solve(params, Need(stages=stages[1:], fields=("mesh_position",), dtype="float64"))
    np.testing.assert_array_equal(meshes.frame(alone, 0).vertices, meshes.frame(run, 1).vertices)
    assert "inside" not in alone
    bare = SOLVER.solve(params, Need(stages=stages[:1], fields=("rod_position",)))
    assert "mesh_position" not in bare


def test_nothing_is_stretched_between_halves_that_have_parted():
    params = SOLVER.parse({"rods": 30, "vertices": 9, "clamp": "none", "unevenness": 0.6})
    wood = lay(params, params.vertices)
    skin, count = Skin(wood, params), len(wood.grid)
    for rod in range(count):
        # each rod at another vertex, so that bonds of both halves reach past the break
        wood = _split(wood, int(np.flatnonzero(wood.rods.b[wood.rods.before] == wood.grid[rod, 3 + rod % 3])[0]))
    far = np.zeros(len(wood.motion.x), bool)
    for rod in range(count):
        far[wood.grid[rod, 4 + rod % 3 :]] = True
    far[count * 9 :] = True
    b, r = wood.bonds, wood.rods
    ends = far[np.stack([r.a[b.i], r.b[b.i], r.a[b.j], r.b[b.j]])]
    b.on[ends.any(0) & ~ends.all(0)] = 0
    wood.motion.x[far] += [0.0, 0.0, 0.1]
    frame = skin.frame(wood)
    corner = np.asarray(frame.vertices, float)[frame.triangles]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=-1)
    assert sides.max() < 0.04
