"""The fruit at rest against scipy's spline, closed forms, and what must be refused."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from solver.contract import InvalidGeometry, InvalidInput
from solver.fruit import PRESETS, Fruit, azimuths, colatitudes, directions, lattice


def fruit(name: str, **changes: object) -> Fruit:
    values = {k: v for k, v in PRESETS[name].items() if k != "modulus_ratio"}
    return Fruit.parse(Fruit.over(values, changes))


def test_sphere_is_exact():
    theta, phi = lattice(32)
    surface = fruit("sphere").surface(theta, phi)
    assert np.abs(surface - 1.04 * directions(theta, phi)).max() < 1e-15


@pytest.mark.parametrize("name", sorted(name for name in PRESETS if len(set(PRESETS[name]["radii"])) > 1))
def test_generatrix_is_the_clamped_spline_through_the_control_points(name):
    f = fruit(name)
    knots = np.linspace(-np.pi / 2, np.pi / 2, 7)
    r = np.array(f.radii[:7])
    x, y = f.generatrix(np.pi / 2 - knots)
    assert x == pytest.approx(r * np.cos(knots), abs=1e-14)
    assert y == pytest.approx(r * np.sin(knots), abs=1e-14)
    dense = np.linspace(-np.pi / 2, np.pi / 2, 101)
    x, y = f.generatrix(np.pi / 2 - dense)
    assert x == pytest.approx(CubicSpline(knots, r * np.cos(knots), bc_type=((1, r[0]), (1, -r[6])))(dense), abs=1e-13)
    assert y == pytest.approx(CubicSpline(knots, r * np.sin(knots), bc_type=((1, 0.0), (1, 0.0)))(dense), abs=1e-13)


def test_equator_is_the_ellipse_of_r4_and_r8():
    f = fruit("plum1")
    phi = azimuths(64)
    points = f.sarcocarp(np.full_like(phi, np.pi / 2), phi)
    assert (points[:, 0] / f.radii[3]) ** 2 + (points[:, 2] / f.radii[7]) ** 2 == pytest.approx(1.0)


def test_exocarp_adds_its_thickness_along_rays():
    f = fruit("raisin")
    theta, phi = lattice(16)
    gap = np.linalg.norm(f.surface(theta, phi), axis=-1) - np.linalg.norm(f.sarcocarp(theta, phi), axis=-1)
    assert gap == pytest.approx(f.exocarp_thickness)


def test_stone_is_the_ellipsoid_whose_third_axis_follows_the_equator():
    f = fruit("plum1")
    axes = f.stone_distance(np.eye(3))
    assert axes == pytest.approx([0.5, 0.6, 0.48 * 0.5 / 0.8])


def test_a_fruit_may_have_no_stone():
    f = fruit("sphere", stone=(0, 0))
    assert not f.has_stone
    assert f.is_sphere
    assert (f.stone_distance(np.eye(3)) == 0).all()
    assert fruit("sphere", rs1=0.0, rs2=0.0) == f
    assert fruit("sphere").has_stone


def test_lattice_avoids_the_poles_and_closes_in_azimuth():
    assert colatitudes(8)[0] == pytest.approx(np.pi / 16)
    assert np.diff(azimuths(8)) == pytest.approx(np.pi / 8)
    assert azimuths(8)[-1] + np.pi / 8 == pytest.approx(2 * np.pi)


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"rs1": 1.2}, InvalidGeometry, "pokes through"),
        ({"rs1": 0.99}, InvalidGeometry, "too little flesh"),
        ({"rs1": 0.0}, InvalidInput, "both 0"),
        ({"stone": (0.4, 0.0)}, InvalidInput, "both 0"),
        ({"stone": (0.02, 0.02)}, InvalidInput, "at least 0.05"),
        ({"stone": (-0.1, -0.1)}, InvalidInput, "stone"),
        ({"r4": 0.4}, InvalidGeometry, "concave"),
        ({"te": float("nan")}, InvalidInput, "finite"),
        ({"te": 0.5}, InvalidInput, "exocarp_thickness"),
        ({"te": "thick"}, InvalidInput, "exocarp_thickness"),
        ({"tee": 0.04}, InvalidInput, "did you mean 'te'"),
        ({"radii": [2.0] + [1.0] * 7}, InvalidInput, "divide every length by r1"),
        ({"radii": [1.0] * 7}, InvalidInput, r"radii needs 8 values, such as \[1.0, 1.0, "),
        ({"radii": [1.0] * 2}, InvalidInput, r"^radii: radii needs 8 values, [^;]*$"),
        ({"radii": [1.0] * 9}, InvalidInput, "radii needs 8 values"),
        ({"stone": 0.4}, InvalidInput, r"stone: stone needs 2 values, such as \[0.4, 0.4\] \(got 0.4"),
        ({"r1": 2.0}, InvalidInput, "'r1' cannot be set. It is the unit of length"),
        ({"stone": (0.9803, 0.9803)}, InvalidGeometry, "thinnest flesh 0.0196 r1, at least 0.02"),
        ({"seed": -1}, InvalidInput, "seed"),
    ],
)
def test_refusals_say_what_to_change(changes, kind, words):
    with pytest.raises(kind, match=words):
        fruit("sphere", **changes)


def test_scalar_axes_override_single_entries_of_a_preset():
    f = fruit("jujube1", r4=0.9, rs2=0.25)
    assert f.radii == (1, 1.15, 0.95, 0.9, 0.9, 1.15, 1, 0.85)
    assert f.stone == (0.4, 0.25)
    assert f.axis("r4") == 0.9
    assert f.axis("te") == 0.02


def test_a_stone_may_leave_exactly_the_least_flesh():
    """1 - 0.98 is 0.02 less a rounding."""
    assert fruit("sphere", stone=(0.98, 0.98)).stone == (0.98, 0.98)
