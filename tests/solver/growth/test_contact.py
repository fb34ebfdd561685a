"""Parts of a sheet push each other apart."""

from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.energy import StepEnergy
from solver.growth.settling.minimise import quasi_newton
from solver.growth.settling.tangent import Tangent
from tests.solver.shell._meshes import sheet

DISTANCE = 0.1


def folded():
    """Return two parallel sheets nearer than the distance, the upper one shifted in its plane."""
    points, faces = sheet(5, 5, 0.15)
    x = np.concatenate([points, points + np.array([0.03, 0.02, 0.06])])
    return x, shell.topology(np.concatenate([faces, faces + len(points)]), len(x))


def brute(x, mesh, distance, stiffness):
    """Energy by samples of every triangle's nearest point, for vertices of the other sheet."""
    half, total = len(x) // 2, 0.0
    grid = np.array([(i, j, 60 - i - j) for i in range(61) for j in range(61 - i)]) / 60
    for v in range(len(x)):
        for triangle in mesh.triangles:
            if (v < half) == (triangle[0] < half):
                continue
            gap = np.linalg.norm(grid @ x[triangle] - x[v], axis=1).min()
            total += 0.5 * stiffness[v] * max(distance - gap, 0.0) ** 2
    return total


def test_energy_and_gradient_of_contact():
    x, mesh = folded()
    generator = np.random.default_rng(0)
    x = x + generator.normal(0, 0.005, x.shape)
    stiffness = generator.uniform(1, 2, len(x))
    pairs = shell.candidates(x, mesh, DISTANCE)
    found = shell.contact(x, mesh.triangles, pairs, DISTANCE, stiffness, np.zeros_like(x))
    assert found == pytest.approx(brute(x, mesh, DISTANCE, stiffness), rel=2e-3)
    gradient = np.zeros_like(x)
    shell.contact(x, mesh.triangles, pairs, DISTANCE, stiffness, gradient)
    # inner forces: no resultant, no moment
    assert np.abs(gradient.sum(axis=0)).max() < 1e-12
    assert np.abs(np.cross(x, gradient).sum(axis=0)).max() < 1e-12
    for way in generator.normal(size=(3, *x.shape)):
        ahead, behind = (
            shell.contact(x + s * way, mesh.triangles, pairs, DISTANCE, stiffness, np.zeros_like(x))
            for s in (1e-7, -1e-7)
        )
        assert (ahead - behind) / 2e-7 == pytest.approx(np.vdot(gradient, way), rel=1e-5)


def nearest(engine):
    """Least distance of a vertex from a triangle that is no neighbour."""
    state = engine.state
    x, t = state.x, state.mesh.triangles
    pairs = shell.candidates(x, state.mesh, 0.5 * DISTANCE)
    grid = np.array([(i, j, 12 - i - j) for i in range(13) for j in range(13 - i)]) / 12
    gaps = [np.linalg.norm(grid @ x[t[f]] - x[v], axis=1).min() for v, f in pairs]
    return min(gaps, default=0.5 * DISTANCE)


def test_a_strip_that_curls_up_stays_outside_itself():
    """Its rest curvature is that of one and a half turns: free, its ends would pass through each other."""
    curl = {
        "kind": "surface",
        "where": {"kind": "everywhere"},
        "frame": (1, 0, 0),
        "stretch": (1, 1),
        "curl": (2.4, 0),
    }
    common = {"shape": "strip", "aspect": 4.0, "thickness": 0.1, "step": 0.125, "remesh": 0, "tools": [curl]}

    def grown(contact):
        engine = Engine(GrowthParams.parse({**common, "contact": contact}), 250, 1e-3)
        while engine.state.time < 1 - 1e-9:
            engine.advance(1e9, until=engine.state.time + 0.125)
        return engine

    assert nearest(grown(0.0)) < 0.2 * DISTANCE
    assert nearest(grown(DISTANCE)) > 0.4 * DISTANCE


def test_energy_never_rises_in_contact():
    x, mesh = folded()
    engine = Engine(GrowthParams.parse({"shape": "sphere", "tools": []}), 50)
    state = replace(
        engine.state,
        x=x,
        mesh=mesh,
        g=shell.metric(x, mesh.triangles),
        rest=np.zeros(len(mesh.hinges)),
        held=np.zeros(x.shape, bool),
    )
    energy = StepEnergy(state, shell.Material(0.05), 0.0, (), Tangent(mesh), distance=DISTANCE)
    values = []
    for point in quasi_newton(energy, x):
        values.append(point.energy)
        if point.gradient < 1e-6 or len(values) > 300:
            break
    assert point.gradient < 1e-6
    assert values[0] > 0
    assert (np.diff(values) <= 0).all()
    # nothing but contact acts: the sheets end the distance apart
    assert values[-1] < 1e-6 * values[0]
