"""Thin-shell kernels against twins, finite differences and closed forms of sheets and shells."""

import numpy as np
import pytest

from solver import shell
from solver.contract import InvalidGeometry
from solver.shell import Material

from ._meshes import angle_twin, ball, membrane_twin, sheet

LAME = Material(0.1, 0.3).lame


@pytest.fixture(scope="module")
def crumpled():
    generator = np.random.default_rng(0)
    points, faces = sheet(6, 7)
    x = points + generator.normal(0, 0.15, points.shape)
    g = shell.metric(points + generator.normal(0, 0.1, points.shape), faces)
    return x, shell.topology(faces, len(x)), g, generator


def energy_and_gradient(x, mesh, g, rest, stiffness):
    gradient = np.zeros_like(x)
    energy = shell.membrane(x, mesh.triangles, g, LAME, gradient)
    return energy + shell.bending(x, mesh.hinges, rest, stiffness, gradient), gradient


def test_membrane_equals_its_twin(crumpled):
    x, mesh, g, _ = crumpled
    energy = shell.membrane(x, mesh.triangles, g, LAME, np.zeros_like(x))
    assert energy == pytest.approx(membrane_twin(x, mesh.triangles, g, LAME), rel=1e-12)


def test_angles_equal_their_twin_and_are_positive_where_convex(crumpled):
    x, mesh, _, _ = crumpled
    assert shell.angles(x, mesh.hinges) == pytest.approx([angle_twin(x, h) for h in mesh.hinges], abs=1e-7)
    points, faces = ball(200)
    assert shell.angles(points, shell.topology(faces, 200).hinges).min() > 0


def test_gradient_is_the_difference_of_energies(crumpled):
    x, mesh, g, generator = crumpled
    rest, stiffness = generator.normal(0, 0.3, len(mesh.hinges)), shell.hinge_stiffness(g, mesh, 0.05)
    _, gradient = energy_and_gradient(x, mesh, g, rest, stiffness)
    step = 1e-6
    for way in generator.normal(size=(5, *x.shape)):
        ahead, _ = energy_and_gradient(x + step * way, mesh, g, rest, stiffness)
        behind, _ = energy_and_gradient(x - step * way, mesh, g, rest, stiffness)
        slope = np.vdot(gradient, way)
        assert (ahead - behind) / (2 * step) == pytest.approx(slope, rel=1e-6)


def test_mean_curvature_bending_equals_its_twin_and_its_gradient_is_the_difference_of_energies(crumpled):
    x, mesh, g, generator = crumpled
    rest = generator.normal(0, 0.3, len(mesh.hinges))
    lengths, stiffness = shell.mean_stiffness(g, mesh, 0.05)

    def energy(y):
        return shell.mean_bending(y, mesh.hinges, rest, lengths, stiffness, np.zeros_like(y))

    area, total = shell.areas(g), 0.0
    for v in range(len(x)):
        own = (mesh.triangles == v).any(axis=1)
        mean = 0.0
        for hinge, angle, faces, corners in zip(mesh.hinges, rest, mesh.hinge_faces, mesh.hinge_corners, strict=True):
            if v in hinge[:2]:
                edges = [
                    (g[f, 0] + g[f, 2] - 2 * g[f, 1], g[f, 2], g[f, 0])[c] for f, c in zip(faces, corners, strict=True)
                ]
                mean += np.sqrt(np.mean(edges)) * (angle_twin(x, hinge) - angle) / 4
        total += 2 * 0.05 * mean**2 / (area[own].sum() / 3)
    assert energy(x) == pytest.approx(total, rel=1e-6)
    gradient = np.zeros_like(x)
    shell.mean_bending(x, mesh.hinges, rest, lengths, stiffness, gradient)
    for way in generator.normal(size=(5, *x.shape)):
        slope = np.vdot(gradient, way)
        assert (energy(x + 1e-6 * way) - energy(x - 1e-6 * way)) / 2e-6 == pytest.approx(slope, rel=1e-6)


