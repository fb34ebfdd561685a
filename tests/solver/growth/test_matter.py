"""Ribs, colours and boxes against known answers: cantilevers, uniform growth, distances."""

import numpy as np
import pytest

from solver.contract import Context, InvalidInput, Need
from solver.growth import SOLVER
from solver.growth.engine import Engine
from solver.growth.matter import BARE, coloured
from solver.growth.params import GrowthParams
from solver.growth.shapes import Ground, start
from solver.growth.solids import Plane, SolidBox, present
from solver.growth.tooling.places import Lines, share

RGB = ("red", "green", "blue")


def reached(time: float = 1.0, vertices: int = 300, residual: float = 1e-4, **values):
    params = GrowthParams.parse({"imperfection": 0, "tools": []} | values)
    return Engine(params, vertices, residual, history=False).reach(time, Context()), params


def sag(bending: str, **values) -> float:
    """How far the tip of a clamped strip hangs down under a small weight."""
    held = [{"where": {"kind": "band", "along": "x", "low": -1.6, "high": -2.0}}]
    strip = {"shape": "strip", "aspect": 4, "thickness": 0.1, "gravity": [0, 0, -1e-6], "attached": held}
    # of a looser residual the weight is a part, and bending by mean curvature knows no Newton steps to go on by
    state, _ = reached(0.05, residual=1e-8, **strip, bending=bending, **values)
    return -float(state.x[:, 2].min())


@pytest.mark.parametrize("bending", ["hinges", "mean_curvature"])
def test_a_stiff_sheet_sags_by_as_much_less(bending):
    everywhere = {"where": {"kind": "everywhere"}, "stiffness": 8.0}
    bare = sag(bending)
    assert bare > 0.01
    assert sag(bending, ribs=[everywhere]) == pytest.approx(bare / 8, rel=0.01)


def test_a_midrib_holds_a_leaf_up_and_a_rib_across_does_not():
    bare = sag("hinges")
    along, across = ([[[-2, 0, 0], [2, 0, 0]]], [[[1.5, -0.5, 0], [1.5, 0.5, 0]]])
    ribs = [[{"where": {"kind": "lines", "lines": way, "width": 0.3}, "stiffness": 50.0}] for way in (along, across)]
    assert sag("hinges", ribs=ribs[0]) < 0.4 * bare
    assert sag("hinges", ribs=ribs[1]) > 0.9 * bare


def test_colours_ride_on_the_material_through_cuts():
    """Twofold growth everywhere: what is at x was at x / 2, and the coat is what it was there."""
    grow = {"kind": "surface", "where": {"kind": "everywhere"}, "stretch": [2.0, 2.0]}
    band = {"kind": "band", "along": "x", "low": -1.0, "high": 1.0}
    state, params = reached(
        shape="disc", tools=[grow], colours=[{"colour": (1, 0, 0)}, {"colour": (0, 0, 1), "where": band}]
    )
    assert len(state.x) > 500, "nothing was cut"
    # a disc grows about its own middle, which no one holds
    v = np.clip((state.x[:, 0] - state.x[:, 0].mean()) / 4 + 0.5, 0, 1)
    expected = v * v * (3 - 2 * v)
    found = coloured(state, params.colours)
    assert found[:, 2] == pytest.approx(expected, abs=0.02)
    assert found[:, 0] == pytest.approx(1 - found[:, 2])
    assert found[:, 1] == pytest.approx(np.zeros(len(found)))


def test_a_colour_comes_in_with_the_area_that_has_grown():
    """Area x4: half of the way to x16 in its logarithm, the same everywhere; not at all before anything has grown."""
    grow = {"kind": "surface", "where": {"kind": "everywhere"}, "stretch": [2.0, 2.0]}
    coat = [{"colour": (0, 0, 0)}, {"colour": (1, 1, 1), "grown": 16}]
    for time, cover in ((0.0, 0.0), (0.5, 0.25), (1.0, 0.5)):
        state, params = reached(time, shape="disc", tools=[grow], colours=coat)
        assert coloured(state, params.colours) == pytest.approx(np.full((len(state.x), 3), cover), abs=1e-9)


