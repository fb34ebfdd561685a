"""What is told from what was near before is what a look all over tells."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.geometry.crossings import crossings
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling import watch as module
from solver.growth.settling.energy import vertex_areas
from solver.growth.settling.minimise import longest
from solver.growth.settling.touching import touches
from solver.growth.settling.watch import Watch
from solver.linalg.abreast import finished
from tests.solver.shell._meshes import sheet

DISTANCE = 0.03


def told_all_over(start, end, distance):
    """Return what `Watch.apart` does, from looks all over."""
    way = end.x - start
    way = way - way.mean(axis=0)
    looks = min(max(int(np.ceil(longest(way) / end.length)), 1), 16)
    faces = end.mesh.triangles
    if any(crossings(end.x - k / looks * way, faces).count for k in range(looks)):
        return False
    return not touches(end, distance, vertex_areas(end))


def strip():
    """Return a state of a flat strip, its triangles somewhat uneven."""
    points, faces = sheet(6, 24, 0.1)
    shift = np.random.default_rng(1).uniform(-0.02, 0.02, (len(points), 2))
    points = points + np.column_stack([shift, np.zeros(len(points))])
    state = Engine(GrowthParams.parse({"shape": "disc"}), 60).state
    mesh = shell.topology(faces, len(points))
    g = shell.metric(points, mesh.triangles)
    return replace(
        state, x=points, mesh=mesh, g=g, rest=np.zeros(len(mesh.hinges)), held=np.zeros((len(points), 3), bool)
    )


def rolled(x, turn):
    """Return a strip rolled up by an angle, over its own edge."""
    angle = turn * x[:, 0] / np.ptp(x[:, 0])
    radius = np.ptp(x[:, 0]) / turn
    return np.stack([radius * np.sin(angle), x[:, 1], radius * (1 - np.cos(angle)) + 0.01 * x[:, 0]], axis=1)


def folded(x, turn):
    """Return a strip with a fold that sharpens."""
    sharp = 1 / (1 + np.exp(-(x[:, 0] - x[:, 0].mean()) * 12))
    angle = 0.5 * turn * sharp
    ahead = np.cumsum(np.diff(np.sort(x[:, 0]), prepend=x[:, 0].min()) * np.cos(angle[np.argsort(x[:, 0])]))
    up = np.cumsum(np.diff(np.sort(x[:, 0]), prepend=x[:, 0].min()) * np.sin(angle[np.argsort(x[:, 0])]))
    place = np.argsort(np.argsort(x[:, 0]))
    return np.stack([ahead[place], x[:, 1], up[place]], axis=1)


@pytest.mark.parametrize("shape", [rolled, folded])
@pytest.mark.parametrize("distance", [DISTANCE, 1e-4])
@pytest.mark.parametrize("pace", [0.004, 0.02, 0.11, 0.6])
def test_what_is_remembered_tells_what_looks_all_over_tell(shape, pace, distance, monkeypatch):
    """Until it first says no, which in small steps is where parts are as near as the distance."""
    flat, watch = strip(), Watch(distance)
    looks = []
    monkeypatch.setattr(module.shell, "close_faces", lambda *a: looks.append(1) or shell.contact.close_faces(*a))
    turn, before, told, steps = 4.6, shape(flat.x, 4.6), True, 0
    while told and turn < 8:
        turn, steps = turn + pace, steps + 1
        end = replace(flat, x=shape(flat.x, turn))
        told = finished(watch.apart(before, end))
        assert told == told_all_over(before, end, distance), turn
        before = end.x
    assert not told
    assert pace > 0.01 or len(looks) < steps / 3


@pytest.mark.parametrize(("shape", "distance"), [(rolled, DISTANCE), (folded, DISTANCE), (folded, 1e-4)])
def test_a_long_way_after_short_ones_is_told_from_what_they_found(shape, distance, monkeypatch):
    """It is looked for anew only where nothing is known, and the answer is that of a look all over."""
    flat, anew = strip(), []
    monkeypatch.setattr(module, "touches", lambda *a: anew.append(1) or touches(*a))
    told = []
    for long in np.arange(0.2, 3.0, 0.1):
        watch, begin, first = Watch(distance), replace(flat, x=shape(flat.x, 4.6)), replace(flat, x=shape(flat.x, 4.61))
        assert finished(watch.apart(begin.x, first))
        end = replace(flat, x=shape(flat.x, 4.61 + long))
        told.append(finished(watch.apart(first.x, end)))
        assert told[-1] == told_all_over(first.x, end, distance), long
    assert not anew
    assert set(told) == {True, False}


def test_a_stiff_part_that_sinks_into_another_in_one_step_is_seen():
    """No edge changes, and nothing is within the distance before the step or after it."""
    flat, watch, distance = strip(), Watch(1e-4), 1e-4
    n, x = len(flat.x), flat.x
    tilted = np.column_stack([x[:, 0] * np.cos(0.3), x[:, 1] + 0.037, x[:, 0] * np.sin(0.3) + 0.2])
    mesh = shell.topology(np.concatenate([flat.mesh.triangles, flat.mesh.triangles + n]), 2 * n)
    both = np.concatenate([x, tilted])
    g, nothing = shell.metric(both, mesh.triangles), np.zeros(len(mesh.hinges))
    state = replace(flat, x=both, mesh=mesh, g=g, rest=nothing, held=np.zeros((2 * n, 3), bool))
    down, told = np.repeat([0.0, -0.03], n)[:, None] * np.array([0.0, 0.0, 1.0]), True
    for step in range(8):
        end = replace(state, x=both + (step + 1) * down)
        told = finished(watch.apart(both + step * down, end))
        assert told == told_all_over(both + step * down, end, distance), step
        if not told:
            break
    assert step > 4
    assert not told


def test_a_mesh_that_grows_in_place_is_looked_at_anew():
    """What was far along the sheet is near when the edges have shrunk, and the other way round."""
    flat = strip()
    for factor in (0.97, 1.03):
        watch, state = Watch(DISTANCE), flat
        for turn in np.arange(5.0, 6.0, 0.02):
            end = replace(state, x=rolled(flat.x, turn), g=state.g * factor)
            told = finished(watch.apart(rolled(flat.x, turn - 0.02), end))
            assert told == told_all_over(rolled(flat.x, turn - 0.02), end, DISTANCE)
            state = end
            if not told:
                break


def test_a_run_that_remembers_is_a_run_that_does_not(monkeypatch):
    """To the last byte, through remeshing, and where parts come near each other."""
    params = GrowthParams.parse(
        {"shape": "disc", "thickness": 0.02, "tools": [{"kind": "surface", "where": {"kind": "rim", "width": 0.4},
                                                       "stretch": [3.0, 1.0]}], "step": 0.02}
    )  # fmt: skip

    def grown():
        engine = Engine(params, 300)
        engine.advance(np.inf, until=0.4)
        return engine

    one = grown()

    def all_over(self, start, end):
        yield
        return told_all_over(start, end, self._distance)

    monkeypatch.setattr(Watch, "apart", all_over)
    other = grown()
    assert one.state.x.tobytes() == other.state.x.tobytes()
    assert one.distance == other.distance


def hinged(x, turn):
    """Return a strip folded along its middle, the further along the more: nothing is shorter than flat."""
    middle = x[:, 0] - 0.2
    angle = np.where(middle > 1e-9, turn * (1 + 0.3 * x[:, 1]), 0.0)
    return np.stack([middle * np.cos(angle), x[:, 1], middle * np.sin(angle)], axis=1)


def test_triangles_near_each_other_along_the_sheet_that_cross_are_listed():
    """However far it is folded in small steps, without edges that grow shorter: those that cross were near before."""
    x, y = np.meshgrid(np.arange(5) * 0.1, np.arange(9) * 0.1)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = np.array([5 * row + column for row in range(8) for column in range(4)])
    faces = np.concatenate([corner[:, None] + [0, 1, 6], corner[:, None] + [0, 6, 5]])
    mesh, watch, listed = shell.topology(faces, len(points)), Watch(1e-6), 0
    flat = replace(strip(), x=points, mesh=mesh, g=shell.metric(points, faces), rest=np.zeros(len(mesh.hinges)))
    for before, turn in itertools.pairwise(np.arange(1.0, 4.0, 0.02)):
        end = replace(flat, x=hinged(points, turn))
        along = watch._along_now(end)
        close = watch._close_now(along, end, end.x - hinged(points, before))
        assert close
        known = {(min(pair), max(pair)) for pair in close.pairs.tolist()}
        for a, b in crossings(end.x, faces).pairs.tolist():
            corners = np.array([(p, q) for p in faces[a] for q in faces[b]])
            if along.surely.holds(corners).any():
                assert (a, b) in known, turn
                listed += 1
    assert listed > 100


def horseshoe(gap):
    """Return a flat sheet, whose two arms run beside each other at such a distance."""
    x, y = np.meshgrid(np.arange(81) * 0.05 - 2.0, np.arange(61) * 0.05)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = np.array([81 * row + column for row in range(60) for column in range(80)])
    faces = np.concatenate([corner[:, None] + [0, 1, 82], corner[:, None] + [0, 82, 81]])
    middle = points[faces].mean(axis=1)
    used, faces = np.unique(faces[(np.abs(middle[:, 0]) > 0.05) | (middle[:, 1] < 1.0)], return_inverse=True)
    mesh, laid = shell.topology(faces.reshape(-1, 3), len(used)), points[used]
    laid[:, 0] -= np.where(laid[:, 1] > 1.0 - 1e-9, np.sign(laid[:, 0]) * (0.05 - gap / 2), 0.0)
    laid[:, 2] = 0.02 * np.sin(5 * laid[:, 1])
    state = replace(strip(), x=laid, mesh=mesh, g=shell.metric(laid, mesh.triangles), rest=np.zeros(len(mesh.hinges)))
    return replace(state, held=np.zeros((len(laid), 3), bool))


@pytest.mark.parametrize("gap", [0.06, 0.035, 0.028, 0.01])
def test_arms_of_a_flat_sheet_are_seen_to_come_near_each_other(gap, monkeypatch):
    """It lies over a plane, so that only its rim is looked at; the answer is that of a look all over."""
    state = horseshoe(gap)
    looked = []
    monkeypatch.setattr(module, "touches", lambda s, *a: looked.append(len(s.x)) or touches(s, *a))
    begin = horseshoe(0.08).x
    for start in (begin, state.x):
        told = finished(Watch(DISTANCE).apart(start, state))
        assert told == told_all_over(start, state, DISTANCE) == (gap > DISTANCE)
    assert looked
    assert not (gap > DISTANCE and max(looked) == len(state.x)), "no look all over"


def test_a_wavy_sheet_is_apart_whatever_its_slope(monkeypatch):
    """With slopes of half a radian the middle needs no look, with steep ones it does; the answer is the same."""
    state = horseshoe(0.08)
    sure = []
    lies = Watch._lies_apart
    monkeypatch.setattr(Watch, "_lies_apart", lambda *a: sure.append(lies(*a)) or sure[-1])
    for slope in np.arange(0.0, 3.0, 0.25):
        x = state.x.copy()
        x[:, 2] = slope / 12 * np.sin(12 * x[:, 1])
        end = replace(state, x=x, g=shell.metric(x, state.mesh.triangles))
        assert finished(Watch(DISTANCE).apart(state.x, end)) == told_all_over(state.x, end, DISTANCE), slope
    assert set(sure) == {True, False}
