"""Halves, slices and wedges as bodies, browning and puddles: closed forms, and what a run of one hands over."""

import numpy as np
import pytest
import trimesh
from scipy.integrate import quad

from solver.contract import InvalidGeometry, InvalidInput, Need
from solver.decay import SOLVER, DecayParams
from solver.decay.browning import browned
from solver.decay.puddle import puddle_radius
from solver.decay.surfaces.cut import Cut, Left, bare, left
from solver.decay.surfaces.surface import extent, lay, triangulated
from solver.fruit import Fruit

RADIUS = 1.04
BALL = Fruit(stone=(0, 0))


def closed(rest: Left) -> trimesh.Trimesh:
    found = trimesh.Trimesh(rest.mesh.points, rest.mesh.faces, process=False)
    assert found.is_watertight
    assert found.is_winding_consistent
    assert found.volume > 0
    return found


@pytest.mark.parametrize("off", [0.0, 0.31, -0.52])
def test_a_ball_less_its_cap_has_the_volume_and_the_face_that_it_should(off):
    normal = np.array([1.0, 2.0, -2.0]) / 3
    cut = Cut(point=tuple(off * normal), normal=tuple(7 * normal))
    rest = left(lay(BALL, 24), (cut,))
    cap = RADIUS - off
    share = 1 - cap**2 * (3 * RADIUS - cap) / (4 * RADIUS**3)
    assert rest.share == pytest.approx(share, abs=2e-3)
    mesh = closed(rest)
    assert (mesh.vertices @ normal).max() == pytest.approx(off, abs=1e-6)
    flat = bare((cut,), mesh.vertices)[mesh.faces].all(axis=1)
    assert mesh.area_faces[flat].sum() == pytest.approx(np.pi * (RADIUS**2 - off**2), rel=0.02)


def test_slices_and_wedges_are_what_several_planes_leave():
    slice_ = (Cut(point=(0, 0, 0.2), normal=(0, 0, 1)), Cut(point=(0, 0, -0.1), normal=(0, 0, -1)))
    rest = left(lay(BALL, 24), slice_)
    whole = 4 / 3 * np.pi * RADIUS**3
    between, _ = quad(lambda z: np.pi * (RADIUS**2 - z**2), -0.1, 0.2)
    assert rest.share == pytest.approx(between / whole, rel=5e-3)
    closed(rest)
    quarter = left(lay(BALL, 24), (Cut(normal=(1, 0, 0)), Cut(normal=(0, 0, 1))))
    assert quarter.share == pytest.approx(0.25, abs=2e-3)
    closed(quarter)


def test_no_sliver_makes_steps_dear():
    fresh = lay(BALL, 24)
    cuts = (Cut(point=(0.05, 0, 0), normal=(1, 0.2, 0.3)), Cut(normal=(0.1, 0, -1)))
    rest = left(fresh, cuts).mesh
    found = triangulated(np.array(rest.points), np.array(rest.faces))
    assert found.stiffest < 8 * fresh.stiffest


def test_what_cannot_be_cut_is_refused():
    with pytest.raises(InvalidInput, match="cut 0 misses"):
        left(lay(BALL, 8), (Cut(point=(0, 0, 2), normal=(0, 0, 1)),))
    with pytest.raises(InvalidInput, match="cut 1 leaves nothing"):
        left(lay(BALL, 8), (Cut(normal=(0, 0, 1)), Cut(point=(0, 0, -2), normal=(0, 0, 1))))
    with pytest.raises(InvalidGeometry, match="leave cuts out"):
        DecayParams.parse({"cuts": ({"normal": (0, 0, 1)},), "heap": {}})
    with pytest.raises(InvalidInput, match="normal"):
        DecayParams.parse({"cuts": ({"normal": (0, 0, 0)},)})


def test_flesh_browns_as_the_slices_did():
    """Quevedo et al. 2014 at 5 degC: 0.0117 a minute, order 0.451; quicker where it is warm, whatever the weather."""
    cold = DecayParams.parse({"temperature": 5.0})
    for minutes in (5, 60, 600):
        assert browned(cold, minutes / 1440) == pytest.approx(1 - np.exp(-((0.0117 * minutes) ** 0.451)), rel=1e-9)
    warm = DecayParams.parse({"temperature": 25.0})
    assert browned(cold, 0.0) == 0
    assert browned(cold, 0.02) < browned(warm, 0.02) < 1
    steady = ({"day": 0, "temperature": 5, "humidity": 50}, {"day": 3, "temperature": 5, "humidity": 90})
    assert browned(DecayParams.parse({"weather": steady}), 2.0) == pytest.approx(browned(cold, 2.0), rel=1e-9)


