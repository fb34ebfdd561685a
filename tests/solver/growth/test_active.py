"""Equilibrium by need: what holds of a part and of the whole, and what is worked out only where it is needed."""

from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from solver import shell
from solver.growth.anchors import corners_of
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.remeshing.rest import edge_squares, flat_hinges
from solver.growth.settling import active
from solver.growth.settling.energy import StepEnergy, elastic
from solver.growth.settling.tangent import Tangent
from solver.growth.state import State
from solver.growth.tooling import reach

SPOT = {"kind": "spot", "at": (0.3, 0.2, 1.0), "radius": 0.4, "stretch": (1.01, 1.01), "duration": 100}
BALL = {"shape": "sphere", "thickness": 0.02, "step": 1.0, "tools": [SPOT]}


def engine(vertices: int, steps: int, tolerance: float = 1e-3, **values: Any) -> Engine:
    found = Engine(GrowthParams.parse(BALL | values), vertices, tolerance)
    for _ in range(steps):
        found.advance(1e9, until=found.state.time + 1)
    return found


def grown(**values: Any) -> State:
    return engine(400, 3, remesh=1.1, tools=[SPOT | {"stretch": (1.2, 1.05)}], **values).state


@pytest.mark.parametrize("bending", ["hinges", "mean_curvature"])
def test_a_part_feels_all_that_the_whole_does(bending):
    """Forces on free vertices, under load and beside a solid; so a part at rest is at rest in the whole."""
    state, material = grown(bending=bending), shell.Material(0.02)
    solids = GrowthParams.parse({"solids": [{"kind": "ball", "radius": 1.01}]}).solids
    whole = StepEnergy(state, material, 0.01, solids, Tangent(state.mesh), (0.0, 0.1, 0.2), bending=bending)
    part = active._part(state.mesh, state.x[:, 2] > 0.6)
    own = part.of(state)
    moved = state.x + 0.003 * np.sin(9 * state.x[:, [1, 2, 0]])
    forces = whole.part(own, part.tangent)(moved[part.vertices])[1]
    assert 50 < part.free.sum() < 0.6 * len(state.x)
    assert forces[part.free] == pytest.approx(whole(moved)[1][part.vertices[part.free]], abs=1e-12)
    assert not forces[~part.free].any()


def test_a_part_of_a_mesh_is_the_topology_of_its_triangles():
    mesh = grown().mesh
    faces = np.flatnonzero(np.arange(len(mesh.triangles)) % 7 < 5)
    found, vertices, hinges = shell.part_of(mesh, faces)
    number = np.full(mesh.vertices, -1)
    number[vertices] = np.arange(len(vertices))
    wanted = shell.topology(number[mesh.triangles[faces]], len(vertices))
    for name in wanted.__dataclass_fields__:
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    assert np.array_equal(vertices[found.hinges], mesh.hinges[hinges])


def test_what_is_far_stays_to_the_last_bit_and_the_residual_is_the_same_everywhere():
    alone = engine(1500, 1, active=True)
    still = 0
    for _ in range(9):
        before = alone.state
        alone.advance(1e9, until=before.time + 1)
        assert alone.residual <= 1e-3
        state, part = alone.state, alone._carried.habit.part
        energy = StepEnergy(state, shell.Material(0.02), 0.0, (), Tangent(state.mesh))
        assert np.abs(energy(state.x)[1]).max() <= 1e-3 * state.length
        if part is not None and alone._carried.habit.failures == 0:
            moved = (state.x != before.x).any(axis=1)
            assert not moved[~part.inside(len(moved))].any()
            still += int(moved.any())
    assert still >= 5


def test_the_error_against_the_whole_is_that_of_the_residual():
    """What parts leave out is no more than what the goal leaves out: both ways against a hundredth of the goal."""
    exact, whole, parts = engine(1000, 10, 1e-5), engine(1000, 10), engine(1000, 10, active=True)
    assert parts._carried.habit.part is not None

    def apart(one: Engine, other: Engine) -> float:
        x, y = one.state.x - one.state.x.mean(axis=0), other.state.x - other.state.x.mean(axis=0)
        u, _, v = np.linalg.svd(x.T @ y)
        return float(np.abs(x @ (u @ v) - y).max())

    assert apart(parts, exact) < 3 * apart(whole, exact) + 1e-4
    assert apart(parts, whole) < 0.1 * 0.02
    material = shell.Material(0.02)
    least, full, part = (elastic(e.state, material, "hinges") for e in (exact, whole, parts))
    assert part == pytest.approx(full, rel=0.01)
    assert part > 0.999 * least


def test_where_nothing_changes_nothing_moves():
    done = engine(600, 5, active=True, tools=[SPOT | {"duration": 3}])
    x = done.state.x
    for _ in range(3):
        done.advance(1e9, until=done.state.time + 1)
    assert np.array_equal(done.state.x, x)


def test_without_history_the_way_is_the_same_and_there_is_none_back():
    kept, bare = engine(300, 2), Engine(GrowthParams.parse(BALL), 300, history=False)
    while bare.state.time < 2 - 1e-9:
        bare.advance(1e9, until=2.0)
    assert np.array_equal(bare.state.x, kept.state.x)
    assert kept.undo()
    assert not bare.undo()


