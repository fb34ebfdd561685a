"""Bodies that turn, wedges, balls and meshes: depths in closed form, momentum, power, friction of a turning surface."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from solver.contract import InvalidGeometry, InvalidInput, Need
from solver.wood import SOLVER
from solver.wood.contact.bodies import press
from solver.wood.contact.posing import pose
from solver.wood.contact.shapes import touch
from solver.wood.model.bodies.building import sampled
from solver.wood.model.bodies.solids import solid_of, weight_of
from solver.wood.model.bundle import lay
from solver.wood.model.state import Wood, scratch_for
from solver.wood.params import Body
from solver.wood.surface.solids import solid

REST = [{"time": 0.0, "position": (0.0, 0.0, 0.0)}]
CORNERS = [(x, y, z) for x in (-0.02, 0.03) for y in (-0.01, 0.01) for z in (0.0, 0.04)]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CUBOID = {"points": CORNERS, "faces": [t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))]}
WEDGE = {"shape": "wedge", "size": (0.0, 0.05, 0.06), "angle": 0.7, "edge": 0.002}
BLADE = {**WEDGE, "size": (0.008, 0.05, 0.06)}


def laid(*bodies: dict, **more: object) -> Wood:
    values = {"rods": 9, "vertices": 8, "length": 0.1, "radius": 0.004, "bodies": bodies, **more}
    return lay(SOLVER.parse(values), 8)


def depths(body: dict, places: np.ndarray) -> np.ndarray:
    """Return depth and outward normal (n, 4) at places (n, 3) in the body's own frame, from its centre."""
    bodies = laid({"path": REST, **body}).bodies
    return np.array([touch(bodies, 0, *o) for o in places])


@pytest.mark.parametrize("shape", [WEDGE, BLADE])
def test_a_wedge_s_depth_is_the_distance_of_its_surface(shape):
    """By trimesh, from the drawn one, which is convex."""
    body = Body(path=REST, **shape)
    points, faces = solid_of(body)
    mesh = trimesh.Trimesh(points, faces)
    mesh.merge_vertices()
    generator = np.random.default_rng(0)
    places = generator.uniform(-1, 1, (400, 3)) * np.abs(points).max(0)
    # and many about the edge
    places[200:, 0] *= 0.15
    places[200:, 2] = -0.03 + generator.uniform(-0.001, 0.006, 200)
    found = depths(shape, places)
    sides = np.repeat(mesh.triangles[None], len(places), 0).reshape(-1, 3, 3)
    near = trimesh.triangles.closest_point(sides, np.repeat(places, len(mesh.triangles), 0)).reshape(len(places), -1, 3)
    away = np.linalg.norm(near - places[:, None], axis=2).min(1)
    beyond = ((places[:, None] - mesh.triangles_center) * mesh.face_normals).sum(2).max(1)
    wanted = np.where(beyond < 0, away, -away)
    # twelve sides for the round edge: a sagitta of some hundredths of its radius
    assert found[:, 0] == pytest.approx(np.maximum(wanted, 0), abs=0.03 * body.edge)
    inside = wanted > 0.03 * body.edge
    assert inside.sum() > 100
    assert np.linalg.norm(found[inside, 1:], axis=1) == pytest.approx(1.0, abs=1e-12)
    # the normal is what the depth falls along
    h = 1e-7
    for c in range(3):
        step = h * np.eye(3)[c]
        slope = (depths(shape, places[inside] + step)[:, 0] - depths(shape, places[inside] - step)[:, 0]) / (2 * h)
        smooth = np.abs(slope + found[inside, 1 + c]) < 1e-4
        # but where two faces are as near
        assert smooth.mean() > 0.97