def test_a_puddle_is_a_cap_when_small_and_as_thick_as_it_can_be_when_large():
    assert puddle_radius(0.0, 9.81) == 0
    assert puddle_radius(5.0, 0.0) == 0
    # 2 l sin 30 degrees, l = 2.709 mm
    assert np.pi * puddle_radius(200.0, 9.81) ** 2 * 2.709e-3 == pytest.approx(200e-6, rel=1e-3)
    # a drop of a milligram: the cap of a ball that meets the table at 60 degrees
    base = puddle_radius(1e-3, 9.81)
    ball = base / np.sin(np.pi / 3)
    volume, _ = quad(lambda z: np.pi * (ball**2 - z**2), ball * np.cos(np.pi / 3), ball)
    assert volume == pytest.approx(1e-9, rel=1e-6)


@pytest.fixture(scope="module")
def half():
    values = {"body": "quasi-static", "within": {}, "cuts": ({"normal": (0, 0.5, 1)},)}
    values["wounds"] = ({"position": (0.8, -0.3, -0.2)},)
    return SOLVER.solve(SOLVER.parse(values, preset="apple"), Need(stages=(0, 0.1, 5), quality="preview"))


def test_a_half_browns_dries_at_its_face_and_rots(half):
    flat, skin = half["flesh"].values[0] == 1, half["flesh"].values[0] == 0
    assert 0.2 < flat.mean() < 0.5
    assert flat.sum() + skin.sum() == flat.size
    brown = half["browned"].values
    assert brown[0].max() == 0
    assert (brown[:, skin] == 0).all()
    assert 0.5 < brown[1, flat].min() <= brown[1, flat].max() < brown[2, flat].min() < 1
    points = half["mesh_position"].values
    mesh = trimesh.Trimesh(points[2], half["triangle"].values, process=False)
    assert mesh.is_watertight
    assert half["rotten_share"].values[2] > 0.02
    # dry below the face, wet below the skin
    place, wet = half["flesh_position"].values[0].astype(float), half["flesh_water"].values[2]
    away = (place @ [0, 0.5, 1]) / np.hypot(0.5, 1)
    near = np.linalg.norm(place, axis=1) < 0.8
    face, deep = near & (away > -0.03), near & (away < -0.3) & (away > -0.6)
    assert wet[face].mean() < wet[deep].mean() - 0.05


def test_a_half_loses_more_of_its_weight_than_the_whole(half):
    values = {"body": "quasi-static", "within": {}, "wounds": ({"position": (0.8, -0.3, -0.2)},)}
    need = Need(stages=(0.1, 5), quality="preview", fields=("water_lost",))
    whole = SOLVER.solve(SOLVER.parse(values, preset="apple"), need)
    assert half["water_lost"].values[2] > 3 * whole["water_lost"].values[1]


def test_leaked_juice_makes_a_puddle():
    need = Need(stages=(0, 10, 14), quality="preview", fields=("juice_lost", "puddle"))
    run = SOLVER.solve(SOLVER.parse({"body": "quasi-static"}, preset="apple"), need)
    juice, puddle = run["juice_lost"].values, run["puddle"].values
    assert puddle[0] == 0
    assert 0 < juice[1] < juice[2]
    params = SOLVER.parse({}, preset="apple")
    size = np.cbrt(138e-6 / extent(params).volume)
    assert puddle[2] * size == pytest.approx(puddle_radius(138 * juice[2], 9.81), rel=1e-6)


def test_bare_flesh_is_pale_and_goes_brown_and_a_roast_goes_dark():
    known = DecayParams.parse({}).model_dump()
    none = np.zeros(1)
    assert SOLVER.looks.paint is not None

    def bright(**fields: np.ndarray) -> float:
        skin = SOLVER.looks.paint({"rot": none, **fields}, known)
        return float(skin.colour.sum())

    one = np.ones(1)
    skin, pale = bright(), bright(flesh=one)
    assert pale > 1.5 * skin
    assert skin < bright(flesh=one, browned=0.5 * one) < 0.8 * pale
    assert bright(roasted=one) < 0.4 * skin
    assert bright(roasted=0.2 * one) > 0.6 * skin


def test_a_cut_face_takes_the_flesh_s_own_rot_where_there_is_one():
    known = DecayParams.parse({}).model_dump()
    assert SOLVER.looks.inside is not None
    deep, rot = np.array([0.1, 2.0]), np.array([0.4, 0.8])
    above = {"rot": np.ones(2)}
    by_law = SOLVER.looks.inside(above, deep, known)["rot"]
    assert by_law == pytest.approx([0.8, 0.0])
    assert SOLVER.looks.inside({**above, "flesh_rot": rot}, deep, known)["rot"] == pytest.approx(rot)
