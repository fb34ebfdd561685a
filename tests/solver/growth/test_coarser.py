"""A coarser sheet is the finer one's: where it lies, what it rests at, and where it leads."""

from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.contract import Context
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling import coarser as module
from solver.growth.settling import equilibrium
from solver.growth.settling.cells import carried, coarser
from solver.growth.settling.coarser import begun_coarser
from solver.growth.settling.energy import StepEnergy
from solver.growth.settling.minimise import longest
from solver.growth.settling.tangent import Tangent
from solver.linalg.abreast import finished

THICKNESS = 0.05


def fresh(shape, vertices, **more):
    values = {"shape": shape, "thickness": THICKNESS, "imperfection": 0.0, "tools": []} | more
    return Engine(GrowthParams.parse(values), vertices).state


def energy_of(state):
    return StepEnergy(state, shell.Material(THICKNESS), 0.0, (), Tangent(state.mesh))


@pytest.mark.parametrize("shape", ["disc", "half_disc", "strip", "tube", "sphere", "torus"])
def test_a_coarser_mesh_is_of_the_same_kind_and_knows_where_each_vertex_lies(shape):
    state = fresh(shape, 3000, aspect=3.0)
    found = coarser(state.mesh, state.x)
    assert found is not None
    assert 1 / 25 < len(found.seeds) / len(state.x) < 1 / 6
    for mesh in (state.mesh, found.mesh):
        # Euler's number and whether there is a border tell these shapes apart
        kind = mesh.vertices - len(mesh.edges) + len(mesh.triangles), bool(len(mesh.border))
        assert kind == {"sphere": (2, False), "torus": (0, False), "tube": (0, True)}.get(shape, (1, True))
    assert np.abs(found.weights.sum(axis=1) - 1).max() < 1e-12
    y = state.x[found.seeds]
    there = (y[found.corners] * found.weights[:, :, None]).sum(axis=1)
    edge = np.linalg.norm(np.diff(y[found.mesh.edges], axis=1)[:, 0], axis=1).mean()
    assert np.linalg.norm(there - state.x, axis=1).max() < (1e-12 if not np.ptp(state.x[:, 2]) else 0.25 * edge)
    own = np.linalg.norm(there[found.seeds] - y, axis=1)
    assert own.max() < 1e-12, "a vertex of the coarser sheet is where it is"
    areas = [shell.areas(shell.metric(x, mesh.triangles)).sum() for x, mesh in ((state.x, state.mesh), (y, found.mesh))]
    assert areas[1] == pytest.approx(areas[0], rel=0.05)


def test_what_moves_linearly_is_carried_over_exactly_and_what_bends_does_not_kink():
    state = fresh("disc", 3000)
    found = coarser(state.mesh, state.x)
    y = state.x[found.seeds]
    matrix = np.random.default_rng(1).normal(size=(3, 3))
    there = carried(found, state.x, y, y @ matrix.T)
    assert np.abs(there - state.x @ matrix.T).max() < 1e-12

    def raised(x):
        return np.column_stack([0 * x[:, 0], 0 * x[:, 0], np.cos(4 * x[:, 0])])

    inner = np.linalg.norm(state.x, axis=1) < 0.8
    smooth = np.abs(carried(found, state.x, y, raised(y)) - raised(state.x))[inner].max()
    between = (raised(y)[found.corners] * found.weights[:, :, None]).sum(axis=1)
    assert smooth < 0.5 * np.abs(between - raised(state.x))[inner].max()