def test_a_wedge_weighs_what_a_prism_does():
    """A triangle of height h and half angle b: area h^2 tan b, middle at 2/3 from its edge; less its rounding."""
    sharp = Body(path=REST, **{**WEDGE, "edge": 1e-6})
    weight = weight_of(sharp)
    assert weight.volume == pytest.approx(0.06**2 * np.tan(0.35) * 0.05, rel=1e-3)
    assert weight.middle == pytest.approx([0, 0, 0.01], abs=1e-5)
    # about its axis along the edge: m (h^2 / 18 + base^2 / 24)
    base = 2 * 0.06 * np.tan(0.35)
    assert weight.inertia[1, 1] / weight.volume == pytest.approx(0.06**2 / 18 + base**2 / 24, rel=1e-3)


def test_depths_of_a_cuboid_by_its_mesh_are_those_of_a_box():
    """Where the nearest face is one: linear between nodes, so exact to rounding; about edges within a grid's step."""
    depth, step = sampled(Body(shape="mesh", mesh=CUBOID, path=REST))
    assert 1e-4 < step < 1e-3
    assert depth.min() == -step
    half = np.array([0.025, 0.01, 0.02])
    places = np.random.default_rng(1).uniform(-1.05, 1.05, (3000, 3)) * half
    found = depths({"shape": "mesh", "mesh": CUBOID}, places)
    gaps = np.sort(half - np.abs(places), axis=1)
    wanted = np.maximum(gaps[:, 0], 0.0)
    assert found[:, 0] == pytest.approx(wanted, abs=step)
    plain = (gaps[:, 0] > 0) & (gaps[:, 1] - gaps[:, 0] > 2 * step) & (np.abs(places) > 2 * step).all(1)
    assert plain.sum() > 500
    assert found[plain, 0] == pytest.approx(wanted[plain], abs=1e-12)
    box = depths({"size": tuple(2 * half)}, places[plain])
    assert found[plain] == pytest.approx(box, abs=1e-9)


def test_a_mesh_need_not_be_convex():
    """A ring: through its hole nothing touches."""
    ring = trimesh.creation.torus(0.03, 0.008, major_sections=48, minor_sections=24)
    body = {"shape": "mesh", "mesh": {"points": ring.vertices.tolist(), "faces": ring.faces.tolist()}}
    places = np.random.default_rng(2).uniform(-1, 1, (2000, 3)) * [0.038, 0.038, 0.008]
    found = depths(body, places)
    away = 0.008 - np.hypot(np.hypot(places[:, 0], places[:, 1]) - 0.03, places[:, 2])
    assert found[:, 0] == pytest.approx(np.maximum(away, 0), abs=4e-4)
    assert found[np.hypot(places[:, 0], places[:, 1]) < 0.02, 0].max() == 0
    weight = weight_of(Body(path=REST, **body))
    assert weight.volume == pytest.approx(ring.volume, rel=1e-9)
    assert weight.inertia == pytest.approx(ring.moment_inertia, rel=1e-6, abs=1e-15)


PATH = [
    {"time": 0.0, "position": (0.05, 0.0, 0.004), "turn": (0.2, -0.1, 0.3)},
    {"time": 1.0, "position": (0.06, 0.01, -0.02), "turn": (0.9, 0.4, -0.6)},
]
TURNING = [
    {"size": (0.02, 0.03, 0.01), "friction": 0.5, "pivot": (0.01, 0.02, 0.0), "path": PATH},
    {"shape": "cylinder", "size": (0.01, 0.03, 0), "axis": "x", "path": PATH},
    {**WEDGE, "size": (0.0, 0.05, 0.02), "friction": 0.2, "path": PATH},
    {"shape": "ball", "size": (0.012, 0, 0), "path": [PATH[0]]},
    {"shape": "mesh", "mesh": CUBOID, "path": PATH},
    {"size": (0.02, 0.02, 0.02), "mass": 0.3, "spin": (3, 50, 2), "velocity": (1, 2, 3), "path": [PATH[0]]},
]


def pressed(wood: Wood, time: float = 0.4):
    """Return energy, forces (v, 3), forces on the bodies and their moments (r, 6), powers (2,), and poses."""
    m, b = wood.motion, wood.bodies
    poses, push = scratch_for(wood).poses, np.zeros((len(b.kind), 6))
    pose(b, time, poses)
    f, power = np.zeros_like(m.x), np.zeros(2)
    energy = press(m.x, m.v, f, m.mass, wood.rods, b, poses, 1e-6, push, power)
    return energy, f, push, power, poses


