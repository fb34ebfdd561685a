"""Mesh, sampling and harmonics against closed forms; volumes from the faces alone, by the divergence theorem."""

import numpy as np
import pytest
from scipy.special import sph_harm_y

from solver import registry
from solver.contract import InvalidGeometry
from solver.dehydration.fresh.corners import corner_ratios
from solver.dehydration.fresh.mesh import (
    Sampler,
    build_mesh,
    cubed_sphere,
    flesh_span,
    inner_distance,
    layer_fractions,
)
from solver.dehydration.measures.harmonics import analyse, power, quadrature, remove_low
from solver.fruit import directions, lattice

#: The six faces of a hexahedron whose corners' bits are xi = 4, eta = 2, zeta = 1, seen anticlockwise from outside.
FACES = np.array([[4, 6, 7, 5], [0, 1, 3, 2], [2, 3, 7, 6], [0, 4, 5, 1], [1, 5, 7, 3], [0, 2, 6, 4]])


def under(quads):
    """Signed volumes between bilinear quads (q, 4, 3) and the origin: the mean of both cuts into triangles."""
    a, b, c, d = np.moveaxis(quads, 1, 0)

    def cone(p, q, r):
        return np.einsum("qi,qi->q", p, np.cross(q, r)) / 6

    return (cone(a, b, c) + cone(a, c, d) + cone(a, b, d) + cone(b, c, d)) / 2


def volumes(mesh):
    """Of each trilinear hexahedron, from its faces."""
    faces = mesh.positions[mesh.connectivity[:, FACES]]
    return under(faces.reshape(-1, 4, 3)).reshape(-1, 6).sum(axis=1)


def skin_volume(mesh):
    """Volume within the faces that only one element has."""
    faces = mesh.connectivity[:, FACES].reshape(-1, 4)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    assert count.max() == 2
    return under(mesh.positions[faces[first[count == 1]]]).sum()


def test_a_brick_s_volume_comes_from_its_faces():
    corners = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)]) * [1.0, 2.0, 3.0] + [4.0, -5.0, 0.3]
    assert under(corners[FACES]).sum() == pytest.approx(6.0, rel=1e-13)


@pytest.mark.parametrize("preset", sorted(registry.get("dehydration").presets))
def test_elements_are_right_handed_and_fill_the_fruit(preset):
    fruit = registry.get("dehydration").parse({}, preset=preset)
    # the rule below is off by 6 % at 12 for a banana, whose tips are sharp, and by n^-2 of that on finer meshes
    mesh = build_mesh(fruit, 24, layer_fractions(0.6, 0.05, 1.3))
    each = volumes(mesh)
    assert each.min() > 0
    # what two elements share cancels only if both number its corners alike
    assert each.sum() == pytest.approx(skin_volume(mesh), rel=1e-12)
    # the volume between the outer surface and the stone, by integrating r^3 / 3 over directions of the rays
    columns = mesh.positions.reshape(-1, mesh.levels, 3)
    inner, outer = np.linalg.norm(columns[:, 0], axis=1), np.linalg.norm(columns[:, -1], axis=1)
    solid = _solid_angles(mesh.rays, mesh.sphere.quads)
    assert solid.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    expected = (solid * ((outer**3 - inner**3) / 3)[mesh.sphere.quads].mean(axis=1)).sum()
    assert each.sum() == pytest.approx(expected, rel=0.02)


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


def test_corner_ratios_are_those_of_the_trilinear_map() -> None:
    """By determinants of its derivatives at the corners."""
    rng = np.random.default_rng(0)
    bits = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)])
    positions = bits + rng.uniform(-0.4, 0.4, (40, 8, 3))
    signs = 2 * bits - 1
    for cell, found in zip(
        positions, corner_ratios(positions.reshape(-1, 3), np.arange(320).reshape(40, 8)), strict=True
    ):
        values = []
        for at in signs:
            shape = (1 + signs * at) / 2
            slopes = [signs[:, i] / 2 * np.delete(shape, i, axis=1).prod(axis=1) for i in range(3)]
            values.append(np.linalg.det(np.array(slopes) @ cell))
        assert found == pytest.approx(min(values) / max(np.abs(values)), rel=1e-9)


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
        errors.append(exact - volumes(build_mesh(fruit, n, layer_fractions(0.6, 0.05, 1.3))).sum())
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
