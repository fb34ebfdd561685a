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
