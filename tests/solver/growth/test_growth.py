"""Growth against closed forms, conservation and its own promises."""

from time import process_time

import numpy as np
import pytest

from solver import registry, shell
from solver.contract import InvalidInput, Need, NotConverged, SolverError
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.remeshing.cuts import cut
from solver.growth.settling.energy import StepEnergy, elastic
from solver.growth.settling.minimise import conjugate_gradients, lbfgs, quasi_newton
from solver.growth.settling.tangent import Tangent
from solver.growth.tooling.tools import HotSpot

EVERYWHERE = {"kind": "everywhere"}


def grow(vertices: int, until: float, tolerance: float = 1e-3, **values) -> Engine:
    engine = Engine(GrowthParams.parse(values), vertices, tolerance)
    while engine.state.time < until - 1e-9:
        engine.advance(1e9, until=engine.state.time + engine.params.step)
    return engine


def surface(**values):
    return {"kind": "surface", "where": EVERYWHERE} | values


@pytest.mark.parametrize(("shape", "step"), [("sphere", 0.1), ("disc", 0.1), ("sphere", 1.0)])
def test_uniform_growth_is_scaling_without_energy(shape, step):
    """Also when lengths grow threefold in one step."""
    engine = grow(
        300, 1.0, 1e-11, shape=shape, step=step, remesh=0, imperfection=0, tools=[surface(stretch=(3.0, 3.0))]
    )
    state, begun = engine.state, Engine(engine.params, 300).state
    i, j = state.mesh.edges.T

    def lengths(x):
        return np.linalg.norm(x[i] - x[j], axis=1)

    assert lengths(state.x) == pytest.approx(3 * lengths(begun.x), rel=1e-9)
    row = registry.get("growth").solve(
        engine.params, Need(stages=(1.0,), quality="preview", fields=("stored_energy", "rest_area"))
    )
    assert float(row.stored_energy[0]) < 1e-5 * float(row.rest_area[0])


@pytest.mark.parametrize("shape", ["sphere", "disc"])
def test_uniform_growth_costs_no_mean_curvature_either(shape):
    tools = [surface(stretch=(3.0, 3.0))]
    engine = grow(
        300, 1.0, 1e-10, shape=shape, step=0.05, remesh=0, imperfection=0, bending="mean_curvature", tools=tools
    )
    x = Engine(engine.params, 300).state.x
    i, j = engine.state.mesh.edges.T
    y = engine.state.x
    grown = np.linalg.norm(y[i] - y[j], axis=1) / np.linalg.norm(x[i] - x[j], axis=1)
    assert grown == pytest.approx(3.0, rel=1e-8)


@pytest.mark.parametrize(("pressure", "least"), [(0.0, 1e-13), (0.02, 1e-7)])
def test_a_goal_below_rounding_is_met_at_rounding(pressure, least):
    """Without energy what is left is the forces' last digits; with energy, what no step can see.

    How many steps that takes hangs on the processor's rounding (150 to 220 seen); anywhere it ends by itself, well
    before the engine's limit of 4000.
    """
    tools = [surface(stretch=(3.0, 3.0))]
    engine = grow(300, 0.5, 1e-30, pressure=pressure, step=0.5, remesh=0, imperfection=0, tools=tools)
    assert 0 < engine.residual < least
    assert engine.state.iterations < 2000


def test_a_goal_below_rounding_is_not_met_before():
    tools = [surface(where={"kind": "band", "along": "radius", "low": 0.6, "high": 1.0}, stretch=(2.0, 1.0))]
    engine = Engine(GrowthParams.parse({"shape": "disc", "step": 0.5, "tools": tools}), 150, 1e-30, most=60)
    with pytest.raises(NotConverged):
        engine.advance(1e9, until=0.5)


