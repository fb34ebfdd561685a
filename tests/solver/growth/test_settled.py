"""What is returned is in balance on the mesh, and against the rest state, that are returned with it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import bsr_array

from solver import shell
from solver.contract import Context
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling import newton
from solver.growth.settling.energy import StepEnergy
from solver.growth.settling.stage import residual, settled
from solver.growth.settling.tangent import Tangent

from ._differences import differences

RIM = {"kind": "surface", "where": {"kind": "rim", "width": 0.3}, "stretch": (1.5, 1.0)}
SPOT = {"kind": "spot", "at": (0.0, 0.0, 1.0), "radius": 0.6, "stretch": (2.5, 2.5)}


def largest_force(engine: Engine, state, count: int = 60) -> float:
    """Largest force [mu l] at some places, from differences of the energy of the returned arrays, and their normals."""
    p = engine.params
    material = shell.Material(p.thickness, p.poisson)
    stiffness = shell.hinge_stiffness(state.g, state.mesh, material.flexural)
    corners = state.x[state.mesh.triangles]
    thirds = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 6
    push = np.zeros_like(state.x)
    for corner in range(3):
        np.add.at(push, state.mesh.triangles[:, corner], p.pressure * thirds)

    def energy(x):
        nothing = np.zeros_like(x)
        return shell.membrane(x, state.mesh.triangles, state.g, material.lame, nothing) + shell.bending(
            x, state.mesh.hinges, state.rest, stiffness, nothing
        )

    generator, found, small = np.random.default_rng(3), 0.0, 1e-5 * state.length
    # where edges are shortest the last remeshing was: half of the places lie there
    edges = state.mesh.edges
    lengths = np.linalg.norm(state.x[edges[:, 0]] - state.x[edges[:, 1]], axis=1)
    near = edges[np.argsort(lengths)[: count // 2]].ravel()
    for vertex in [*generator.choice(near, count // 2), *generator.integers(0, len(state.x), count // 2)]:
        for axis in range(3):
            if state.held[vertex, axis]:
                continue
            move = np.zeros_like(state.x)
            move[vertex, axis] = small
            force = (energy(state.x + move) - energy(state.x - move)) / (2 * small) - push[vertex, axis]
            found = max(found, abs(force))
    return found


@pytest.mark.parametrize(
    "words",
    [
        {"shape": "disc", "tools": [RIM]},
        {"shape": "disc", "tools": [RIM], "plasticity": 0.5, "yield_strain": 0.01},
        {"shape": "sphere", "tools": [SPOT], "pressure": 0.1, "remesh": 1.2},
    ],
    ids=["grown", "plastic", "blown"],
)
def test_what_is_returned_is_settled_on_its_own_mesh(words):
    engine = Engine(GrowthParams.parse({"thickness": 0.05, "step": 0.1} | words), 200, 1e-3, history=False)
    begun = len(engine.state.x)
    state = engine.reach(0.8, Context())
    # a sheet of thickness t and edges l feels forces of D / l, D = t^2 / (6 (1 - nu))
    felt = 0.05**2 / (6 * (1 - engine.params.poisson)) / state.length
    assert len(state.x) > begun, "the mesh was cut on the way"
    assert largest_force(engine, state) <= 1.05e-3 * felt
    assert largest_force(engine, engine.reach(0.85, Context())) <= 1.05e-3 * felt, "between whole steps as well"


def test_a_flat_sheet_that_must_buckle_is_not_settled_on_its_saddle():
    """Its rim is too long, and nothing pushes it out of its plane; the energy's curvatures are a dense matrix's."""
    params = GrowthParams.parse({"shape": "disc", "imperfection": 0.0, "tools": []})
    flat = Engine(params, 120).state
    middle = flat.x[flat.mesh.triangles].mean(axis=1)
    grown = replace(flat, g=flat.g * (1 + 0.5 * (middle**2).sum(axis=1))[:, None])
    *_, found = settled(grown, params, 1e-3, 0.0)
    assert found.minimum
    assert not flat.x[:, 2].any(), "it starts in its plane"
    assert np.ptp(found.x[:, 2]) > params.thickness
    energy = StepEnergy(found, shell.Material(params.thickness), 0.0, (), Tangent(found.mesh))
    curvatures = np.linalg.eigvalsh(energy.hessian(found.x).toarray())
    assert (np.abs(curvatures[:6]) < 1e-8).all(), "it may be moved and turned"
    assert curvatures[6] > 1e-8, "and costs energy along every other way"
    # rounding does not decide whether that is seen: as many coordinates are pinned as there are rigid motions
    matrix, rigid = energy.hessian(found.x), energy.rigid(found.x)
    blocks = newton._definite(matrix, energy.diagonal, rigid, 0.0)
    pinned = bsr_array((blocks, matrix.indices, matrix.indptr)).toarray()
    assert np.linalg.eigvalsh(pinned)[0] > 1e-8
    assert np.count_nonzero(pinned - matrix.toarray()) == rigid.shape[1] == 6


@pytest.mark.parametrize(("thickness", "softer"), [(0.01, True), (0.5, False)])
def test_the_residual_is_relative_to_the_softer_of_bending_and_membrane(thickness: float, softer: bool):
    """Largest force over D / l, D = t^2 / (6 (1 - nu)), where that is less than the membrane's mu l."""
    params = GrowthParams.parse({"thickness": thickness, "poisson": 0.25, "tools": []})
    state = replace(Engine(params, 2000).state, forces=3e-4)
    folded = thickness**2 / (6 * (1 - 0.25)) / state.length
    assert (folded < state.length) == softer
    assert residual(state, params) == pytest.approx(3e-4 * state.length / min(folded, state.length), rel=1e-12)