def test_a_coarser_sheet_rests_where_the_finer_one_does():
    """Grown evenly its rest metric is that much larger; rolled up, its rest angles are those of the flat sheet."""
    state = fresh("disc", 3000)
    grown = replace(state, g=1.3**2 * state.g)
    found = coarser(state.mesh, state.x)
    sheet = module._sheet(energy_of(grown), found, grown.x)
    assert np.abs(sheet.g - 1.3**2 * shell.metric(sheet.x, sheet.mesh.triangles)).max() < 1e-12
    assert np.abs(sheet.rest).max() < 1e-9
    x = state.x
    rolled = np.column_stack([0.5 * np.sin(2 * x[:, 0]), x[:, 1], 0.5 * (1 - np.cos(2 * x[:, 0]))])
    sheet = module._sheet(energy_of(state), found, rolled)
    bent = shell.angles(sheet.x, sheet.mesh.hinges)
    # the rim's triangles are uneven
    middle = np.linalg.norm(state.x[found.seeds][sheet.mesh.hinges].mean(axis=1), axis=1) < 0.8
    assert np.abs(sheet.rest[middle]).max() < 0.2 * np.abs(bent).max()
    assert np.abs(sheet.rest[middle].mean()) < 0.02 * np.abs(bent).max()


@pytest.mark.parametrize("imperfection", [0.02, 0.0])
def test_what_a_coarser_sheet_shows_is_lower_and_ends_in_balance(imperfection, monkeypatch):
    """Through buckling, cut where slices end, and the same bytes either way."""
    tool = {"kind": "surface", "where": {"kind": "rim", "width": 0.4}, "stretch": (1.4, 1.0)}
    values = {"shape": "disc", "thickness": 0.03, "curved": False, "imperfection": imperfection, "step": 0.25}
    params, shown = GrowthParams.parse(values | {"tools": [tool]}), []

    def watched(energy, x, goal):
        there = yield from begun_coarser(energy, x, goal, 500)
        if there is not x:
            shown.append((energy(x)[0], energy(there)[0]))
        return there

    monkeypatch.setattr(equilibrium, "begun_coarser", watched)
    ends = []
    for slice_ in (np.inf, 0.0):
        engine = Engine(params, 800, 1e-3)
        while engine.state.time < 1 - 1e-9:
            engine.advance(slice_, until=1.0)
        ends.append(engine.state.x)
        assert engine.residual <= 1e-3
    assert np.array_equal(*ends)
    assert np.ptp(ends[0][:, 2]) > 0.1, "it has buckled"
    assert len(shown) >= 4
    assert all(then <= now for now, then in shown)
    assert min(then / now for now, then in shown) < 0.5, "most of the way"


def test_a_sheet_that_is_held_stays_where_it_is(monkeypatch):
    held = [{"where": {"kind": "band", "along": "x", "low": 0.4, "high": 1.0}}]
    tool = {"kind": "surface", "where": {"kind": "rim", "width": 0.4}, "stretch": (1.4, 1.0)}
    values = {"shape": "disc", "thickness": 0.03, "curved": False, "attached": held, "tools": [tool], "step": 0.5}
    used = []
    monkeypatch.setattr(equilibrium, "begun_coarser", lambda *a: used.append(1) or begun_coarser(*a, 300))
    engine = Engine(GrowthParams.parse(values | {"remesh": 0}), 800)
    begun, state = engine.state, engine.reach(0.5, Context())
    assert used
    assert begun.held.any()
    assert np.array_equal(state.x[state.held], begun.x[begun.held])


def test_a_sheet_whose_cells_make_no_surface_goes_its_own_way():
    """A strip that is one triangle wide has no cells with three neighbours."""
    n = 300
    x = np.column_stack([np.arange(n) * 0.5, np.arange(n) % 2, np.zeros(n)])
    k = np.arange(n - 2)
    faces = np.where((k % 2 == 0)[:, None], np.stack([k, k + 2, k + 1], -1), np.stack([k, k + 1, k + 2], -1))
    mesh = shell.topology(faces, n)
    assert coarser(mesh, x) is None
    state = fresh("disc", 60)
    state = replace(
        state, x=x, mesh=mesh, g=shell.metric(x, faces), rest=np.zeros(len(mesh.hinges)), held=np.zeros((n, 3), bool)
    )
    energy = energy_of(replace(state, g=1.21 * state.g))
    assert longest(energy(x)[1]) > 0
    assert finished(begun_coarser(energy, x, 0.0, 10)) is x
