"""Tensors painted by strokes (the paper's 4.3) against harmonic functions; and that they ride on the sheet."""

from dataclasses import replace

import numpy as np
import pytest

from solver.contract import Context, InvalidInput
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.tooling.placing import started
from solver.growth.tooling.rates import rates


def ring(radius, height=0.0, count=120):
    turns = 2 * np.pi * np.arange(count + 1) / count
    return [(radius * np.cos(t), radius * np.sin(t), height) for t in turns]


def painted(strokes, vertices=900, **values):
    tool = {"kind": "tensors", "strokes": strokes}
    made = Engine(
        GrowthParams.parse({"tools": [tool], "imperfection": 0, "remesh": 0, "contact": 0} | values), vertices
    )
    return started(made.state, made.params.tools, 0.1, 0), made.params.tools


def along(state, strain, ways):
    """Return the strain (f,) along directions (f, 3) on the surface, of tensors in the triangles' rest frames."""
    p = state.x[state.mesh.triangles]
    first = p[:, 1] - p[:, 0]
    first /= np.linalg.norm(first, axis=1)[:, None]
    normal = np.cross(first, p[:, 2] - p[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    ways = ways - (ways * normal).sum(axis=1)[:, None] * normal
    ways = ways / np.linalg.norm(ways, axis=1)[:, None]
    c, s = (ways * first).sum(axis=1), (ways * np.cross(normal, first)).sum(axis=1)
    e11, e12, e22 = strain.T
    return e11 * c * c + 2 * e12 * c * s + e22 * s * s


def test_a_table_cloth_s_growth_is_the_harmonic_function_of_a_ring():
    """The paper's Fig. 2 (e): around at the hem, none on the table's edge; log(r / a) / log(b / a) in between."""
    errors = []
    for count in (900, 3600):
        strokes = [
            {"points": ring(0.5), "stretch": (1.0, 1.0)},
            {"points": ring(1.0), "stretch": (1.5, 1.0), "frame": "along"},
        ]
        state, tools = painted(strokes, count, shape="disc")
        middle = state.x[state.mesh.triangles].mean(axis=1)
        around = np.stack([-middle[:, 1], middle[:, 0], 0 * middle[:, 0]], -1)
        found = rates(state, dict(enumerate(tools)), 0.05).strain
        r = np.linalg.norm(middle, axis=1)
        exact = np.log(1.5) * np.log(np.maximum(r, 0.5) / 0.5) / np.log(2)
        # the ring is that of the nearest vertices
        inside = r > 0.6
        errors.append(np.abs(along(state, found, around) - exact)[inside].max() / np.log(1.5))
        assert (found[:, 0] + found[:, 2])[inside] == pytest.approx(along(state, found, around)[inside], abs=5e-3)
        assert np.abs(found[r < 0.4]).max() < 5e-3
    assert errors[1] < 0.75 * errors[0] < 0.1


def test_on_a_tube_rates_are_linear_between_its_ends_and_turn_from_along_to_around():
    """Equal and opposite directions are one: tensors do not care which way a stroke was drawn."""
    strokes = [
        {"points": ring(1.0, 0.0), "stretch": (1.2, 1.0), "frame": "around", "width": 0.01},
        {"points": ring(1.0, 4.0)[::-1], "stretch": (2.0, 1.0), "frame": "along", "width": 0.01},
    ]
    state, tools = painted(strokes, 1500, shape="tube", aspect=4.0)
    middle = state.x[state.mesh.triangles].mean(axis=1)
    around = np.stack([-middle[:, 1], middle[:, 0], 0 * middle[:, 0]], -1)
    found = rates(state, dict(enumerate(tools)), 0.05).strain
    share = middle[:, 2] / 4
    exact = (1 - share) * np.log(1.2) + share * np.log(2.0)
    assert along(state, found, around) == pytest.approx(exact, abs=0.01)
    up = np.broadcast_to([0.0, 0.0, 1.0], middle.shape)
    assert along(state, found, up) == pytest.approx(np.zeros(len(middle)), abs=0.01)


def test_painted_directions_ride_on_the_sheet():
    """Turned, bent and stretched after they were painted, the sheet grows along the same lines of its material."""
    strokes = [
        {"points": [(-1, -0.5, 0), (-1, 0.5, 0)], "stretch": (1.0, 1.5), "frame": (0.4, 1, 0)},
        {"points": [(1, -0.5, 0), (1, 0.5, 0)], "stretch": (1.5, 1.0), "frame": (1, 0.3, 0)},
    ]
    state, tools = painted(strokes, 600, shape="strip", aspect=2.0)
    before = rates(state, dict(enumerate(tools)), 0.05).strain
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    for moved in (state.x @ turn, np.stack([np.sin(state.x[:, 0]), state.x[:, 1], np.cos(state.x[:, 0])], -1)):
        after = rates(replace(state, x=moved), dict(enumerate(tools)), 0.05).strain
        assert after == pytest.approx(before, abs=1e-12)
    # a stretched rest state carries lines along: what lay at 45 degrees is steeper by the factor
    g = state.g.copy()
    p = state.x[state.mesh.triangles] * [1.0, 2.0, 1.0]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    g = np.stack([(a * a).sum(-1), (a * b).sum(-1), (b * b).sum(-1)], -1)
    strained = replace(state, x=state.x * [1.0, 2.0, 1.0], g=g)
    lines = [{"points": [(-1, -0.5, 0), (-1, 0.5, 0)], "stretch": (1.5, 1.0), "frame": (1, 1, 0)}]
    slanted, tools = painted(lines, 600, shape="strip", aspect=2.0)
    strained = replace(strained, shares=slanted.shares)
    found = rates(strained, dict(enumerate(tools)), 0.05).strain
    ways = np.broadcast_to([1.0, 2.0, 0.0], (len(found), 3))
    assert along(strained, found, ways) == pytest.approx(np.log(1.5), abs=1e-9)


def test_they_stay_through_cuts_and_turned_edges():
    """A square that grows along one diagonal alone becomes a rhombus, however often it is remeshed."""
    strokes = [{"points": [(-0.5, -0.5, 0), (0.5, 0.5, 0)], "stretch": (2.0, 1.0)}]
    values = {
        "tools": [{"kind": "tensors", "strokes": strokes}],
        "shape": "square",
        "imperfection": 0,
        "remesh": 1.3,
        "attached": [{"where": {"kind": "everywhere"}, "axes": ["z"]}],
    }
    made = Engine(GrowthParams.parse(values), 300)
    state = made.reach(1.0, Context())
    assert len(state.x) > 400
    first, second = np.array([[1, 1, 0], [1, -1, 0]]) / np.sqrt(2)
    assert np.ptp(state.x @ first) == pytest.approx(2 * np.sqrt(2), rel=1e-3)
    assert np.ptp(state.x @ second) == pytest.approx(np.sqrt(2), rel=1e-3)


@pytest.mark.parametrize(
    ("strokes", "said"),
    [
        ([{"points": [(0, 0, 0)], "stretch": (2.0, 1.0)}], "no direction at 1 of its vertices"),
        ([{"points": [(0, 0, 0)], "stretch": (2.0, 1.0), "frame": "around", "width": 0.01}], "no direction"),
    ],
)
def test_a_stroke_that_goes_nowhere_has_no_direction(strokes, said):
    with pytest.raises(InvalidInput, match=said):
        painted(strokes, 300, shape="disc")
