"""What is handed over lies on what was solved, and what crossed no longer does."""

from __future__ import annotations

import numpy as np
import pytest

from solver import registry
from solver.dehydration.fresh.mesh import Sampler, build_mesh
from solver.dehydration.fresh.sector import cut
from solver.dehydration.measures.delivery import Delivery, even_out
from solver.dehydration.measures.facets import on_triangles
from solver.dehydration.measures.penetration import of_lattice, of_quads
from solver.dehydration.measures.rounded import Rounded
from solver.fruit import directions, lattice
from solver.geometry.crossings import split_quads
from solver.lattice import closed_lattice

from ._skins import grooved

FRUIT = registry.get("dehydration").parse({}, preset="sphere")


@pytest.mark.parametrize("n", [5, 8])
def test_lattice_points_lie_on_the_triangles(n):
    """On a faceted ball whose nodes are anywhere: each point has a triangle with which it spans no volume."""
    sphere = build_mesh(FRUIT, n, np.linspace(0, 1, 3)).sphere
    nodes = sphere.directions * np.random.default_rng(1).uniform(0.9, 1.1, (len(sphere.directions), 1))
    points = on_triangles(sphere, Sampler(sphere, 12)) @ nodes
    a, b, c = nodes[split_quads(sphere.quads)].swapaxes(0, 1)
    inside = np.full((len(points), len(a)), True)
    for tail, head in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ti,pi->pt", np.cross(tail, head), points) > -1e-9
    height = abs(np.einsum("ti,pti->pt", np.cross(b - a, c - a), points[:, None] - a[None]))
    assert np.where(inside, height, np.inf).min(axis=1).max() < 1e-12


def test_a_smooth_surface_is_read_by_splines():
    mesh = build_mesh(FRUIT, 12, np.linspace(0, 1, 3))
    nodes = 0.9 * mesh.positions[mesh.surface_nodes]
    displacement, position, found, moved = Delivery(FRUIT, mesh, 32, "float64")(nodes)
    assert found.count == moved == 0
    assert abs(np.linalg.norm(position, axis=-1) - 0.9 * 1.04).max() < 1e-5  # facets are off by 2e-3
    assert abs(np.linalg.norm(displacement, axis=-1) - 0.1 * 1.04).max() < 1e-5


def grooved_fruit(width):
    """A mesh of 24 elements an edge whose nodes have a groove around the waist, so wide at its mouth."""
    mesh = build_mesh(FRUIT, 24, np.linspace(0, 1, 3))
    return mesh, grooved(mesh.sphere.directions, width)


def by_splines(mesh, nodes, resolution):
    shift = nodes - mesh.positions[mesh.surface_nodes]
    return FRUIT.surface(*lattice(resolution)) + Sampler(mesh.sphere, resolution)(shift)


def off_triangles(mesh, nodes, resolution):
    found = on_triangles(mesh.sphere, Sampler(mesh.sphere, resolution)) @ nodes
    return found.reshape(resolution, 2 * resolution, 3)


@pytest.mark.parametrize("resolution", [32, 64, 128])
def test_folds_that_do_not_cross_are_delivered_so(resolution):
    """A groove wider inside than at its mouth, where its walls are a fiftieth of an edge apart."""
    mesh, nodes = grooved_fruit(0.0005)
    assert of_quads(nodes, mesh.sphere.quads).count == 0
    spline = by_splines(mesh, nodes, resolution)
    assert of_lattice(spline).count > 0
    given = Delivery(FRUIT, mesh, resolution, "float32")(nodes)
    assert given.found.count == 0
    assert of_lattice(given.position.astype(float)).count == 0
    readings = spline, off_triangles(mesh, nodes, resolution)
    off = np.minimum(*(np.linalg.norm(given.position - reading, axis=-1) for reading in readings)).max()
    assert given.moved == pytest.approx(off, abs=1e-6)  # float32 rounds by 1e-7
    assert 0 < given.moved < 0.05


def turning(position):
    """Root mean square of how normals differ over the edges of a closed lattice's triangles, by their area."""
    n = len(position)
    points, triangles = np.concatenate([position.reshape(-1, 3), position[[0, -1]].mean(axis=1)]), closed_lattice(n)
    a, b, c = points[triangles].swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    beside = np.lexsort(edges.T).reshape(-1, 2) % len(triangles)
    turn = (np.diff((normal / area[:, None])[beside], axis=1) ** 2).sum(axis=(1, 2))
    return np.sqrt(np.average(turn, weights=area[beside].sum(axis=1)))


