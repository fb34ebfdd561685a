"""Bundles twisted, and what they are held against: Saint-Venant's torsion and flexure in closed form."""

import numpy as np
import pytest

from benchmarks.wood.bundles import moment
from solver.wood import SOLVER
from solver.wood.model.outline import stand
from solver.wood.net.exact import sheared
from solver.wood.net.shares import WAYS, Net, shares

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}
E, G = 10e9, 0.7e9


def polygon(count: int) -> np.ndarray:
    turn = 2 * np.pi * np.arange(count) / count
    # as large as the disk of radius 1
    return np.sqrt(2 * np.pi / (count * np.sin(2 * np.pi / count))) * np.column_stack([np.cos(turn), np.sin(turn)])


def box(wide: float, high: float) -> np.ndarray:
    return np.array([[-wide, -high], [wide, -high], [wide, high], [-wide, high]]) / 2


@pytest.mark.parametrize(
    ("outline", "torsion"),
    [
        (polygon(96), np.pi / 2),
        (polygon(96) * [2.0, 1.0], np.pi * 8 / 5),
        # Timoshenko and Goodier 1970, sec. 109; an equilateral triangle of side a has sqrt(3) a^4 / 80 (sec. 105)
        (box(1, 1), 0.1406),
        (box(2, 1), 0.229 * 2),
        (np.array([[0, 1], [-(3**0.5) / 2, -0.5], [3**0.5 / 2, -0.5]]), 3**0.5 / 80 * 9),
    ],
)
def test_torsion_of_sections_has_its_closed_form(outline, torsion):
    assert sheared(outline, WAYS)[0] == pytest.approx(torsion, rel=2e-3)


def test_flexure_of_sections_has_cowper_s_coefficient():
    """Poisson's ratio 0: 6/7 of a disk, 5/6 of a rectangle, whatever its sides."""
    disk, flat = sheared(polygon(96), WAYS)[1:], sheared(box(0.3, 1), WAYS)[1:]
    assert (np.pi / 4) ** 2 / np.pi / disk == pytest.approx(6 / 7, rel=1e-3)
    area, second = 0.3, np.array([0.3**3, 0.3]) / 12
    assert second[0] ** 2 / area / flat[0] == pytest.approx(5 / 6, rel=2e-3)
    # of 1 along its height, z; the first is along y
    assert second[1] ** 2 / area / flat[1] == pytest.approx(5 / 6, rel=2e-3)


def stiffness(length: float, vertices: int = 16, **values) -> float:
    """Return the moment [N m] that turns the end of a clamped bundle by 1."""
    return moment(SOLVER.parse({"length": length, **PLAIN, **values}), vertices)


@pytest.mark.parametrize("unevenness", [0.0, 0.3])
@pytest.mark.parametrize(("slender", "rods"), [(10, 20), (10, 50), (40, 24), (40, 50), (100, 20)])
def test_a_round_bundle_twists_as_saint_venant_s_bar(slender, rods, unevenness):
    """The clamp holds directions of rods, so that they turn within sqrt(E I / G A) of one: by as much it is shorter.

    And by a sixth of the first edge, which curves there: at preview 1 % of the length.
    """
    radius = 0.01
    layer = np.sqrt(E / (4 * np.pi * G) * np.pi * radius**2 / rods)
    bar = G * np.pi * radius**4 / 2 / (slender * radius - layer)
    found = stiffness(slender * radius, 30 if slender == 100 else 16, radius=radius, rods=rods, unevenness=unevenness)
    assert found == pytest.approx(bar, rel=0.02)


def test_a_square_stick_twists_as_saint_venant_s_bar():
    side, rods, length = 0.02, 60, 0.4
    outline = [tuple(c) for c in (side * box(1, 1)).tolist()]
    layer = np.sqrt(E / (4 * np.pi * G) * side**2 / rods)
    bar = G * 0.1406 * side**4 / (length - layer)
    assert stiffness(length, outline=outline, rods=rods) == pytest.approx(bar, rel=0.02)


def test_rods_that_resist_twist_leave_less_to_bonds():
    """Alike twelve on a ring and one amid: what pairs bear falls by rods' own J."""
    turn = 2 * np.pi * np.arange(12) / 12
    points = np.vstack([[0.0, 0.0], 0.9 * np.column_stack([np.cos(turn), np.sin(turn)])])
    pairs = np.array([(0, n) for n in range(1, 13)] + [(n, n % 12 + 1) for n in range(1, 13)])
    area = np.full(13, np.pi / 13)
    net, own = Net(points, pairs, area), 13 * (np.pi / 13) ** 2 / (2 * np.pi)
    for twisted, wanted in ((False, np.pi / 2), (True, np.pi / 2 - own)):
        part = shares(points, pairs, area, polygon(96), twisted)
        assert net.answers(part * np.pi / 24)[0][0] == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("rods", [24, 48, 96])
def test_halves_of_a_sawn_plank_keep_their_second_moments(rods):
    """Rods are round; the cells of halves two rods high are not, and were 7 % too stiff."""
    wide, high = 0.02, 0.01
    cuts = [{"low": (0.0, -1, 0.0), "high": (0.1, 1, 0.0)}]
    outline = [tuple(c) for c in box(wide, high).tolist()]
    section = stand(SOLVER.parse({"rods": rods, "outline": outline, "cuts": cuts}), np.random.default_rng(0))
    for side in (section.points[:, 1] > 0, section.points[:, 1] < 0):
        a, z = section.area[side], section.points[side, 1]
        z = z - a @ z / a.sum()
        found = a @ z**2 + (a**2).sum() / (4 * np.pi)
        assert found == pytest.approx(wide * (high / 2) ** 3 / 12, rel=0.01)