def shaken(*bodies: dict) -> Wood:
    wood = laid(*bodies)
    generator = np.random.default_rng(0)
    wood.motion.x[:] += generator.normal(0, 2e-4, wood.motion.x.shape)
    wood.motion.v[:] = generator.normal(0, 1.0, wood.motion.v.shape)
    return wood


@pytest.mark.parametrize("body", TURNING)
def test_turning_bodies_keep_momentum_and_their_power_is_force_and_moment_times_motion(body):
    wood = shaken(body)
    _, f, push, power, poses = pressed(wood)
    x = wood.motion.x
    assert np.abs(push).min() > 0
    assert np.abs(f.sum(0) + push[0, :3]).max() < 1e-13 * np.abs(f).max() * len(f)
    arms = np.cross(x, f).sum(0) + np.cross(poses.pivot[0], push[0, :3]) + push[0, 3:]
    assert np.abs(arms).max() < 1e-13 * np.abs(np.cross(x, f)).max() * len(f)
    given = -push[0, :3] @ poses.speed[0] - push[0, 3:] @ poses.spin[0]
    assert power[0] == pytest.approx(0.0 if "mass" in body else given, rel=1e-11, abs=1e-12)
    assert power[1] > 0
    # what friction takes is what the rods and the body lose
    slip = (f * wood.motion.v).sum() - given
    smooth = replace(wood, bodies=wood.bodies._replace(friction=np.zeros(1)))
    _, bare, rough, _, _ = pressed(smooth)
    normal = (bare * wood.motion.v).sum() + rough[0, :3] @ poses.speed[0] + rough[0, 3:] @ poses.spin[0]
    assert slip - normal == pytest.approx(-power[1], rel=1e-9)


@pytest.mark.parametrize("body", TURNING)
def test_forces_of_turning_bodies_are_the_energy_s_differences(body):
    wood = shaken({**body, "friction": 0.0})
    m = wood.motion
    f = pressed(wood)[1]
    way = np.random.default_rng(2).normal(size=f.shape)
    x, h, found = m.x.copy(), 1e-9, []
    for sign in (1, -1):
        m.x[:] = x + sign * h * way
        found.append(pressed(wood)[0])
    assert (f * way).sum() == pytest.approx((found[1] - found[0]) / (2 * h), rel=1e-5)


@pytest.mark.parametrize("time", [0.0, 0.3, 1.0, 1.7, 2.5, 9.0])
def test_bodies_turn_about_their_pivot_as_scipy_s_slerp(time):
    from scipy.spatial.transform import Slerp

    path = [*PATH, {"time": 2.0, "position": (0.06, 0.0, 0.0), "turn": (-2.0, 0.4, 0.0)}]
    wood = laid({"size": (0.02, 0.03, 0.01), "pivot": (0.01, 0.02, 0.0), "path": path})
    poses = pressed(wood, time)[4]
    moment = np.clip(time, 0, 2)
    turns = Slerp([0, 1, 2], Rotation.from_rotvec([p["turn"] for p in path]))
    place = np.array([np.interp(moment, [0, 1, 2], [p["position"][c] for p in path]) for c in range(3)])
    assert poses.frame[0] == pytest.approx(turns(moment).as_matrix(), abs=1e-12)
    assert poses.pivot[0] == pytest.approx(place, abs=1e-12)
    assert poses.centre[0] == pytest.approx(place - turns(moment).apply([0.01, 0.02, 0.0]), abs=1e-12)
    if 0 < time < 2 and time != 1:
        h = 1e-5
        way = (turns(moment + h) * turns(moment - h).inv()).as_rotvec() / (2 * h)
        assert poses.spin[0] == pytest.approx(way, rel=1e-6)
    elif time > 2:
        assert not poses.spin[0].any()
    drawn, faces = solid(Body(size=(0.02, 0.03, 0.01), pivot=(0.01, 0.02, 0.0), path=path), time)
    own = (drawn - poses.centre[0]) @ poses.frame[0]
    assert np.abs(own) == pytest.approx(np.tile([0.01, 0.015, 0.005], (len(own), 1)), abs=1e-12)
    assert trimesh.Trimesh(drawn, faces).volume == pytest.approx(6e-6)


