"""Wounds, pressure and contacts: pointed at, painted, or found."""

import numpy as np
import pytest

from solver.contract import InvalidInput, Need
from solver.decay import SOLVER
from solver.decay.body.body import Body
from solver.decay.fields.system import System
from solver.decay.surfaces.seeds import seeds
from solver.decay.surfaces.surface import geodesic, lay
from solver.fruit import directions, lattice
from solver.painted import painted


def test_a_position_is_the_angles_under_it():
    by_place = SOLVER.parse({"wounds": [{"position": (0.0, 0.5, 0.5)}]})
    by_angles = SOLVER.parse({"wounds": [{"colatitude": 45.0, "azimuth": 90.0}]})
    ((ours,), (theirs,)) = by_place.wounds, by_angles.wounds
    assert (ours.colatitude, ours.azimuth) == pytest.approx((theirs.colatitude, theirs.azimuth))
    for wrong in ({"position": (0, 0, 0)}, {"position": (1, 0)}, {"position": (1, 0, 0), "azimuth": 3}):
        with pytest.raises(InvalidInput):
            SOLVER.parse({"wounds": [wrong]})


def test_a_painted_map_is_read_where_it_was_painted():
    theta, phi = lattice(24)
    rays = directions(theta, phi)
    smooth = (1 + rays @ np.array([0.3, 0.5, -0.2])) / 2
    there = geodesic(8)[0]
    gap = painted(tuple(map(tuple, smooth)), there) - (1 + there @ np.array([0.3, 0.5, -0.2])) / 2
    assert np.abs(gap).max() < 3e-3
    with pytest.raises(InvalidInput, match="rows"):
        SOLVER.parse({"wound_map": [[0.0, 1.0, 0.0]]})


def test_painted_wounds_are_where_the_paint_is_and_keep_the_budget():
    theta, phi = lattice(32)
    paint = np.where((theta < 1.2) & (phi < 1.5), 1.0, 0.0)
    values = {"wounds": (), "wound_map": paint.tolist(), "climate": "paper"}
    system = System(SOLVER.parse(values), 8, True)
    rot = system.rot.share(system.start.rot)
    rays = geodesic(8)[0]
    down, around = np.arccos(rays[:, 1]), np.arctan2(rays[:, 2], rays[:, 0])
    assert (rot[(down < 1.0) & (around > 0.2) & (around < 1.3)] > 0.1).all()
    outside = (down > 0.2) & ((down > 1.4) | (around < -0.15) | (around > 1.8))
    assert (rot[outside] == 0).all()
    need = Need(fields=("mean_rot", "budget_error"), stages=(0.0, 3.0), quality="preview")
    run = SOLVER.solve(SOLVER.parse(values), need)
    assert run.budget_error.max() < 1e-10
    assert run.mean_rot[1] > run.mean_rot[0] > 0


def taken_from(azimuth: float, spot: np.ndarray, size: int = 96) -> np.ndarray:
    """A photograph of a ball by a camera far away, upright: white within 25 degrees of a spot, by a look-at matrix."""
    camera = np.array([np.cos(np.radians(azimuth)), 0.0, np.sin(np.radians(azimuth))])
    right = np.cross(-camera, [0.0, 1.0, 0.0])
    x, y = np.meshgrid((np.arange(2 * size) + 0.5) / size - 1, 1 - (np.arange(size) + 0.5) / size * 2)
    deep = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    place = x[..., None] * right + y[..., None] * np.array([0, 1.0, 0]) + deep[..., None] * camera
    return np.where((x**2 + y**2 < 1) & (place @ spot > np.cos(np.radians(25))), 1.0, 0.0)


@pytest.mark.parametrize("azimuth", [0.0, 90.0, 205.0])
def test_wounds_of_a_photograph_are_where_they_are_seen(azimuth):
    spot = directions(np.radians(60.0), np.radians(azimuth + 30))
    photo = {"values": taken_from(azimuth, spot).tolist(), "azimuth": azimuth}
    system = System(SOLVER.parse({"wounds": (), "wound_photo": photo, "climate": "paper"}), 16, False)
    rot, near = system.rot.share(system.start.rot), geodesic(16)[0] @ spot
    assert (rot[near > np.cos(np.radians(20))] > 0.1).all()
    assert (rot[near < np.cos(np.radians(31))] == 0).all()


