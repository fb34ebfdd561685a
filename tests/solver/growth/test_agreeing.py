"""What edges grow by: energy of a growth that a flat sheet can follow is the mesh's alone, and falls fast with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.growth.fresh import fresh
from solver.growth.params import GrowthParams
from solver.growth.shapes import start
from solver.growth.tooling.agreeing import agreed
from solver.growth.tooling.places import Everywhere
from solver.growth.tooling.rates import grown as rates_grown
from solver.growth.tooling.rates import rates
from solver.growth.tooling.tools import HotSurface

#: Growth of length exp(A x).
A = 0.7


def grown(vertices: int):
    """Return the energies over area of a square grown by exp(A x), on the map e^(A z) / A that follows it exactly.

    As each triangle grows evenly, by the mean of its corners, and as its edges do. The metric e^(2 A x) |dz|^2 is flat,
    as A x is harmonic.
    """
    mesh = start("square", vertices, 1.0)
    z = A * (mesh.x[:, 0] + 1j * mesh.x[:, 1])
    w = np.exp(z) / A
    x = np.stack([w.real, w.imag, np.zeros(len(w))], -1)
    tool = HotSurface(where=Everywhere(), stretch=(np.e, np.e))
    params = GrowthParams(shape="square", tools=(), imperfection=0.0)
    state = replace(fresh(params, mesh), shares={0: A * mesh.x[:, 0]})
    found = rates(state, {0: tool}, 0.0)
    before = shell.metric(mesh.x, mesh.triangles)
    own = before * np.exp(2 * A * mesh.x[mesh.triangles][:, :, 0].mean(axis=1))[:, None]
    together = rates_grown(state, found, 1.0)[0]
    return [shell.membrane(x, mesh.triangles, g, 1.0, np.zeros_like(x)) / shell.areas(g).sum() for g in (own, together)]


def test_what_a_flat_sheet_can_follow_costs_next_to_nothing():
    coarse, fine = grown(500), grown(2000)
    assert coarse[1] < coarse[0] / 10_000
    # evenly by the square of the mesh, edge by edge by its fourth power
    assert coarse[0] / fine[0] == pytest.approx(4, rel=0.1)
    assert coarse[1] / fine[1] == pytest.approx(16, rel=0.1)


def test_what_grows_evenly_is_left_as_it_is():
    mesh = start("torus", 300, 3.0)
    top, before = shell.topology(mesh.triangles, len(mesh.x)), shell.metric(mesh.x, mesh.triangles)
    ratios = np.full(before.shape, 1.44)
    found = agreed(before, 1.44 * before, ratios, top.face_edges, len(top.edges))
    assert found == pytest.approx(1.44 * before, rel=1e-13)


def test_a_triangle_that_would_collapse_keeps_its_own_growth():
    """Two triangles on an edge, of which one grows it tenfold and the other not at all."""
    before = np.array([[1.0, 0.5, 1.0], [1.0, 0.5, 1.0]])
    own = np.array([[100.0, 50.0, 100.0], [1.0, 0.5, 1.0]])
    found = agreed(before, own, own[:, [0]] * np.ones(3), np.array([[0, 1, 2], [3, 4, 2]]), 5)
    lengths = np.sqrt(np.array([found[1, 0] + found[1, 2] - 2 * found[1, 1], found[1, 2], found[1, 0]]))
    assert np.array_equal(found[1], own[1])
    assert lengths == pytest.approx(1.0)
    assert found[0, 0] == pytest.approx(50.5)


def test_an_edge_grows_by_the_mean():
    before = np.array([[1.0, 0.5, 1.0], [1.0, 0.5, 1.0]])
    own = before * np.array([[1.2], [1.0]])
    found = agreed(before, own, own[:, [0]] * np.ones(3), np.array([[0, 1, 2], [3, 4, 2]]), 5)
    assert found[:, 0] == pytest.approx(1.1)
    assert found[:, 2] == pytest.approx([1.2, 1.0])