def test_a_result_has_its_colours_and_bare_ones_without():
    need = Need.parse({"stages": [0.1], "quality": "preview", "fields": ["mesh_position", *RGB]})
    bare = SOLVER.solve(SOLVER.parse({}), need)
    red = SOLVER.solve(SOLVER.parse({"colours": [{"colour": (0.5, 0.25, 0.125)}]}), need)
    for k, name in enumerate(RGB):
        assert bare[name].values == pytest.approx(np.full(bare.sizes["vertex"], BARE[k]))
        assert red[name].values == pytest.approx(np.full(red.sizes["vertex"], 0.5 ** (k + 1)))
    assert np.array_equal(bare["mesh_position"], red["mesh_position"]), "a colour has no weight"
    assert SOLVER.looks.paint is not None
    skin = SOLVER.looks.paint({name: red[name].values for name in RGB}, {})
    assert skin is not None
    assert skin.colour[0] == pytest.approx([0.5, 0.25, 0.125])


def test_parts_that_settle_alone_know_their_ribs():
    grow = {"kind": "spot", "at": [0.5, 0, 0], "radius": 0.4, "stretch": [1.5, 1.5]}
    ribs = [{"where": {"kind": "lines", "lines": [[[-1, 0, 0], [1, 0, 0]]], "width": 0.2}, "stiffness": 20.0}]
    values = {"shape": "disc", "tools": [grow], "ribs": ribs, "imperfection": 0.02, "step": 0.01}
    whole, _ = reached(0.3, 600, **values)
    parts, _ = reached(0.3, 600, **values, active=True)
    assert len(whole.x) == len(parts.x)
    assert np.abs(whole.x - parts.x).max() < 0.02


def test_a_line_fades_to_nothing_at_its_width():
    mesh = start("square", 900, 1.0)
    place = Lines.model_validate({"lines": [[[-0.5, 0, 0], [0, 0, 0], [0, 0.5, 0]]], "width": 0.1})
    found = share(place, Ground(mesh, np.empty(0, np.int64)), 0)
    x, y = mesh.x[:, 0], mesh.x[:, 1]
    away = np.minimum(np.hypot(np.maximum(x, 0), y), np.hypot(x, np.maximum(-y, 0)))
    v = np.clip(1 - away / 0.1, 0, 1)
    assert found == pytest.approx(v * v * (3 - 2 * v), abs=1e-12)
    assert found.max() > 0.5
    with pytest.raises(ValueError, match="two points"):
        Lines.model_validate({"lines": [[[0, 0, 0]]], "width": 0.1})


@pytest.mark.parametrize("edge", [0.0, 0.2])
def test_a_box_pushes_out_the_shortest_way(edge):
    """At the depth along the way out lies the surface: the box without its rounding is `edge` away, not less."""
    box = SolidBox(centre=(1, 2, 3), size=(1.0, 0.8, 0.6), edge=edge)
    half = np.array(box.size) / 2
    x = np.array(box.centre) + np.random.default_rng(0).uniform(-0.7, 0.7, (2000, 3))
    depth, normal = box.depth(x)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(np.ones(len(x)))

    def inner(p):
        return np.abs(p - np.array(box.centre)) - (half - edge)

    gap = np.linalg.norm(np.maximum(inner(x), 0), axis=1)
    inside = np.where((inner(x) < 0).all(axis=1), True, gap < edge)
    assert (depth[~inside] == 0).all()
    assert (depth[inside] > 0).all()
    out = (x + depth[:, None] * normal)[inside]
    # on the surface: as far from the inner box as the edge's radius, on the box itself where it has none
    reach = np.linalg.norm(np.maximum(inner(out), 0), axis=1)
    assert reach == pytest.approx(np.full(len(out), edge), abs=1e-9)
    if not edge:
        assert inner(out).max(axis=1) == pytest.approx(np.zeros(len(out)), abs=1e-9)
    with pytest.raises(ValueError, match="half a side"):
        SolidBox(size=(1, 1, 0.1), edge=0.2)


