"""Gestures on a growing shell: what is taken back is as if it had never been, to the last bit, however long ago."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from solver.contract import InvalidInput, Need
from solver.growth import SOLVER
from solver.growth.engine import Engine
from solver.growth.living import history
from solver.growth.living.live import GrowingLive
from solver.growth.params import GrowthParams
from solver.growth.settling.energy import elastic
from solver.growth.tooling.tools import HotStroke
from solver.shell import Material


@pytest.fixture(autouse=True)
def one_thread():
    """As sessions have it, and as batch runs do: BLAS sums in another order on two."""
    with threadpool_limits(1, user_api="blas"):
        yield


BALL = {"thickness": 0.1, "tools": [], "step": 0.05}


def begun(**more):
    return GrowingLive(GrowthParams.parse(BALL | more), "preview")


def act(live, name, steps=1, **values):
    said = live.do(SOLVER.live.parse(name, values))
    until = live.following + steps * live.step
    while live.stage < until - 1e-9:
        live.advance(1e9, until)
    return said


def again(live):
    while live.owed > live.stage + 1e-9:
        live.advance(1e9, live.owed)


def x(live):
    return live.frame(()).vertices


def end_of(live):
    work = live.settled(())
    while True:
        try:
            next(work)
        except StopIteration as found:
            return found.value[0].vertices


def test_gestures_go_back_and_forth_to_the_last_bit(monkeypatch):
    """With room for two inverses most moments are let go: the way back leads over the start."""
    monkeypatch.setattr(history, "_MOMENTS", 2)
    live = begun()
    shapes = [x(live)]
    act(live, "brush", at=[0, 0, 1], way=[1, 0, 0], radius=0.8, stretch=[4, 2])
    act(live, "brush", at=[0.3, 0, 1], radius=0.8, stretch=[4, 2])
    act(live, "lift", steps=0)
    shapes.append(x(live))
    act(live, "add", steps=3, tool={"kind": "spot", "at": [1, 0, 0], "stretch": [3, 3]})
    shapes.append(x(live))
    act(live, "solid", steps=2, solid={"kind": "ball", "centre": [0, 0, -1.4], "radius": 0.5})
    shapes.append(x(live))
    assert (live.gestures, live.undone) == (3, 0)
    for expected in reversed(shapes[:-1]):
        assert live.undo()
        again(live)
        assert np.array_equal(x(live), expected)
    assert live.undo() is False
    for expected in shapes[1:]:
        assert live.redo()
        again(live)
        assert np.array_equal(x(live), expected)
    assert live.redo() is False
    run = SOLVER.solve(live.script, Need(stages=(live.stage,), quality="preview", dtype="float64"))
    assert np.array_equal(run.mesh_position.values, end_of(live))


def test_glimpses_of_a_step_lead_to_its_equilibrium_and_change_nothing():
    """Each is lower than the one before, against the rest state to which it leads."""
    values = {"shape": "disc", "thickness": 0.02, "step": 1.0}
    dab = {"at": [0.6, 0, 0], "way": [0, 1, 0], "radius": 0.8, "stretch": [1.3, 1.1]}
    live, alone = begun(**values), begun(**values)
    act(alone, "brush", **dab)
    assert live.glimpse(()) is None
    live.do(SOLVER.live.parse("brush", dab))
    seen, at_rest = [], x(live)
    while not live.advance(0.0, 1.0):
        seen.append(live.glimpse(()))
        assert live.glimpse(()) is None
        assert np.array_equal(x(live), at_rest)
    seen = [found for found in seen if found is not None]
    assert len(seen) > 5
    assert not any(np.array_equal(a.surface.vertices, b.surface.vertices) for a, b in pairwise(seen))
    assert {found.stage for found in seen} == {1.0}
    assert np.array_equal(x(live), x(alone))
    assert live.glimpse(()) is None
    state = live._engine.state
    costs = [elastic(replace(state, x=found.surface.vertices), Material(0.02, 0.3), "hinges") for found in seen]
    costs.append(elastic(state, Material(0.02, 0.3), "hinges"))
    assert all(after <= before * (1 + 1e-12) for before, after in pairwise(costs))
    assert costs[-1] < 0.9 * costs[0]
    assert seen[-1].residual < seen[0].residual


def test_a_step_that_is_given_up_has_no_glimpse():
    live = begun(shape="disc", thickness=0.02, step=1.0)
    live.do(SOLVER.live.parse("brush", {"at": [0.6, 0, 0], "way": [0, 1, 0], "radius": 0.8, "stretch": [1.3, 1.1]}))
    while live._engine.underway is None:
        assert not live.advance(0.0, 1.0)
    assert live.undo()
    assert live.glimpse(()) is None


def test_a_gesture_ends_what_could_be_brought_again():
    live = begun()
    act(live, "brush", at=[0, 0, 1])
    assert live.undo()
    act(live, "brush", at=[0, 1, 0])
    assert live.undone == 0
    assert live.redo() is False


def test_what_ends_grows_no_more_and_solids_leave():
    live = begun(thickness=0.2, attached=[{"where": {"kind": "ball", "centre": [0, 0, -1], "radius": 0.8}}])
    tool = act(live, "add", tool={"kind": "spot", "at": [0, 0, 1], "stretch": [3, 3]})["tool"]
    solid = act(live, "solid", solid={"kind": "plane", "point": [0, 0, 0.9], "normal": [0, 0, -1]})["solid"]
    pressed = end_of(live)[:, 2].max()
    act(live, "end", tool=tool)
    act(live, "end", solid=solid)
    free = end_of(live)[:, 2].max()
    assert pressed < 0.95 < 1.0 < free
    area = SOLVER.solve(live.script, Need(stages=(live.stage, live.stage + 0.5), quality="preview")).rest_area.values
    assert area[0] == pytest.approx(area[1], rel=1e-12)


def test_a_brush_stretches_along_its_way():
    """Rest lengths: a dab over the whole shape, x4 along and x2 across per unit time, over .1."""
    square = {"shape": "square", "thickness": 0.1, "remesh": 0, "step": 0.1}
    for way in ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0)):
        dab = {"kind": "stroke", "points": [[0, 0, 0]], "ways": [way], "radius": 50, "kernel": "flat"}
        tool = HotStroke.model_validate(dab | {"stretch": [4, 2]})
        engine = Engine(GrowthParams.parse(square | {"tools": [tool.model_dump()], "imperfection": 0}), 150)
        engine.advance(1e9, until=0.1)
        along = np.array(way) / np.linalg.norm(way)
        size = np.ptp(engine.state.x @ along), np.ptp(engine.state.x @ np.cross(along, [0, 0, 1]))
        assert size[0] / size[1] == pytest.approx(2**0.1, rel=1e-3)


def test_a_brush_that_stands_grows_the_same_area_all_round():
    square = {"shape": "square", "thickness": 0.1, "remesh": 0, "step": 0.1, "imperfection": 0}
    tool = {"kind": "stroke", "points": [[0, 0, 0]], "radius": 50, "kernel": "flat", "stretch": [4, 2]}
    engine = Engine(GrowthParams.parse(square | {"tools": [tool]}), 150)
    before = np.ptp(engine.state.x, axis=0)
    engine.advance(1e9, until=0.1)
    assert np.ptp(engine.state.x, axis=0)[:2] / before[:2] == pytest.approx([8**0.05] * 2, rel=1e-3)


def test_dabs_act_one_after_the_other():
    """A stroke whose second dab comes later and whose first is over by then."""
    dabs = {"kind": "stroke", "points": [[0, 0, 1], [0, 0, -1]], "times": [0, 0.1], "hold": 0.1, "radius": 0.9}
    engine = Engine(GrowthParams.parse(BALL | {"tools": [dabs | {"stretch": [8, 8]}], "remesh": 0}), 200)
    rest = [engine.state.g]
    for k in (1, 2, 3, 4, 5):
        engine.advance(1e9, until=0.05 * k)
        rest.append(engine.state.g)
    middle = engine.state.x[engine.state.mesh.triangles].mean(axis=1)[:, 2]
    for k, (before, after) in enumerate(pairwise(rest)):
        grown = (before != after).any(axis=1)
        assert grown.any() == (k < 4)
        assert (middle[grown] > 0).all() if k < 2 else (middle[grown] < 0).all()


def test_numbers_and_places_that_there_are_not():
    live = begun()
    for name, values, said in (
        ("end", {"tool": 0}, "no tool 0"),
        ("brush", {"at": [0, 0, 9]}, "nearest point"),
        ("brush", {"at": [0, 0, 1], "radius": 0}, "radius"),
    ):
        with pytest.raises(InvalidInput, match=said):
            act(live, name, **values)
    assert live.gestures == 0
    with pytest.raises(InvalidInput, match="one for each dab"):
        GrowthParams.parse({"tools": [{"kind": "stroke", "points": [[0, 0, 1]], "times": [0, 1]}]})