def test_turns_about_one_axis_go_round_more_than_once():
    path = [{"time": 0.0, "position": (0, 0, 0)}, {"time": 1.0, "position": (0, 0, 0), "turn": (0, 0, 4 * np.pi)}]
    poses = pressed(laid({"size": (0.02, 0.03, 0.01), "path": path}), 0.25)[4]
    assert poses.spin[0] == pytest.approx([0, 0, 4 * np.pi])
    assert poses.frame[0] == pytest.approx(np.diag([-1.0, -1.0, 1.0]), abs=1e-12)


def test_a_quarter_turn_makes_a_box_of_its_other_sides():
    place = {"time": 0.0, "position": (0.05, 0.001, 0.006)}
    plain = pressed(shaken({"size": (0.01, 0.03, 0.006), "path": [place]}))
    turned = {"size": (0.03, 0.01, 0.006), "path": [{**place, "turn": (0, 0, np.pi / 2)}]}
    wood = shaken(turned)
    # one that turns counts as wide as it is narrow
    wood = replace(wood, bodies=wood.bodies._replace(k=shaken({"size": (0.01, 0.03, 0.006), "path": [place]}).bodies.k))
    other = pressed(wood)
    bare = shaken({"size": (0.01, 0.03, 0.006), "path": [place]})
    bare = replace(bare, bodies=bare.bodies._replace(first=wood.bodies.first))
    plain = pressed(bare)
    assert other[0] == pytest.approx(plain[0], rel=1e-9)
    assert other[1] == pytest.approx(plain[1], rel=1e-9, abs=1e-9)


def test_a_roller_drags_a_rod_that_it_turns_under():
    """Its surface slides by, though it goes nowhere: friction is Coulomb's, and its work that of the moment."""
    turns = [{"time": t, "position": (0.05, 0, -0.0099), "turn": (0, 2 * np.pi * 50 * t, 0)} for t in (0.0, 0.06)]
    roller = {"shape": "cylinder", "size": (0.02, 0.05, 0), "friction": 0.3, "path": turns}
    values = {"rods": 1, "vertices": 8, "radius": 0.002, "length": 0.1, "clamp": "both", "fracture": "none"}
    values |= {"grain": {"strength": 0.0}, "damping": 200.0, "unevenness": 0.0, "bodies": [roller]}
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.02, 0.06), quality="default"))
    force, torque = found.body_force.values[1, 0], found.body_torque.values[1, 0]
    # its upper side runs along +x
    assert force[2] < 0
    assert force[0] == pytest.approx(0.3 * force[2], rel=0.02)
    assert torque[1] == pytest.approx(force[0] * 0.01, rel=0.02)
    work = np.diff(found.work.values)[0]
    assert work == pytest.approx(-torque[1] * 2 * np.pi * 50 * 0.04, rel=1e-6)
    assert found.residual.values.max() < 0.01
    assert found.body_spin.values[0, 0] == pytest.approx([0, 100 * np.pi, 0])


