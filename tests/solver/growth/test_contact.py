"""Parts of a sheet push each other apart."""

from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.contract import Context, InvalidGeometry, Need
from solver.geometry.crossings import crossings
from solver.growth import SOLVER
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling import stage
from solver.growth.settling.energy import StepEnergy
from solver.growth.settling.minimise import quasi_newton
from solver.growth.settling.tangent import Tangent
from solver.growth.settling.touching import Touching
from solver.growth.shapes import Mesh
from tests.solver.shell._meshes import sheet

DISTANCE = 0.1


def folded():
    """Return two parallel sheets nearer than the distance, the upper one shifted in its plane."""
    points, faces = sheet(5, 5, 0.15)
    x = np.concatenate([points, points + np.array([0.03, 0.02, 0.06])])
    return x, shell.topology(np.concatenate([faces, faces + len(points)]), len(x))


def test_a_flat_sheet_feels_no_contact_however_thick():
    """What is near at rest keeps a share of its rest distance: no force, three edges' thickness or not."""
    for thickness in (0.01, 0.15, 0.3):
        engine = Engine(GrowthParams.parse({"shape": "disc", "thickness": thickness, "imperfection": 0}), 150)
        state = engine.state
        touching = Touching(state, thickness, 1.0, np.ones(len(state.x)))
        gradient = np.zeros_like(state.x)
        assert touching.energy(state.x, gradient) == 0.0
        assert not gradient.any()


def test_a_rolled_sheet_feels_no_contact_however_thick():
    """Where it is not flat, what is near at rest is looked at, and feels nothing until it is half as near."""
    engine = Engine(GrowthParams.parse({"shape": "disc", "thickness": 0.3, "imperfection": 0}), 150)
    x, radius = engine.state.x, 0.6
    rolled = np.stack([radius * np.sin(x[:, 0] / radius), x[:, 1], radius * (1 - np.cos(x[:, 0] / radius))], axis=1)
    touching = Touching(replace(engine.state, x=rolled), 0.3, 1.0, np.ones(len(x)))
    gradient = np.zeros_like(x)
    assert len(touching.pairs.stencils) > 100
    assert touching.energy(rolled, gradient) == 0.0