@pytest.mark.parametrize("shape", ["sphere", "disc"])
def test_slices_undo_and_remeshing_leave_the_same_bytes(shape):
    """Also on a leaf, where parts do not do: every step ends at the residual."""
    tools = [SPOT | {"stretch": (1.06, 1.06), "at": (0.5, 0.2, 1.0 if shape == "sphere" else 0.0)}]
    values = {"shape": shape, "curved": shape == "sphere", "active": True, "remesh": 1.15, "tools": tools}
    live, batch = engine(500, 0, **values), engine(500, 8, **values)
    begun = len(live.state.x)
    while live.state.time < 8 - 1e-9:
        live.advance(1e-4, until=8.0)
        assert live.residual <= 1e-3
    assert np.array_equal(live.state.x, batch.state.x)
    assert len(live.state.x) > begun
    for _ in range(3):
        assert live.undo()
    while live.state.time < 8 - 1e-9:
        live.advance(1e9, until=8.0)
    assert np.array_equal(live.state.x, batch.state.x)


def test_a_part_and_its_inverse_outlive_remeshing():
    state = grown()
    moving = state.x[:, 2] > 0.5
    part = active._part(state.mesh, moving)
    energy = StepEnergy(state, shell.Material(0.02), 0.0, (), Tangent(state.mesh)).part(part.of(state), part.tangent)
    for _ in energy.refactor(state.x[part.vertices]):
        pass
    cut = np.flatnonzero(moving[state.mesh.edges].all(axis=1))[::9]
    stayed = np.arange(len(state.x))
    pairs = np.concatenate([np.stack([stayed, stayed], -1), state.mesh.edges[cut]])
    # the mesh itself matters little here: only which vertices there are
    mesh = grown_mesh(state, cut)
    found = part.remeshed(mesh, [pairs])
    free = found.vertices[found.free]
    assert np.array_equal(np.sort(free), np.flatnonzero(moving[pairs].all(axis=1)))
    assert np.array_equal(found.vertices[found.tangent.mesh.triangles], mesh.triangles[found.faces])
    inverse = found.tangent.inverse
    assert inverse is not None
    push = np.random.default_rng(1).normal(size=(len(found.vertices), 3)) * found.free[:, None]
    # positive, as a start of L-BFGS must be
    assert np.vdot(push, inverse.apply(push)) > 0


def grown_mesh(state: State, cut: np.ndarray) -> shell.Topology:
    """Return the mesh with edges cut one after the other, each triangle at most once."""
    triangles, n = state.mesh.triangles.tolist(), len(state.x)
    for number, (i, j) in enumerate(state.mesh.edges[cut]):
        for t in [t for t in triangles if i in t and j in t]:
            triangles.remove(t)
            for old in (i, j):
                triangles.append([n + number if v == old else v for v in t])
    return shell.topology(np.array(triangles), n + len(cut))


def test_ways_along_the_surface_are_those_of_dijkstra():
    state = grown()
    i, j = state.mesh.edges.T
    lengths = np.linalg.norm(state.x[i] - state.x[j], axis=1)
    graph = csr_matrix((lengths, (i, j)), shape=(len(state.x),) * 2)
    sources = np.array([3, 40])
    whole = dijkstra(graph, directed=False, indices=sources, min_only=True)
    found = reach.ways(state.x, state.mesh.edges, sources, 0.8)
    near = whole < 0.8 - 1e-9
    assert 20 < near.sum() < len(near) - 20
    assert found[near] == pytest.approx(whole[near], rel=1e-12)
    assert not np.isfinite(found[whole > 0.8 + 1e-9]).any()


def test_numbers_of_the_rest_state_are_those_of_numpy():
    state = grown()
    g, mesh = state.g, state.mesh
    squares = np.stack([g[:, 0] + g[:, 2] - 2 * g[:, 1], g[:, 2], g[:, 0]], -1)
    total = np.bincount(mesh.face_edges.ravel(), squares.ravel())
    assert edge_squares(g, mesh) == pytest.approx(total / np.bincount(mesh.face_edges.ravel()), rel=1e-12)
    a, b, c = (squares[:, k] for k in range(3))
    cosines = np.stack([b + c - a, c + a - b, a + b - c], -1) / 2 / np.sqrt(np.stack([b * c, c * a, a * b], -1))
    angles = np.arccos(cosines)
    opposite = angles[mesh.hinge_faces, mesh.hinge_corners].sum(axis=1)
    near = np.pi - np.quantile(opposite, 0.9) + 1e-6
    assert np.array_equal(flat_hinges(g, mesh, near), np.flatnonzero(opposite > np.pi - near))
    corners = corners_of(state.x, mesh.triangles)
    middles = state.x[mesh.triangles].mean(axis=1)
    assert corners.middles == pytest.approx(middles, abs=1e-15)
    sizes = np.linalg.norm(state.x[mesh.triangles] - middles[:, None], axis=2).max(axis=1)
    assert corners.sizes == pytest.approx(sizes, rel=1e-12)