@pytest.mark.parametrize(("friction", "half"), [(0.0, 0.2), (0.0, 0.5), (0.3, 0.35)])
def test_a_wedge_s_force_is_that_of_the_inclined_plane(friction, half):
    """Driven down beside a held rod, whose side its flank presses: along over across is tan of angle and friction."""
    turn = (0.0, 0.0, np.pi / 2)
    path = [{"time": t, "position": (0.05, 0.01, z), "turn": turn} for t, z in ((0.0, 0.0), (0.05, -0.01))]
    # beside the rod its flank is at y = 0 when it is .01 / tan(half) above the edge
    for p in path:
        x, y, z = p["position"]
        p["position"] = (x, y, z - 0.01 / np.tan(half) + 0.01)
    wedge = {
        "shape": "wedge",
        "size": (0, 0.02, 0.2),
        "angle": 2 * half,
        "edge": 1e-3,
        "friction": friction,
        "path": path,
    }
    values = {"rods": 1, "vertices": 9, "radius": 0.002, "length": 0.1, "clamp": "both", "fracture": "none"}
    values |= {"grain": {"strength": 0.0}, "damping": 300.0, "unevenness": 0.0, "bodies": [wedge]}
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.04, 0.048), quality="default"))
    force = found.body_force.values[1, 0]
    assert force[1] > 1.0
    assert force[2] / force[1] == pytest.approx(np.tan(half + np.arctan(friction)), rel=0.02)
    assert abs(force[0]) < 0.01 * force[1]
    assert found.residual.values.max() < 0.01


OPEN = {**CUBOID, "faces": CUBOID["faces"][:-1]}


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({**WEDGE, "angle": 0.0}, "greater than 0"),
        ({**WEDGE, "angle": np.pi}, "less than 3.14"),
        ({**WEDGE, "edge": 0.04}, "rounder than it is high"),
        ({**WEDGE, "size": (0.2, 0.05, 0.06)}, "take a thickness between"),
        ({**WEDGE, "size": (0.001, 0.05, 0.06)}, "take a thickness between"),
        ({"shape": "mesh"}, "needs points and triangles"),
        ({"shape": "box", "size": (1, 1, 1), "mesh": CUBOID}, "no other shape has them"),
        ({"shape": "mesh", "mesh": OPEN}, "the mesh is open: 3 sides"),
        ({"shape": "mesh", "mesh": {**CUBOID, "faces": [f[::-1] for f in CUBOID["faces"]]}}, "encloses nothing"),
        ({"shape": "mesh", "mesh": {**CUBOID, "faces": [*CUBOID["faces"], CUBOID["faces"][0]]}}, "open|share a side"),
        ({"shape": "mesh", "mesh": {**CUBOID, "faces": [*CUBOID["faces"][:-1], (1, 2, 99)]}}, "numbered 0 to 7"),
        ({"shape": "mesh", "mesh": {**CUBOID, "points": CORNERS * 3000}}, "at most 20000"),
        ({"shape": "mesh", "mesh": "axe.obj"}, "expected points and faces"),
    ],
)
def test_impossible_shapes_are_refused_with_advice(body, said):
    with pytest.raises(InvalidInput, match=said):
        SOLVER.parse({"bodies": [{"path": REST, **body}]})


def test_textures_of_a_file_s_mesh_are_left_out_and_what_is_unknown_is_refused():
    dressed = {**CUBOID, "uv": [(0, 0)], "uv_faces": [], "materials": ["steel"], "groups": {}}
    body = SOLVER.parse({"bodies": [{"path": REST, "shape": "mesh", "mesh": dressed}]}).bodies[0]  # type: ignore[attr-defined]
    assert body.mesh.model_dump().keys() == {"points", "faces"}
    with pytest.raises(InvalidInput, match="colour"):
        SOLVER.parse({"bodies": [{"path": REST, "shape": "mesh", "mesh": {**CUBOID, "colour": 1}}]})


def test_a_mesh_that_crosses_itself_or_is_too_thin_for_its_grid_is_refused():
    thin = {**CUBOID, "points": [(x, 1e-4 * y, z) for x, y, z in CORNERS]}
    # two flat plates far apart: the grid of their common box is too coarse
    shifted = [(x, y + 0.5, z) for x, y, z in thin["points"]]
    both = {
        "points": thin["points"] + shifted,
        "faces": CUBOID["faces"] + [tuple(8 + i for i in f) for f in CUBOID["faces"]],
    }
    with pytest.raises(InvalidGeometry, match="too thin for the grid"):
        laid({"shape": "mesh", "mesh": both, "path": REST})