def test_mean_curvature_bends_cylinders_and_spheres_like_a_plate_without_gaussian_curvature():
    """Energy per area D (2 H)^2 / 2: D kappa^2 / 2 on a cylinder, four times that on a sphere of the same curvature."""
    points, faces = sheet(40, 40, 0.02)
    kappa = 1.5
    inner = (np.abs(points[:, 0] - 0.4) < 0.3) & (np.abs(points[:, 1] - 0.34) < 0.25)
    x = np.stack([np.sin(kappa * points[:, 0]) / kappa, points[:, 1], np.cos(kappa * points[:, 0]) / kappa], -1)
    mesh = shell.topology(faces, len(x))
    g = shell.metric(points, faces)
    lengths, stiffness = shell.mean_stiffness(g, mesh, 0.05)
    # other vertices out of the sum
    energy = shell.mean_bending(x, mesh.hinges, np.zeros(len(mesh.hinges)), lengths, inner * stiffness, 0 * x)
    area = np.bincount(faces.ravel(), np.repeat(shell.areas(g) / 3, 3), len(x))
    assert energy == pytest.approx(0.05 * kappa**2 / 2 * area[inner].sum(), rel=2e-3)
    points, faces = ball(1500)
    mesh, g = shell.topology(faces, len(points)), shell.metric(points, faces)
    lengths, stiffness = shell.mean_stiffness(g, mesh, 0.05)
    flat = np.zeros(len(mesh.hinges))
    energy = shell.mean_bending(points, mesh.hinges, flat, lengths, stiffness, 0 * points)
    assert energy == pytest.approx(0.05 * 4 / 2 * 4 * np.pi, rel=0.02)
    # grown evenly, with the same rest angles, it is the same sphere: rest mean curvature went down by 1 / s
    lengths, stiffness = shell.mean_stiffness(9 * g, mesh, 0.05)
    rest = shell.angles(points, mesh.hinges)
    assert shell.mean_bending(3 * points, mesh.hinges, rest, lengths, stiffness, 0 * points) < 1e-24


def dense(pattern, blocks, n):
    full = np.zeros((3 * n, 3 * n))
    rows = np.repeat(np.arange(n), np.diff(pattern.indptr))
    for r, c, block in zip(rows, pattern.indices, blocks, strict=True):
        full[3 * r : 3 * r + 3, 3 * c : 3 * c + 3] = block
    return full


def tangent(x, mesh, g, stiffness):
    pattern = shell.pattern(mesh)
    blocks = np.zeros((pattern.blocks, 3, 3))
    shell.membrane_tangent(x, mesh.triangles, g, LAME, pattern.of_triangles, blocks)
    shell.bending_tangent(x, mesh.hinges, stiffness, pattern.of_hinges, blocks)
    return dense(pattern, blocks, len(x))


def test_tangent_is_symmetric_and_positive_semidefinite(crumpled):
    x, mesh, g, _ = crumpled
    full = tangent(x, mesh, g, shell.hinge_stiffness(g, mesh, 0.05))
    assert np.abs(full - full.T).max() < 1e-12 * np.abs(full).max()
    assert np.linalg.eigvalsh(full).min() > -1e-12 * np.abs(full).max()


def test_tangent_is_exact_where_the_sheet_is_stretched_and_hinges_rest(crumpled):
    """Then nothing is left out: it is the derivative of the gradient."""
    x, mesh, _, generator = crumpled
    g = 0.5 * shell.metric(x, mesh.triangles)
    rest, stiffness = shell.angles(x, mesh.hinges), shell.hinge_stiffness(g, mesh, 0.05)
    full, way, step = tangent(x, mesh, g, stiffness), generator.normal(size=x.shape), 1e-6
    _, ahead = energy_and_gradient(x + step * way, mesh, g, rest, stiffness)
    _, behind = energy_and_gradient(x - step * way, mesh, g, rest, stiffness)
    expected = ((ahead - behind) / (2 * step)).ravel()
    assert full @ way.ravel() == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_uniform_stretch_costs_what_the_material_says():
    points, faces = sheet(5, 5)
    g, s = shell.metric(points, faces), 1.3
    energy = shell.membrane(s * points, faces, g, LAME, np.zeros_like(points))
    e = (s * s - 1) / 2
    assert energy == pytest.approx(shell.areas(g).sum() * (2 * LAME + 2) * e * e, rel=1e-12)


