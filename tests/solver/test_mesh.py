"""Mesh, sampling and harmonics against closed forms and scikit-fem's own integration."""

import numpy as np
import pytest
import skfem
from scipy.special import sph_harm_y

from solver import registry
from solver.contract import InvalidGeometry
from solver.dehydration.fresh.mesh import (
    Sampler,
    build_mesh,
    corner_ratios,
    cubed_sphere,
    flesh_span,
    inner_distance,
    layer_fractions,
)
from solver.dehydration.measures.harmonics import analyse, power, quadrature, remove_low
from solver.fruit import directions, lattice


def skfem_of(mesh):
    """The same mesh as a scikit-fem object: an independent check of numbering and volume."""
    # scikit-fem counts corners of the unit cube in its own order; match them by place instead of by memory
    ours = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)], dtype=float)
    theirs = skfem.MeshHex.init_refdom().p.T
    order = [int(np.flatnonzero((ours == corner).all(axis=1))[0]) for corner in theirs]
    return skfem.MeshHex(
        np.ascontiguousarray(mesh.positions.T), np.ascontiguousarray(mesh.connectivity[:, order].T), sort_t=False
    )


@pytest.mark.parametrize("preset", sorted(registry.get("dehydration").presets))
def test_elements_are_right_handed_and_fill_the_fruit(preset):
    fruit = registry.get("dehydration").parse({}, preset=preset)
    mesh = build_mesh(fruit, 12, layer_fractions(0.6, 0.05, 1.3))
    hexes = skfem_of(mesh)
    assert hexes.is_valid()
    basis = skfem.Basis(hexes, skfem.ElementHex1())
    assert basis.dx.min() > 0
    # the volume between the outer surface and the stone, by integrating r^3 / 3 over directions of the rays
    columns = mesh.positions.reshape(-1, mesh.levels, 3)
    inner, outer = np.linalg.norm(columns[:, 0], axis=1), np.linalg.norm(columns[:, -1], axis=1)
    solid = _solid_angles(mesh.rays, mesh.sphere.quads)
    assert solid.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    expected = (solid * ((outer**3 - inner**3) / 3)[mesh.sphere.quads].mean(axis=1)).sum()
    assert basis.dx.sum() == pytest.approx(expected, rel=0.02)


def prolate(r4, **values):
    """An ellipsoid of revolution with equator r4, by its seven radii."""
    latitude = np.radians(np.linspace(-90, 90, 7))
    radii = 1 / np.sqrt(np.sin(latitude) ** 2 + (np.cos(latitude) / r4) ** 2)
    return {"radii": (*np.round(radii, 6).tolist(), values.pop("r8", r4)), **values}


#: Fruits of every kind and the least corner Jacobian ratio that their mesh was measured to have (n = 12, 6 layers).
QUALITY = {
    "sphere": ({}, 0.36),
    "jujube1": ({}, 0.25),
    "jujube2": ({}, 0.20),
    "plum1": ({}, 0.6),
    "plum2": ({}, 0.25),
    "raisin": ({}, 0.2),
    "wolfberry": ({}, 0.2),
    "prolate": (prolate(0.3, stone=(0.4, 0.1)), 0.2),
    "prolate and flat": (prolate(0.3, stone=(0.0, 0.0), r8=0.2), 0.03),
    "flat": ({"r8": 0.2, "stone": (0.3, 0.3)}, 0.2),
    "wide": ({"r8": 2.0, "stone": (0.3, 0.3)}, 0.2),
    "stone near the skin": ({"stone": (0.97, 0.97)}, 0.8),
    "stone near the poles": ({"stone": (0.97, 0.2)}, 0.05),
    "disc": ({"stone": (0.1, 0.9)}, 0.03),
    "needle": ({"stone": (0.95, 0.05)}, 0.004),
    "no stone": ({"stone": (0.0, 0.0)}, 0.06),
}


@pytest.mark.parametrize("name", sorted(QUALITY))
def test_corner_jacobians_stay_positive(name):
    values, least = QUALITY[name]
    solver = registry.get("dehydration")
    mesh = build_mesh(solver.parse(values, preset=None if values else name), 12, layer_fractions(0.6, 0.05, 1.3))
    assert corner_ratios(mesh.positions, mesh.connectivity).min() > least


def test_a_mesh_inside_out_is_refused_with_advice():
    fruit = registry.get("dehydration").parse({}, preset="sphere")
    with pytest.raises(InvalidGeometry, match="Bring r2"):
        build_mesh(fruit, 4, np.array([0.0, 0.6, 0.4, 1.0]))