def test_what_is_coupled_is_told_from_what_was_found_last():
    """Sheets a little further apart than their distance: found, and coupled, where there is room."""
    x, mesh = folded()
    x[len(x) // 2 :, 2] = 0.115
    state = replace(Engine(GrowthParams.parse({"shape": "disc"}), 150).state, x=x, mesh=mesh)
    state = replace(state, g=shell.metric(x, mesh.triangles), held=np.zeros(x.shape, bool))
    touching = Touching(state, DISTANCE, 1.0, np.ones(len(x)))
    touching.look(x, 0.0)
    assert touching.coupled(x, 24) is None
    touching.look(x)
    coupled = touching.coupled(x, 24)
    assert coupled is not None
    # one order serves both who ask at one place
    assert touching.coupled(x, 24) is coupled


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

    def through(contact):
        engine = Engine(GrowthParams.parse({**common, "contact": contact}), 250, 1e-3)
        while engine.state.time < 1 - 1e-9:
            engine.advance(1e9, until=engine.state.time + 0.125)
            if contact != 0:
                assert not crossings(engine.state.x, engine.state.mesh.triangles).count
        return crossings(engine.state.x, engine.state.mesh.triangles).count

    assert through(0.0) > 20
    assert through(DISTANCE) == 0
    # not asked for, it is the thickness, from the step on in which parts come that near
    assert through(None) == 0


def test_where_no_part_comes_near_another_contact_costs_a_look_and_changes_no_byte():
    tool = {"kind": "spot", "at": (0, 0, 1), "radius": 0.5, "stretch": (3.0, 3.0)}
    ends = []
    for contact in (0.0, None):
        engine = Engine(GrowthParams.parse({"tools": [tool], "step": 0.25, "contact": contact}), 200, 1e-3)
        ends.append(engine.reach(1.0, Context()).x)
        assert engine.distance == 0.0
    assert np.array_equal(*ends)


def test_what_comes_near_only_when_a_stage_settles_is_kept_apart_too():
    """A loose tolerance leaves most of the curling to the end, where a stage is settled."""
    curl = {
        "kind": "surface",
        "where": {"kind": "everywhere"},
        "frame": (1, 0, 0),
        "stretch": (1, 1),
        "curl": (4.0, 0),
    }
    values = {"shape": "strip", "aspect": 6.0, "thickness": 0.03, "step": 0.25, "remesh": 0, "tools": [curl]}
    counts = []
    for contact in (0.0, None):
        state = Engine(GrowthParams.parse({**values, "contact": contact}), 60, 1e-3).reach(1.0, Context())
        counts.append(crossings(state.x, state.mesh.triangles).count)
    assert counts[0] > 100
    assert counts[1] == 0


def test_a_stage_that_settles_free_is_left_when_parts_pass_through_each_other(monkeypatch):
    """Not at its end: what comes after the crossing is thrown away."""
    tool = {"kind": "surface", "where": {"kind": "everywhere"}, "frame": (1, 0, 0), "stretch": (1, 1), "curl": (4.0, 0)}
    values = {"shape": "strip", "aspect": 6.0, "thickness": 0.03, "step": 0.25, "remesh": 0, "tools": [tool]}
    taken = []

    def counted(state, params, tolerance, distance):
        taken.append([distance])
        for nearer in stage.settled(state, params, tolerance, distance):
            taken[-1].append(crossings(nearer.x, nearer.mesh.triangles).count)
            yield nearer

    monkeypatch.setattr("solver.growth.engine.settled", counted)
    state = Engine(GrowthParams.parse(values), 60, 1e-3).reach(1.0, Context())
    (free, *crossed), (kept, *apart) = taken
    assert (free, kept) == (0.0, 0.03)
    assert crossed[-1] > 0
    # looked at every eight steps
    assert sum(count > 0 for count in crossed) <= 8
    assert not any(apart)
    assert not crossings(state.x, state.mesh.triangles).count


def test_a_shape_that_passes_through_itself_is_refused_unless_it_may(monkeypatch):
    points, faces = sheet(5, 5, 0.2)
    x = np.concatenate([points, points[:, [0, 2, 1]] + np.array([0.03, 0.41, -0.45])])
    both = Mesh(x, np.concatenate([faces, faces + len(points)]))
    monkeypatch.setattr("solver.growth.engine.start", lambda *_: both)
    with pytest.raises(InvalidGeometry, match="passes through itself") as caught:
        Engine(GrowthParams.parse({"shape": "disc", "contact": 0.05}), 50)
    assert "contact = 0" in caught.value.advice
    Engine(GrowthParams.parse({"shape": "disc", "contact": 0.0}), 50)


def pierced(x, triangles):
    """Pairs of triangles without a common corner, one of which an edge of the other passes through: all are tried."""
    corners, found = x[triangles], set()
    for a, one in enumerate(corners):
        normal = np.cross(one[1] - one[0], one[2] - one[0])
        for b, other in enumerate(corners):
            if set(triangles[a]) & set(triangles[b]):
                continue
            heights = (other - one[0]) @ normal
            for i, j in ((0, 1), (1, 2), (2, 0)):
                if heights[i] * heights[j] < 0:
                    point = other[i] + heights[i] / (heights[i] - heights[j]) * (other[j] - other[i])
                    turns = np.cross(np.roll(one, -1, axis=0) - one, point - one) @ normal
                    if (turns > 0).all():
                        found.add((min(a, b), max(a, b)))
    return found


def test_a_shape_that_passes_through_itself_says_so():
    """What comes in crossed and may stay so is counted on what is handed over; what crosses nothing has no note."""
    points, faces = sheet(3, 3, 0.2)
    x = np.concatenate([points, points[:, [0, 2, 1]] + np.array([0.03, 0.21, -0.25])])
    mesh = {"points": x.tolist(), "faces": np.concatenate([faces, faces + len(points)]).tolist()}
    asked = Need(stages=(0.0, 0.05), quality="preview", fields=("mesh_position",))
    values = {"mesh": mesh, "tools": [], "contact": 0.0, "imperfection": 0.0}
    run = SOLVER.solve(SOLVER.parse(values), asked)
    # nothing is cut: all stages have as many vertices
    both = zip(np.split(run.mesh_position.values.astype(float), 2), np.split(run.triangle.values, 2), strict=True)
    counts = [len(pierced(x, triangles)) for x, triangles in both]
    assert list(run.crossings.values) == counts
    assert min(counts) > 5
    assert "2 of 2 stages" in run.attrs["note"]
    assert f"in {max(counts)} pairs" in run.attrs["note"]
    apart = {"points": points.tolist(), "faces": faces.tolist()}
    alone = SOLVER.solve(SOLVER.parse({**values, "mesh": apart}), asked)
    assert not alone.crossings.values.any()
    assert "note" not in alone.attrs


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