def test_a_picture_alone_is_a_photograph_from_the_front():
    spot = directions(np.radians(100.0), np.radians(90.0))
    photo = taken_from(90.0, spot).tolist()
    system = System(SOLVER.parse({"wounds": (), "wound_photo": photo, "climate": "paper"}), 8, False)
    rot = system.rot.share(system.start.rot)
    assert rot[np.argmax(geodesic(8)[0] @ spot)] > 0.1


def test_bright_skin_feeds_more_and_what_is_not_seen_as_the_mean():
    """A photograph from z > 0 that is brighter to the right by a straight line."""
    even = {"unevenness": 0.0, "wounds": (), "nutrient": 0.5}
    rows = np.tile(np.linspace(0.005, 0.995, 128), (64, 1))
    fresh = System(SOLVER.parse({**even, "nutrient_photo": rows.tolist()}), 16, True).start
    rays = geodesic(16)[0]
    right = np.cross([0, 0, -1.0], [0, 1.0, 0])
    shown = rays[:, 2] > 0.05
    expected = 0.5 * (1 + rays @ right)
    for state in (fresh.rot, fresh.mould):
        assert np.abs(state.n - expected)[shown].max() < 0.01
        assert np.allclose(state.n[rays[:, 2] < -0.01], 0.5)


def test_painted_nutrients_feed_skin_and_flesh():
    theta, _ = lattice(32)
    rows = np.where(theta < np.pi / 2, 1.0, 0.25)
    values = {"unevenness": 0.0, "nutrient_map": rows.tolist(), "stone": (0, 0), "within": {}}
    system = System(SOLVER.parse(values), 16, True, None, 3000)
    assert system.joint is not None
    state = system.start
    up = system.joint.points[:, 1]
    assert np.allclose(state.rot.n[up > 0.15], SOLVER.parse({}).nutrient)
    assert np.allclose(state.rot.n[up < -0.15], 0.25 * SOLVER.parse({}).nutrient)
    assert len(state.mould.n) == len(system.surface.points)


def test_contacts_seed_stem_floor_and_what_is_touched():
    beside = [{"position": (2.0, 0.0, 0.0)}, {"position": (0.0, 0.0, -2.03)}, {"position": (0.0, 0.0, 3.0)}]
    found = seeds(SOLVER.parse({"seeds": "contacts", "neighbours": beside}, "orange"))
    places = sorted((round(w.colatitude), round(w.azimuth)) for w in found)
    assert places == [(0, 0), (90, 0), (90, 270), (180, 0)]
    # each of two touching fruits is seeded at the same point of space
    mirrored = seeds(SOLVER.parse({"seeds": "contacts", "neighbours": [{"position": (-2.0, 0.0, 0.0)}]}, "orange"))
    assert (90, 180) in [(round(w.colatitude), round(w.azimuth)) for w in mirrored]


@pytest.mark.parametrize(("apart", "touches"), [(-0.1, True), (0.04, True), (0.06, False), (0.3, False)])
def test_balls_touch_whose_skins_are_a_twentieth_apart(apart, touches):
    """Two balls of radius 1.04 and 0.5: what lies between their skins is the distance less both radii."""
    ball = {"radii": (1.0,) * 8, "exocarp_thickness": 0.04, "seeds": "contacts"}
    other = {"position": (1.04 + 0.5 + apart, 0.0, 0.0), "radius": 0.5}
    found = seeds(SOLVER.parse({**ball, "neighbours": [other]}))
    assert ((90, 0) in [(round(w.colatitude), round(w.azimuth)) for w in found]) is touches


def test_pressure_shortens_and_stiffens_where_it_is():
    values = {"body": "quasi-static", "wounds": (), "flesh": {"gravity": 0}}
    plain = SOLVER.parse(values, "orange")
    fresh = lay(plain, 16)
    point = {"colatitude": 90, "radius": 0.5, "length": 0.8, "stiffness": 3.0}
    paint = np.zeros((16, 32))
    paint[6:10, :3] = 1.0
    for more in ({"pressure": [point]}, {"pressure_map": {"values": paint.tolist(), "length": 0.8}}):
        body = Body(SOLVER.parse({**values, **more}, "orange"), fresh, 16, 6, 1e-4)
        state = body.state(0.0, None)
        gone = body.on_surface(body.settled(state))
        outward = np.einsum("vi,vi->v", gone, fresh.points)
        assert outward.min() < -0.01
        assert fresh.points[np.argmin(outward)] @ [1, 0, 0] > 0.85  # dented where it was pressed
        assert np.abs(outward[fresh.points[:, 0] < -0.5]).max() < 0.3 * -outward.min()
    assert body.state(0.0, None).young.max() == pytest.approx(plain.flesh.unit * plain.firmness)