def test_corner_ratio_of_a_brick_is_one_and_of_a_mirrored_one_is_not_positive():
    brick = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)]) * [1.0, 2.0, 0.1]
    assert corner_ratios(brick, np.arange(8)[None]) == pytest.approx(1.0)
    crushed = brick.copy()
    crushed[7] = [0.2, 0.2, 0.0]
    assert corner_ratios(crushed, np.arange(8)[None])[0] < 0


def test_without_a_stone_a_small_ball_is_left_out():
    solver = registry.get("dehydration")
    fruit = solver.parse({"stone": (0, 0)})
    mesh = build_mesh(fruit, 6, np.linspace(0, 1, 5))
    assert np.linalg.norm(mesh.positions[mesh.fixed], axis=1) == pytest.approx(0.1)
    assert flesh_span(fruit) == pytest.approx((0.9, 0.9))
    thin = solver.parse({"stone": (0, 0), "r8": 0.2})
    assert inner_distance(thin, np.eye(3)) == pytest.approx(0.08, rel=0.05)


def test_flesh_span_is_measured_along_rays():
    fruit = registry.get("dehydration").parse({"stone": (0.9, 0.2)})
    assert flesh_span(fruit) == pytest.approx((0.1, 0.8), abs=0.03)


def _solid_angles(rays, quads):
    def triangle(a, b, c):
        numerator = np.einsum("qi,qi->q", a, np.cross(b, c))
        dots = [np.einsum("qi,qi->q", p, q) for p, q in ((a, b), (b, c), (c, a))]
        return 2 * np.arctan2(numerator, 1 + sum(dots))

    a, b, c, d = np.moveaxis(rays[quads], 1, 0)
    return triangle(a, b, c) + triangle(a, c, d)


def test_volume_of_a_sphere_converges_at_second_order():
    fruit = registry.get("dehydration").parse({}, preset="sphere")
    exact = 4 / 3 * np.pi * (1.04**3 - 0.4**3)
    errors = []
    for n in (8, 16, 32):
        basis = skfem.Basis(skfem_of(build_mesh(fruit, n, layer_fractions(0.6, 0.05, 1.3))), skfem.ElementHex1())
        errors.append(exact - basis.dx.sum())
    slopes = np.diff(np.log(errors)) / np.log(0.5)
    assert slopes == pytest.approx(2.0, abs=0.1)


def test_cubed_sphere_is_closed_and_outward():
    sphere = cubed_sphere(6)
    assert len(sphere.directions) == 6 * 36 + 2  # Euler: V - E + F = 2 with E = 2 F
    a, b, c, d = np.moveaxis(sphere.directions[sphere.quads], 1, 0)
    assert (np.einsum("qi,qi->q", np.cross(c - a, d - b), a + b + c + d) > 0).all()


def test_layers_grow_inwards():
    fractions = layer_fractions(0.6, 0.03, 1.3)
    thickness = np.diff(fractions)
    assert fractions[0] == pytest.approx(0.0, abs=1e-15)
    assert fractions[-1] == 1
    assert thickness[:-1] / thickness[1:] == pytest.approx(1.3)


def test_sampling_is_fourth_order():
    theta, phi = lattice(40)
    exact = np.sin(3 * directions(theta, phi)[..., 0]) + directions(theta, phi)[..., 1] ** 5
    errors = []
    for n in (8, 16, 32):
        sphere = cubed_sphere(n)
        nodal = np.sin(3 * sphere.directions[:, 0]) + sphere.directions[:, 1] ** 5
        errors.append(np.abs(Sampler(sphere, 40)(nodal) - exact).max())
    slopes = np.diff(np.log(errors)) / np.log(0.5)
    assert slopes.min() > 3.5


def test_harmonic_power_is_parseval():
    theta, phi = lattice(48)
    field = 0.1 + 0.2 * sph_harm_y(2, 1, theta, phi).real + 0.3 * sph_harm_y(14, 5, theta, phi).real
    carried = power(analyse(field, 30))  # 30 plus the field's degree 14 is below 48: exact quadrature
    mean_square = (quadrature(48)[:, None] * field**2).sum() / (2 * 96)
    assert carried.sum() == pytest.approx(mean_square, rel=1e-12)
    assert carried[[0, 2, 14]] == pytest.approx([0.01, 0.04 / (8 * np.pi), 0.09 / (8 * np.pi)], rel=1e-10)
    high = 0.3 * sph_harm_y(14, 5, theta, phi).real
    assert remove_low(field, 3) == pytest.approx(high, abs=1e-12)