def test_a_curled_sheet_is_a_cylinder():
    """Rest curvature kappa about one axis and none along the other: no energy on a cylinder of radius 1 / kappa."""
    engine = grow(
        400,
        1.0,
        1e-6,
        shape="strip",
        aspect=2.0,
        thickness=0.05,
        step=0.25,
        tools=[surface(frame=(1.0, 0.0, 0.0), stretch=(1.0, 1.0), curl=(1.5, 0.0))],
    )
    x = engine.state.x
    # nothing holds the sheet: its own principal axes are those of the cylinder
    _, _, axes = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)
    plane = x @ axes[[0, 2]].T if abs(axes[1, 1]) > 0.99 else x @ axes[[1, 2]].T
    a = np.column_stack([2 * plane, np.ones(len(x))])
    centre = np.linalg.lstsq(a, (plane**2).sum(axis=1), rcond=None)[0]
    radii = np.linalg.norm(plane - centre[:2], axis=1)
    assert radii == pytest.approx(1 / 1.5, rel=0.005)


def test_a_sphere_under_pressure_swells_as_shells_do():
    """Membrane theory: 2 sigma / R = p with sigma = 2 (lame + 1) e, small strain e = dR / R."""
    p = 1e-3
    engine = grow(600, 0.1, 1e-7, step=0.1, pressure=p, imperfection=0, tools=[surface(stretch=(1.0, 1.0))])
    radius = np.linalg.norm(engine.state.x, axis=1).mean()
    sigma = 2 * (shell.Material(0.03).lame + 1)
    assert radius - 1 == pytest.approx(p / (2 * sigma), rel=0.03)


def test_the_energy_never_rises_and_three_ways_lead_to_one_place():
    params = GrowthParams.parse({"imperfection": 1.0, "thickness": 0.05, "remesh": 0})
    state = Engine(params, 300).state
    ends = []
    for way in (quasi_newton, lbfgs, conjugate_gradients):
        energy = StepEnergy(state, shell.Material(0.05), 0.0, (), Tangent(state.mesh))
        energies = []
        for point in way(energy, state.x):
            energies.append(point.energy)
            if point.gradient < 1e-8 or len(energies) > 5000:
                break
        assert point.gradient < 1e-8
        assert max(np.diff(energies)) <= 0
        ends.append(energy(point.x)[0])
    assert max(ends) < 1e-12


def test_splitting_keeps_membrane_energy_places_and_anchors():
    engine = grow(300, 0.3, step=0.1, remesh=0, tools=[{"kind": "spot", "at": (0.1, 0.2, 1.0), "stretch": (4.0, 2.0)}])
    state = engine.state

    def membrane(s):
        return shell.membrane(s.x, s.mesh.triangles, s.g, 1.0, np.zeros_like(s.x))

    finer = cut(state, 1.05 * state.length)[0]
    assert len(finer.x) > len(state.x) + 10
    assert membrane(finer) == pytest.approx(membrane(state), rel=1e-12)
    assert np.array_equal(finer.x[: len(state.x)], state.x)
    assert shell.areas(finer.g).sum() == pytest.approx(shell.areas(state.g).sum(), rel=1e-12)
    before = state.spots[0][0].anchor.at(state.x, state.mesh.triangles)
    assert finer.spots[0][0].anchor.at(finer.x, finer.mesh.triangles) == pytest.approx(before, abs=1e-12)


def test_splitting_keeps_the_rest_curvature_of_a_sphere():
    """Total mean curvature, half the sum of length times angle, is 4 pi on the unit sphere (Steiner)."""
    state = Engine(GrowthParams(imperfection=0), 600).state
    while len(state.x) < 5000:
        state = cut(state, 0.6 * state.length)[0]
        edges = state.mesh.edges[state.mesh.hinge_edges]
        lengths = np.linalg.norm(state.x[edges[:, 0]] - state.x[edges[:, 1]], axis=1)
        assert 0.5 * lengths @ state.rest == pytest.approx(4 * np.pi, rel=0.02)


def test_splitting_again_and_again_leaves_no_slivers():
    state = grow(200, 0.1, step=0.1, remesh=0, tools=[surface(stretch=(1.0, 1.0))]).state
    for _ in range(4):
        state = cut(state, 0.7 * state.length)[0]
    p = state.x[state.mesh.triangles]
    edges = np.stack([p[:, (k + 2) % 3] - p[:, (k + 1) % 3] for k in range(3)], 1)
    size = np.linalg.norm(edges, axis=-1)
    sines = (
        2
        * shell.areas(shell.metric(state.x, state.mesh.triangles))[:, None]
        / (np.roll(size, 1, axis=1) * np.roll(size, 2, axis=1))
    )
    assert np.degrees(np.arcsin(np.clip(sines, 0, 1))).min() > 20


