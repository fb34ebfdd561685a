"""What is handed over lies on what was solved, and what crossed no longer does."""

from __future__ import annotations

import numpy as np
import pytest

from solver import registry
from solver.dehydration.fresh.mesh import Sampler, build_mesh
from solver.dehydration.measures.delivery import Delivery, even_out, on_triangles
from solver.dehydration.measures.penetration import of_lattice, of_quads
from solver.fruit import directions, lattice
from solver.geometry.crossings import split_quads

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


@pytest.mark.parametrize("resolution", [32, 64, 128])
def test_folds_that_do_not_cross_are_delivered_so(resolution):
    """A groove around the waist, wider inside than at its mouth, where its walls are a fiftieth of an edge apart."""
    mesh = build_mesh(FRUIT, 24, np.linspace(0, 1, 3))
    nodes = grooved(mesh.sphere.directions, 0.0005)
    assert of_quads(nodes, mesh.sphere.quads).count == 0
    fresh = mesh.positions[mesh.surface_nodes]
    spline = FRUIT.surface(*lattice(resolution)) + Sampler(mesh.sphere, resolution)(nodes - fresh)
    given = Delivery(FRUIT, mesh, resolution, "float32")(nodes)
    assert given.found.count == 0
    assert of_lattice(given.position.astype(float)).count == 0
    linear = (on_triangles(mesh.sphere, Sampler(mesh.sphere, resolution)) @ nodes).reshape(given.position.shape)
    off = np.linalg.norm(given.position - linear, axis=-1).max()
    assert given.moved == pytest.approx(off, abs=1e-6)  # float32 rounds by 1e-7
    assert given.moved < 0.05
    assert of_lattice(spline).count > 0


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