@pytest.mark.parametrize("turn", [0.0, 17.0, 30.0, 50.0])
def test_a_cylinder_bends_like_a_plate_whatever_way_it_lies(turn):
    """Energy per area D kappa^2 / 2, as many hinges of each direction."""
    points, faces = sheet(40, 40, 0.02)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    flat = points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    kappa = 0.5
    x = np.stack([np.sin(kappa * flat[:, 0]) / kappa, flat[:, 1], np.cos(kappa * flat[:, 0]) / kappa], -1)
    mesh, g = shell.topology(faces, len(x)), shell.metric(points, faces)
    # one hinge of each direction stands for a cell of the lattice
    along = points[mesh.hinges[:, 1]] - points[mesh.hinges[:, 0]]
    direction = np.round(np.degrees(np.arctan2(along[:, 1], along[:, 0])) / 60).astype(int) % 3
    theta, k = shell.angles(x, mesh.hinges), shell.hinge_stiffness(g, mesh, 1.0)
    per_hinge = np.mean([(k * theta**2)[direction == d].mean() for d in range(3)])
    area_of_hinge = shell.areas(g)[0] * 2 / 3
    assert per_hinge / area_of_hinge == pytest.approx(kappa**2 / 2, rel=1e-3)


def test_rest_curvature_gives_the_angles_of_a_curved_surface():
    """Corners on a paraboloid of small slope: hinges are the sums of both triangles' angles, and back again."""
    points, faces = sheet(8, 8, 0.01)
    generator = np.random.default_rng(1)
    points[:, :2] += generator.normal(0, 0.001, points[:, :2].shape)
    form = np.array([[0.3, 0.1], [0.1, -0.2]])
    x = points.copy()
    x[:, 2] = -0.5 * np.einsum("ni,ij,nj->n", points[:, :2], form, points[:, :2])
    mesh, g = shell.topology(faces, len(x)), shell.metric(points, faces)
    a, b = points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]

    def apply(u, v):
        return np.einsum("fi,ij,fj->f", u[:, :2], form, v[:, :2])

    second = np.stack([apply(a, a), apply(a, b), apply(b, b)], -1)
    theta = shell.angles(x, mesh.hinges)
    assert shell.added_angles(second, g, mesh) == pytest.approx(theta, abs=1e-3 * np.abs(theta).max())
    # there and back: exact angles where the second forms come from angles
    known = shell.from_angles(theta, g, mesh)
    assert shell.added_angles(known, g, mesh) == pytest.approx(theta, abs=1e-12)


def test_rest_lengths_that_make_no_triangle_are_refused():
    assert shell.metric_of_lengths(np.array([[3.0, 4.0, 5.0]]))[0] == pytest.approx([25.0, 16.0, 16.0])
    with pytest.raises(InvalidGeometry, match="rest edge"):
        shell.metric_of_lengths(np.array([[3.0, 1.0, 1.0]]))


@pytest.mark.parametrize(
    ("faces", "says"),
    [
        ([[0, 1, 2], [0, 1, 3]], "opposite senses"),
        ([[0, 1, 2], [1, 0, 3], [0, 1, 4]], "three or more"),
        ([[0, 1, 1]], "same vertex twice"),
        ([[0, 1, 9]], "not there"),
    ],
)
def test_meshes_that_are_no_surface_are_refused(faces, says):
    with pytest.raises(InvalidGeometry, match=says):
        shell.topology(np.array(faces), 5)
