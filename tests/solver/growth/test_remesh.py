"""Flips and collapses: the same rest state told by other triangles."""

from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.growth.anchors import place
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.remeshing.collapses import collapse
from solver.growth.remeshing.flips import flip
from solver.growth.remeshing.remesh import remesh
from solver.linalg.abreast import finished

MATERIAL = shell.Material(0.05)


def flat(seed: int = 0, jitter: float = 0.0, **values):
    """Return a flat strip whose inner vertices are shifted in the plane, at rest."""
    engine = Engine(GrowthParams.parse({"shape": "strip", "aspect": 1.5, "imperfection": 0, "tools": []} | values), 300)
    state = engine.state
    inner = np.ones(len(state.x), bool)
    inner[state.mesh.edges[state.mesh.border]] = False
    x = state.x.copy()
    x[inner, :2] += np.random.default_rng(seed).uniform(-jitter, jitter, (inner.sum(), 2)) * state.length
    return replace(state, x=x, g=shell.metric(x, state.mesh.triangles))


def energy(state, x):
    gradient = np.zeros_like(x)
    stiffness = shell.hinge_stiffness(state.g, state.mesh, MATERIAL.flexural)
    return shell.membrane(x, state.mesh.triangles, state.g, MATERIAL.lame, gradient) + shell.bending(
        x, state.mesh.hinges, state.rest, stiffness, gradient
    )


def stretched(x):
    """An affine map of the plane: both tellings of the rest state have the same energy under it."""
    return x @ np.array([[1.2, 0.1, 0.0], [-0.05, 0.9, 0.0], [0.0, 0.0, 1.0]])


def angle_sums(state):
    p = state.x[state.mesh.triangles]
    found = np.zeros(len(state.mesh.edges))
    for k in range(3):
        u, v = p[:, (k + 1) % 3] - p[:, k], p[:, (k + 2) % 3] - p[:, k]
        angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(-1))
        np.add.at(found, state.mesh.face_edges[:, k], angle)
    return found


def test_flips_make_a_flat_rest_state_delaunay_and_keep_its_energy():
    state = flat(jitter=0.35)
    before = energy(state, stretched(state.x))
    assert angle_sums(state).max() > np.pi + 0.1
    turned = state
    for _ in range(20):
        following = flip(turned)
        if following is turned:
            break
        turned = following
    assert not np.array_equal(turned.mesh.triangles, state.mesh.triangles)
    assert np.array_equal(turned.x, state.x)
    # margin of the rule, and the folds it leaves alone, of which a flat sheet has none
    assert angle_sums(turned).max() < np.pi + 0.1
    assert turned.g == pytest.approx(shell.metric(turned.x, turned.mesh.triangles), rel=1e-9, abs=1e-12)
    assert energy(turned, stretched(state.x)) == pytest.approx(before, rel=1e-12)


def test_collapses_remove_short_edges_and_keep_a_flat_rest_state():
    state = flat(jitter=0.4)
    before = energy(state, stretched(state.x))
    spot = place(np.array([[0.11, 0.07, 0.0]]), state.x, state.mesh.triangles)
    state = replace(state, curves={0: spot}, shares={1: state.x[:, 0].copy()})
    coarser, left = collapse(state, 0.6 * state.length)
    assert len(coarser.x) < len(state.x)
    assert np.array_equal(coarser.x, state.x[left])
    assert coarser.g == pytest.approx(shell.metric(coarser.x, coarser.mesh.triangles), rel=1e-9, abs=1e-12)
    assert shell.areas(coarser.g).sum() == pytest.approx(shell.areas(state.g).sum(), rel=1e-12)
    assert energy(coarser, stretched(coarser.x)) == pytest.approx(before, rel=1e-12)
    assert coarser.curves[0].at(coarser.x, coarser.mesh.triangles)[0] == pytest.approx([0.11, 0.07, 0.0], abs=1e-12)
    assert np.array_equal(coarser.shares[1], coarser.x[:, 0])


def test_a_sphere_stays_a_sphere_when_edges_collapse():
    """New hinges are bent as the old ones about them: the total rest curvature is that of the sphere."""
    engine = Engine(GrowthParams.parse({"shape": "sphere", "imperfection": 0, "tools": []}), 600)
    state = engine.state
    x = state.x + 0.35 * state.length * np.random.default_rng(0).uniform(-1, 1, state.x.shape)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    state = replace(state, x=x, g=shell.metric(x, state.mesh.triangles), rest=shell.angles(x, state.mesh.hinges))
    coarser, _ = collapse(state, 0.7 * state.length)
    assert len(coarser.x) < len(state.x)
    lengths = np.linalg.norm(coarser.x[coarser.mesh.hinges[:, 0]] - coarser.x[coarser.mesh.hinges[:, 1]], axis=1)
    # integral of mean curvature over a unit sphere: half the sum of lengths times angles
    assert lengths @ coarser.rest / 2 == pytest.approx(4 * np.pi, rel=0.03)
    assert shell.areas(coarser.g).sum() == pytest.approx(shell.areas(state.g).sum(), rel=0.01)


def test_remeshing_takes_back_what_cuts_near_an_end_have_left():
    """Edges of a lattice cut at an eighth of their length: the short parts go, and the lattice is as it was."""
    state = flat()
    mesh, triangles, points = state.mesh, state.mesh.triangles.tolist(), list(state.x)
    taken = np.zeros(len(state.x), bool)
    taken[mesh.edges[mesh.border]] = True
    for j, k in mesh.edges.tolist():
        sides = [t for t in triangles if j in t and k in t]
        if np.max(sides) < len(state.x) and not taken[sides].any():
            taken[sides] = True
            for side in sides:
                triangles.remove(side)
                triangles += [[len(points) if v == old else v for v in side] for old in (j, k)]
            points.append(state.x[j] + 0.125 * (state.x[k] - state.x[j]))
    x, top = np.array(points), shell.topology(np.array(triangles), len(points))
    assert len(x) > len(state.x) + 10
    rest = np.zeros(len(top.hinges))
    # of an edge's two ends the one that nothing holds goes
    held = np.repeat(np.arange(len(x)) < len(state.x), 3).reshape(-1, 3)
    work = remesh(replace(state, x=x, mesh=top, g=shell.metric(x, top.triangles), rest=rest, held=held), 0.15, 10**6)
    assert 0.125 * state.length < 0.25 * 0.15 < 0.9 * state.length
    found, _ = finished(work)
    assert np.array_equal(found.x, state.x)
    assert {frozenset(t) for t in found.mesh.triangles.tolist()} == {frozenset(t) for t in mesh.triangles.tolist()}
    assert energy(found, stretched(found.x)) == pytest.approx(energy(state, stretched(state.x)), rel=1e-12)
