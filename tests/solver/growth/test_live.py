"""Gestures on a growing shell: what is taken back is as if it had never been, to the last bit, however long ago."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from solver.contract import Context, InvalidGeometry, InvalidInput, Need
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


def thick(live):
    return live.frame(("sheet_thickness",)).fields["sheet_thickness"]


def test_a_brush_paints_thickness_and_it_goes_back_and_forth(monkeypatch):
    """Also over the start; and the script, whose strokes thicken, is the batch run of the same bytes."""
    monkeypatch.setattr(history, "_MOMENTS", 2)
    live = begun(shape="disc", thickness=0.04)
    dab = {"radius": 0.5, "stretch": [1, 1], "kernel": "flat", "thickening": 8.0, "hold": 0.1}
    found = [(x(live), thick(live))]
    act(live, "brush", at=[0.4, 0, 0], steps=2, **dab)
    act(live, "brush", at=[0.4, 0.1, 0], steps=2, **dab)
    act(live, "lift", steps=0)
    found.append((x(live), thick(live)))
    act(live, "brush", at=[-0.5, 0, 0], steps=2, **(dab | {"thickening": 0.5}))
    found.append((x(live), thick(live)))
    assert (live.gestures, len(live.script.tools)) == (2, 2)
    # eightfold in a unit of time, over two dabs of .1 that overlap
    assert found[1][1].max() == pytest.approx(0.04 * 8**0.2, rel=1e-9)
    assert found[2][1].min() == pytest.approx(0.04 * 0.5**0.1, rel=1e-9)
    far = np.linalg.norm(found[0][0] - [0.4, 0.05, 0], axis=1) > 0.6
    assert (found[1][1][far] == 0.04).all()
    for expected in reversed(found[:-1]):
        assert live.undo()
        again(live)
        assert all(np.array_equal(a, b) for a, b in zip((x(live), thick(live)), expected, strict=True))
    for expected in found[1:]:
        assert live.redo()
        again(live)
        assert all(np.array_equal(a, b) for a, b in zip((x(live), thick(live)), expected, strict=True))
    need = Need(stages=(live.stage,), quality="preview", dtype="float64", fields=("mesh_position", "sheet_thickness"))
    run = SOLVER.solve(live.script, need)
    assert np.array_equal(run.mesh_position.values, end_of(live))
    assert np.array_equal(run.sheet_thickness.values, thick(live))


def test_thickening_is_bounded_and_what_stays_keeps_its_key():
    values = {"kind": "stroke", "points": [[0, 0, 0]], "radius": 5, "kernel": "flat", "stretch": [1, 1]}
    disc = {"shape": "disc", "tools": [values | {"thickening": 10}], "thickness": 0.001, "contact": 0, "step": 1}
    state = Engine(GrowthParams.parse(disc), 60).reach(2.0, Context())
    assert (state.matter["thick"] == 20).all()
    assert "thickening" not in HotStroke.model_validate(values).model_dump(mode="json")
    assert HotStroke.model_validate(values | {"thickening": 3}).model_dump(mode="json")["thickening"] == 3


def test_parts_keep_apart_by_the_thickness_that_was_painted():
    """Two sheets over each other, nearer than the upper one is thick in the end, part as far as that."""
    ticks = np.linspace(-0.5, 0.5, 6)
    plane = np.stack([*np.meshgrid(ticks, ticks), np.zeros((6, 6))], -1).reshape(-1, 3)
    corner = (np.arange(5) + 6 * np.arange(5)[:, None]).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 7], -1), np.stack([corner, corner + 7, corner + 6], -1)]
    )
    points = np.concatenate([plane, plane + np.array([0.01, 0.02, 0.03])])
    mesh = {"points": points.tolist(), "faces": np.concatenate([faces, faces + 36]).tolist()}
    stroke = {"kind": "stroke", "points": [[0, 0, 0.03]], "radius": 5, "kernel": "flat", "stretch": [1, 1]}
    values = {"mesh": mesh, "thickness": 0.02, "remesh": 0, "step": 0.05, "imperfection": 0}
    gaps = []
    for thickening in (1.0, 10.0):
        made = Engine(GrowthParams.parse(values | {"tools": [stroke | {"thickening": thickening}]}), 100)
        made.advance(1e9, until=0.4)
        z = made.state.x[:, 2]
        gaps.append(float(z[36:].mean() - z[:36].mean()))
    assert gaps[0] == pytest.approx(0.03, abs=1e-6)
    assert made.distance == pytest.approx(0.02 * 10**0.4, rel=1e-9)
    assert gaps[1] > 0.7 * made.distance


def test_a_solid_that_holds_the_whole_sheet_is_refused_and_nothing_changes():
    live = begun(shape="disc", thickness=0.05)
    act(live, "brush", at=[0.5, 0, 0])
    before = x(live), live.gestures, live.stage
    for solid, said in (
        ({"kind": "ball", "radius": 3}, "wholly inside it, a ball: all of it is 2 deep or deeper"),
        ({"kind": "plane", "point": [0, 0, 0.5]}, "a plane: all of it is 0.5"),
        ({"kind": "box", "size": [4, 4, 1]}, "a box"),
    ):
        with pytest.raises(InvalidGeometry, match=said) as found:
            live.do(SOLVER.live.parse("solid", {"solid": solid}))
        assert "later `start`" in str(found.value)
    assert np.array_equal(before[0], x(live))
    assert before[1:] == (live.gestures, live.stage)
    assert live.script.solids == ()
    # under it, over a part of it, and later
    act(live, "solid", solid={"kind": "ball", "centre": [0, 0, -0.5], "radius": 0.5})
    act(live, "solid", steps=0, solid={"kind": "ball", "radius": 3, "start": 50})
    # a balloon may be stretched over what is in it
    closed = begun()
    assert closed.do(SOLVER.live.parse("solid", {"solid": {"kind": "ball", "radius": 1.3}})) == {"solid": 0}


def test_a_texture_without_coordinates_to_lie_by_is_refused_and_nothing_changes():
    live = begun()
    place = {"kind": "texture", "picture": [[0, 1], [1, 0]], "projection": "uv"}
    with pytest.raises(InvalidGeometry, match="no texture coordinates"):
        live.do(SOLVER.live.parse("add", {"tool": {"kind": "surface", "where": place}}))
    assert (live.gestures, live.script.tools) == (0, ())