def test_a_cloth_lies_on_a_box_and_hangs_over_its_sides():
    held = [{"where": {"kind": "ball", "centre": (0, 0, 0), "radius": 0.3}, "axes": ["x", "y"]}]
    box = {"kind": "box", "centre": (0, 0, -0.2), "size": (0.6, 0.6, 0.38), "edge": 0.05}
    state, params = reached(
        0.05, 600, shape="square", thickness=0.01, curved=False, gravity=[0, 0, -0.02], attached=held, solids=[box]
    )
    depth = params.solids[0].depth(state.x)[0]
    top = (np.abs(state.x[:, :2]) < 0.2).all(axis=1)
    # solids are penalties: where two sides hang from a corner of the box the cloth is pressed in further
    assert depth[top].max() < 0.002
    assert depth.max() < 0.03
    assert state.x[top, 2] == pytest.approx(np.full(int(top.sum()), -0.01), abs=0.005)
    assert state.x[:, 2].min() < -0.1
    assert not isinstance(params.solids[0], Plane)


def test_a_ball_that_rises_lifts_the_sheet_and_leaves_it_behind():
    held = [{"where": {"kind": "rim", "width": 0.1}}]
    ball = {"kind": "ball", "centre": (0.1, 0, -0.75), "radius": 0.5, "velocity": (0, 0, 1.0), "duration": 0.6}
    common = {"shape": "disc", "thickness": 0.02, "curved": False, "attached": held, "step": 0.1}
    state, params = reached(0.5, 300, **common, solids=[ball])
    there = present(params.solids, 0.5)[0]
    assert there.centre == pytest.approx((0.1, 0.0, -0.25))
    # a stretched sheet presses itself into a penalty, a little
    assert there.depth(state.x)[0].max() < 0.03
    assert state.x[:, 2].max() == pytest.approx(0.25, abs=0.03)
    assert not present(params.solids, 0.65)
    back, _ = reached(1.0, 300, **common, solids=[ball])
    assert np.abs(back.x[:, 2]).max() < 0.01


def test_a_solid_that_would_pass_through_the_sheet_in_a_step_is_refused():
    ball = {"kind": "ball", "radius": 0.5, "velocity": (0, 0, 3.0)}
    with pytest.raises(InvalidInput, match=r"ball moves by 0\.3 in a step of 0\.1.*0\.5 deep"):
        SOLVER.parse({"solids": [ball], "step": 0.1})
    SOLVER.parse({"solids": [ball], "step": 0.05})


@pytest.mark.parametrize("remesh", [0.0, 1.2])
def test_a_strip_that_is_led_apart_at_its_end_is_stretched_evenly(remesh):
    """By so much as its end has come; its sides come in by Poisson's ratio of a sheet, nu in plane stress."""
    ends = [{"where": {"kind": "band", "along": "x", "low": s * 1.5, "high": s * 1.9}, "axes": ("x",)} for s in (-1, 1)]
    ends[1]["velocity"] = (0.1, 0, 0)
    values = {"shape": "strip", "aspect": 4.0, "thickness": 0.1, "attached": ends, "tools": [], "remesh": remesh}
    run = Engine(GrowthParams.parse(values | {"imperfection": 0.0, "step": 0.25}), 400, 1e-5)
    begun, state = run.state, run.reach(1.0, Context())
    held = begun.held[:, 0]
    led = held & (begun.x[:, 0] > 0)
    if not remesh:
        assert state.x[held, 0] == pytest.approx(begun.x[held, 0] + 0.1 * led[held], abs=1e-12)
    before, after = begun.x, state.x
    inner = np.abs(before[:, 0]) < 1.0
    slope = np.polyfit(before[inner, 0], after[: len(before)][inner, 0], 1)[0]
    length = before[led, 0].min() - before[held & ~led, 0].max()
    assert slope - 1 == pytest.approx(0.1 / length, rel=0.02)
    narrowed = np.polyfit(before[inner, 1], after[: len(before)][inner, 1], 1)[0]
    # St. Venant and Kirchhoff: Green's strains are in Poisson's ratio
    assert (1 - narrowed**2) / (slope**2 - 1) == pytest.approx(0.3, rel=0.05)


def test_what_is_led_must_be_held():
    attached = [{"where": {"kind": "everywhere"}, "axes": ("x",), "velocity": (0, 1, 0)}]
    with pytest.raises(InvalidInput, match="must be held"):
        GrowthParams.parse({"attached": attached})