def test_slices_and_tools_between_them_replay_as_a_batch():
    values = {"step": 0.1, "thickness": 0.08, "tools": [surface(stretch=(1.3, 1.3))]}
    live = Engine(GrowthParams.parse(values), 200)
    while live.state.time < 0.2 - 1e-9:
        live.advance(1e-4, until=0.2)
    live.add(HotSpot(at=(0.0, 0.0, 1.0), radius=0.6, stretch=(3.0, 3.0)))
    while live.state.time < 0.5 - 1e-9:
        live.advance(1e-4, until=0.5)
    batch = grow(200, 0.5, **live.script.model_dump())
    assert np.array_equal(live.state.x, batch.state.x)
    assert live.script.tools[1].start == pytest.approx(0.2)


def test_no_piece_of_a_step_is_as_long_as_a_factorisation():
    """Pieces of a first step, which takes an inverse of its own, on 3000 vertices: none is a half of it."""
    tool = surface(where={"kind": "band", "along": "radius", "low": 0.6, "high": 1.0}, stretch=(1.3, 1.0))
    params = GrowthParams.parse({"shape": "disc", "step": 0.1, "tools": [tool]})
    shares = []
    for _ in range(2):  # the first compiles
        engine, pieces, done = Engine(params, 3000), [], False
        while not done:
            begun = process_time()
            done = engine.advance(0.0, until=0.1)
            pieces.append(process_time() - begun)
        assert len(pieces) > 20
        shares.append(max(pieces) / sum(pieces))
    assert min(shares) < 0.5


def test_undo_goes_back_one_step_and_forgets_later_tools():
    engine = grow(200, 0.2, step=0.1, thickness=0.08)
    x, tools = engine.state.x, len(engine.script.tools)
    engine.add(HotSpot(at=(0.0, 0.0, 1.0)))
    engine.advance(1e9, until=0.3)
    assert engine.undo()
    assert np.array_equal(engine.state.x, x)
    assert len(engine.script.tools) == tools + 1
    assert engine.undo()
    assert engine.undo()
    assert len(engine.script.tools) == tools
    assert engine.undo() is False


def test_undo_and_the_same_way_again_give_the_same_bytes():
    engine = grow(200, 0.3, step=0.1, thickness=0.08, remesh=1.1, tools=[surface(stretch=(1.6, 1.2))])
    x = engine.state.x
    for _ in range(2):
        assert engine.undo()
    while engine.state.time < 0.3 - 1e-9:
        engine.advance(1e9, until=engine.state.time + 0.1)
    assert np.array_equal(engine.state.x, x)


def test_plasticity_forgets_what_is_beyond_the_yield():
    """Also in the five steps after growth has ended."""
    spot = {"kind": "spot", "at": (0.0, 0.0, 1.0), "radius": 0.5, "stretch": (5.0, 5.0), "duration": 0.5}
    common = {"step": 0.1, "thickness": 0.05, "tools": [spot]}
    stiff, soft = grow(300, 1.0, **common), grow(300, 1.0, plasticity=0.8, yield_strain=0.001, **common)

    def worst(state):
        ratio = shell.areas(shell.metric(state.x, state.mesh.triangles)) / shell.areas(state.g)
        return np.abs(np.sqrt(ratio) - 1).max()

    assert worst(soft.state) < 0.7 * worst(stiff.state)


def test_held_vertices_stay_and_solids_keep_their_inside_free():
    held = {"where": {"kind": "band", "along": "x", "low": 0.0, "high": 0.6}}
    engine = grow(
        300,
        0.4,
        shape="disc",
        step=0.1,
        remesh=0,
        attached=[held],
        solids=[{"kind": "plane", "point": (0.0, 0.0, -0.02)}],
        tools=[surface(stretch=(1.8, 1.8))],
    )
    begun = Engine(engine.params, 300).state
    assert begun.held.any()
    assert np.array_equal(engine.state.x[engine.state.held], begun.x[begun.held])
    assert np.ptp(engine.state.x[:, 2]) > 0.1
    assert engine.state.x[:, 2].min() > -0.045


