"""What a growing shell cannot do is an error that says what to change, not a shape."""

from __future__ import annotations

import numpy as np
import pytest

from solver.contract import InvalidInput, Need, NotConverged, OverBudget, Unstable
from solver.growth import SOLVER
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams

DISC = {"shape": "disc", "thickness": 0.05, "tools": [], "step": 0.1}
HEAVY = DISC | {"gravity": [0, 0, -0.05]}


def run(values, stage=0.1, fields=("mesh_position",)):
    return SOLVER.solve(SOLVER.parse(values), Need(stages=(stage,), quality="preview", fields=fields))


def test_a_sheet_that_nothing_holds_is_refused_before_any_work():
    for more in ({}, {"attached": [{"where": {"kind": "rim", "width": 0.2}, "axes": ["x", "y"]}]}):
        with pytest.raises(InvalidInput, match=r"nothing holds the sheet along z.*attach"):
            SOLVER.parse(HEAVY | more)
    SOLVER.parse(HEAVY | {"attached": [{"where": {"kind": "rim", "width": 0.2}, "axes": ["z"]}]})


def test_a_sheet_beside_its_solid_falls_and_says_so():
    ball = {"kind": "ball", "centre": [5, 0, -3], "radius": 1}
    with pytest.raises(NotConverged, match=r"falls|nothing holds") as found:
        run(HEAVY | {"solids": [ball]})
    assert "Attach" in found.value.advice


def test_a_sheet_that_begins_wholly_inside_a_solid_is_refused_before_any_work():
    ball, plane = {"kind": "ball", "radius": 2}, {"kind": "plane", "point": [0, 0, 0.5]}
    box = {"kind": "box", "centre": [0, 0, 9], "size": [1, 1, 1]}
    for solid, depth in ((ball, "1 deep or deeper, 2"), (plane, "0.5 deep or deeper, 0.5")):
        with pytest.raises(InvalidInput, match=f"wholly inside solid 1, a {solid['kind']}: all of it is {depth}"):
            SOLVER.parse(DISC | {"solids": [box, solid]})
        SOLVER.parse(DISC | {"solids": [solid | {"start": 0.1}]})
    # partly inside, and laid on it by less than it is thick
    SOLVER.parse(DISC | {"solids": [ball | {"radius": 0.9}, plane | {"point": [0, 0, 0.04]}]})
    # a balloon over a ball that is larger than it
    SOLVER.parse({"shape": "sphere", "solids": [ball]})


def test_pressure_blows_an_open_sheet_away():
    with pytest.raises(NotConverged, match=r"falls|nothing holds"):
        run(DISC | {"pressure": 0.05})


def test_what_lies_on_a_solid_or_hangs_is_at_rest():
    plane = {"kind": "plane", "point": [0, 0, -0.1]}
    lying = run(HEAVY | {"solids": [plane]}).mesh_position.values
    assert lying[:, 2] == pytest.approx(np.full(len(lying), -0.1), abs=0.01)
    hanging = run(HEAVY | {"attached": [{"where": {"kind": "ball", "centre": [1, 0, 0], "radius": 0.6}}]})
    assert hanging.converged.values.all()


def test_a_surface_that_turns_inside_out_says_so():
    with pytest.raises(Unstable, match="inside out") as found:
        run({"shape": "sphere", "pressure": -0.2, "tools": []})
    assert "contact" in found.value.advice
    blown = run({"shape": "sphere", "pressure": 0.05, "tools": []})
    assert blown.converged.values.all()


def test_tools_that_begin_off_the_surface_are_refused():
    far = {"kind": "spot", "at": [50, 0, 0], "stretch": [2, 2]}
    with pytest.raises(InvalidInput, match="tool 0: the spot lies 49 off") as found:
        run(DISC | {"tools": [far]})
    assert "nearest point of the surface is (1" in found.value.advice
    line = {"kind": "curve", "points": [[0, 0, 0], [0, 3, 0]]}
    with pytest.raises(InvalidInput, match="tool 1: a point lies"):
        run(DISC | {"tools": [far | {"at": [1, 0, 0]}, line]})


def test_a_frame_along_the_normal_is_refused_where_it_matters():
    spot = {"kind": "spot", "at": [1, 0, 0], "stretch": [3.0, 1.2]}
    ball = {"shape": "sphere", "thickness": 0.1, "step": 0.1}
    with pytest.raises(InvalidInput, match="stands on the surface") as found:
        run(ball | {"tools": [spot]})
    given = found.value.advice.partition("(")[2].partition(")")[0]
    run(ball | {"tools": [spot | {"frame": [float(word) for word in given.split(",")]}]})
    run(ball | {"tools": [spot | {"stretch": [2, 2]}]})


def test_a_mesh_that_leaves_its_budget_says_when_and_what_to_do():
    grow = {"kind": "surface", "where": {"kind": "everywhere"}, "stretch": [10, 10]}
    with pytest.raises(OverBudget, match="vertices") as found:
        SOLVER.solve(
            SOLVER.parse({"shape": "sphere", "tools": [grow], "step": 0.2}), Need(stages=(0.4, 1.0), quality="preview")
        )
    assert "remesh" in found.value.advice
    assert found.value.last_stage == 0.4
    assert found.value.partial is not None


def test_a_misspelt_name_within_a_tool_has_the_right_one_named():
    spot = {"kind": "spot", "at": [1, 0, 0]}
    for wrong, hint in (
        ({"tools": [spot | {"strech": [2, 2]}]}, "mean 'stretch'"),
        ({"tools": [spot | {"xyz": 1}]}, "known there: activation"),
        ({"tools": [{"kind": "surface", "where": {"kind": "ball", "centre": [0, 0, 0], "radus": 1}}]}, "mean 'radius'"),
        ({"attached": [{"where": {"kind": "everywhere"}, "axis": ["x"]}]}, "mean 'axes'"),
    ):
        with pytest.raises(InvalidInput, match=hint):
            SOLVER.parse(wrong)


def test_a_sheet_thicker_than_its_triangles_is_not_told_to_be_thicker():
    rim = {"kind": "surface", "where": {"kind": "rim", "width": 0.3}, "stretch": [6, 1]}
    with pytest.raises(NotConverged) as found:
        run({"shape": "disc", "thickness": 0.5, "tools": [rim]}, 1.0)
    assert "thinner" in found.value.advice


def test_a_surface_s_frame_that_stands_on_it_everywhere_is_refused():
    """On the flat disc there is no way along z; on a sphere there is, but for its poles."""
    tool = {"kind": "surface", "where": {"kind": "everywhere"}, "frame": (0, 0, 1)}
    for uneven in ({"stretch": (2.0, 1.0)}, {"stretch": (1.0, 1.0), "curl": (1.0, 0.0)}):
        with pytest.raises(InvalidInput, match="stands on the surface wherever it acts") as found:
            Engine(GrowthParams.parse({"shape": "disc", "tools": [tool | uneven]}), 100).advance(np.inf, until=0.05)
        assert "such as" in (found.value.advice or "")
        Engine(GrowthParams.parse({"shape": "sphere", "tools": [tool | uneven]}), 1000).advance(np.inf, until=0.05)
    for fine in ({"stretch": (2.0, 2.0)}, {"stretch": (2.0, 1.0), "frame": (0.2, 0, 1)}):
        Engine(GrowthParams.parse({"shape": "disc", "tools": [tool | fine]}), 100).advance(np.inf, until=0.05)