def test_stages_do_not_depend_on_each_other():
    """Settling a stage leaves the way on as it was."""

    def end(*before: float):
        engine = Engine(GrowthParams.parse({"shape": "disc", "tools": [RIM], "step": 0.1}), 150, 1e-3, history=False)
        for time in before:
            engine.reach(time, Context())
        return engine.reach(0.6, Context()).x

    assert np.array_equal(end(), end(0.2, 0.45))


@pytest.mark.parametrize(("shape", "pressure"), [("disc", 0.0), ("sphere", 0.7)])
def test_second_derivatives_are_those_of_differences(shape: str, pressure: float):
    """Of membrane, bending and the volume inside, on a mesh that is far from rest: differences, column by column."""
    engine = Engine(GrowthParams.parse({"shape": shape, "thickness": 0.5, "tools": []}), 60)
    state, generator = engine.state, np.random.default_rng(0)
    x = state.x + 0.1 * state.length * generator.normal(size=state.x.shape)
    energy = StepEnergy(state, shell.Material(0.5), pressure, (), Tangent(state.mesh), following=True)
    assert energy.following == (pressure > 0)
    matrix = energy.hessian(x).toarray()
    slopes, columns = differences(energy, x)
    assert np.abs(matrix - columns).max() <= 1e-7 * np.abs(columns).max()
    gradient = energy(x)[1].ravel()
    assert np.abs(gradient - slopes).max() <= 1e-6 * np.abs(gradient).max()


def test_a_direction_is_newton_s_where_the_matrix_is_definite():
    """Against a dense solve; none is given where an eigenvalue is negative."""
    engine = Engine(GrowthParams.parse({"shape": "sphere", "thickness": 0.5, "tools": []}), 160)
    state = engine.state
    x = state.x + 0.02 * state.length * np.random.default_rng(1).normal(size=state.x.shape)
    energy = StepEnergy(state, shell.Material(0.5), 0.0, (), Tangent(state.mesh))
    matrix, gradient, order = energy.hessian(x), energy(x)[1], energy.analysis(x)
    dense = matrix.toarray()
    least = float(np.linalg.eigvalsh(dense)[0])
    assert least < -1e-6, "both cases are to be seen"
    exact = -np.linalg.solve(dense + 1.2 * abs(least) * np.eye(x.size), gradient.ravel())
    found = newton._direction(order, newton._shifted(matrix.data, energy.diagonal, 1.2 * abs(least)), gradient)
    assert found is not None
    assert np.abs(found.ravel() - exact).max() <= 1e-9 * np.abs(exact).max()
    assert newton._direction(order, newton._shifted(matrix.data, energy.diagonal, 0.8 * abs(least)), gradient) is None