def test_a_fold_is_as_smooth_as_splines_and_not_cut_into_facets():
    mesh, nodes = grooved_fruit(0.0005)
    given = Delivery(FRUIT, mesh, 128, "float64")(nodes)
    spline = by_splines(mesh, nodes, 128)
    assert turning(off_triangles(mesh, nodes, 128)) > 1.1 * turning(spline)
    assert turning(given.position) < turning(spline)


def test_what_does_not_cross_is_left_to_splines():
    mesh, nodes = grooved_fruit(0.0005)
    given = Delivery(FRUIT, mesh, 64, "float64")(nodes)
    off = np.linalg.norm(given.position - by_splines(mesh, nodes, 64), axis=-1)
    outside = abs(directions(*lattice(64))[..., 2]) > 0.95
    assert off[outside].max() < 1e-12
    assert off[~outside].max() > 0.001


def test_a_finer_lattice_rounds_where_a_coarser_one_does_and_no_less():
    """So that a shape's creases do not turn sharp from one resolution to the next."""
    mesh, nodes = grooved_fruit(0.0005)
    coarse, fine = (Delivery(FRUIT, mesh, n, "float64")._levels(nodes) for n in (64, 192))
    assert coarse.max() > 0
    assert (fine >= coarse).all()
    assert (fine > coarse).any()


def test_what_crosses_as_solved_is_evened_out():
    """Walls that went through each other by a tenth of an element."""
    mesh, nodes = grooved_fruit(-0.005)
    assert of_quads(nodes, mesh.sphere.quads).count > 0
    given = Delivery(FRUIT, mesh, 64, "float64")(nodes)
    assert given.found.count == of_lattice(given.position).count == 0
    assert given.moved < 0.1


@pytest.mark.parametrize("per_element", [1, 2])
def test_b_splines_hold_what_is_linear_and_no_more_than_nodes_span(per_element):
    sphere = build_mesh(FRUIT, 6, np.linspace(0, 1, 3)).sphere
    sampler = Sampler(sphere, 24)
    rounded = Rounded(sphere, sampler, per_element)
    # on one face alone: its neighbours see other angles
    nodal = np.zeros(len(sphere.directions))
    angle = np.linspace(-np.pi / 4, np.pi / 4, 7)
    nodal[sphere.faces[0]] = 2 * angle[:, None] - 3 * angle[None, :]
    here = sampler.face == 0
    linear = 2 * sampler.alpha - 3 * sampler.beta
    assert abs(rounded(nodal[:, None])[here, 0] - linear[here]).max() < 1e-12
    step = (sphere.directions[:, 0] > 0.1).astype(float)
    read = rounded(step[:, None])
    assert read.min() >= -1e-12
    assert read.max() <= 1 + 1e-12
    assert Sampler(sphere, 24)(step).max() > 1.02


def test_evening_out_touches_what_crosses_alone():
    points = directions(*lattice(24))
    bent = points.copy()
    bent[12, 10] *= -1.05
    assert of_lattice(bent).count > 0
    even, found = even_out(bent)
    assert found.count == 0
    assert of_lattice(even).count == 0
    moved = (even != bent).any(axis=-1)
    assert moved[12, 10]
    assert moved.mean() < 0.2
    assert np.array_equal(even_out(points)[0], points)


@pytest.mark.parametrize("mirrors", ["y", "xz", "xyz"])
def test_what_is_mirrored_is_handed_over_so(mirrors):
    """Its triangles are not: each quad of a lattice is cut from one corner to the opposite one."""
    mesh, nodes = grooved_fruit(0.0005)
    nodes = nodes + 0.01 * np.prod(nodes, axis=1)[:, None] ** 2
    fruit = registry.get("dehydration").parse({**FRUIT.model_dump(mode="json"), "mirrors": mirrors})
    sector = cut(mesh, mirrors)
    nodes = sector.whole(nodes[sector.own])
    given = Delivery(fruit, mesh, 64, "float64")(nodes)
    assert given.moved > 0
    # colatitudes from the pole y > 0, azimuths from x towards z
    n = 64
    images = {
        "x": lambda p: np.roll(p[:, ::-1], 1 - n, axis=1) * [-1, 1, 1],
        "y": lambda p: p[::-1] * [1, -1, 1],
        "z": lambda p: np.roll(p[:, ::-1], 1, axis=1) * [1, 1, -1],
    }
    for name in mirrors:
        assert abs(images[name](given.position) - given.position).max() < 1e-12