HOSTILE = {
    "threefold at once": {"tools": [surface(stretch=(3.0, 3.0))], "step": 1.0},
    "no growth": {"tools": [surface(stretch=(1.0, 1.0))]},
    "no tools": {"tools": []},
    "shrinking": {"tools": [surface(stretch=(0.4, 0.4))], "step": 0.5},
    "perfect buckling": {"shape": "disc", "imperfection": 0, "tools": [surface(stretch=(2.0, 1.0))], "step": 0.25},
    "spot on a border": {"shape": "disc", "tools": [{"kind": "spot", "at": (1.0, 0.0, 0.0)}], "step": 0.25},
    "spot finer than the mesh": {"tools": [{"kind": "spot", "at": (0, 0, 1), "radius": 0.01, "stretch": (9.0, 9.0)}]},
    "tenfold along one way": {"shape": "strip", "tools": [surface(frame=(1, 0, 0), stretch=(10.0, 1.0))]},
    # it crumples: parts that keep apart take seconds
    "plastic and remeshed": {
        "plasticity": 1.0,
        "remesh": 1.1,
        "tools": [surface(stretch=(2.5, 1.0))],
        "step": 0.25,
        "contact": 0.0,
    },
    "paper thin": {"thickness": 0.001, "tools": [{"kind": "spot", "at": (0, 0, 1), "stretch": (3.0, 3.0)}]},
}
#: Which of them may end in an error, with the last equilibrium kept. At exact symmetry round-off alone says which way a
#: sheet buckles: in steps of .25 that finds an equilibrium with one thread of BLAS, as runs have, and not with two.
MAY_FAIL = frozenset({"plastic and remeshed", "perfect buckling"})


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_growth_ends_in_an_equilibrium_or_a_typed_error(name):
    values = {"thickness": 0.05, "step": 0.2, **HOSTILE[name]}
    solver = registry.get("growth")
    engine = Engine(solver.parse(values), 150, 1e-3, most=600)
    failure: SolverError | None = None
    try:
        while engine.state.time < 0.99:
            engine.advance(1e9, until=engine.state.time + engine.params.step)
    except SolverError as error:
        failure = error
    assert engine.residual <= 1e-3
    assert np.isfinite(engine.state.x).all()
    if failure is not None:
        assert isinstance(failure, NotConverged)
        assert failure.advice
        assert name in MAY_FAIL


def test_tools_that_the_shape_cannot_have_are_refused():
    solver = registry.get("growth")
    need = Need(stages=(0.05,), quality="preview")
    with pytest.raises(InvalidInput, match="no rim"):
        solver.solve(solver.parse({"tools": [surface(where={"kind": "rim", "width": 0.1})]}), need)
    with pytest.raises(InvalidInput, match="painted"):
        solver.solve(solver.parse({"tools": [surface(where={"kind": "painted", "values": [1.0]})]}), need)
    with pytest.raises(InvalidInput, match="rise"):
        solver.parse({"tools": [surface(activation=[(1.0, 1.0), (0.5, 0.0)])]})


def test_the_bulge_of_a_hot_spot_converges_with_the_mesh():
    """Energy of second order, as 1.95 was measured between 640, 2560 and 10240 vertices; here smaller meshes.

    Heights are within 0.1 % of the bulge from 640 vertices on: two errors, of either sign, have no order there.
    """
    spot = {"kind": "spot", "at": (0.0, 0.0, 1.0), "radius": 0.8, "stretch": (1.3, 1.3)}
    heights, energies = [], []
    for vertices in (160, 640, 2560):
        engine = grow(vertices, 1.0, 1e-5, imperfection=0, remesh=0, thickness=0.1, step=0.25, tools=[spot])
        heights.append(np.ptp(engine.state.x[:, 2]) - 2)
        energies.append(elastic(engine.state, shell.Material(0.1, 0.3), "hinges"))
    assert np.log2((energies[1] - energies[0]) / (energies[2] - energies[1])) > 1.5
    assert heights[:2] == pytest.approx([heights[2]] * 2, rel=0.01)
    assert heights[1] == pytest.approx(heights[2], rel=0.002)
