"""Distances along a surface against closed forms, and tools that measure by them: bending a sheet changes nothing."""

from dataclasses import replace

import numpy as np
import pytest

from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.shapes import start
from solver.growth.tooling.geodesic import carried, distances
from solver.growth.tooling.placing import started
from solver.growth.tooling.rates import rates


def from_vertex(mesh, point):
    """Return distances from a vertex of a mesh, those of its neighbours being given."""
    at = int(np.linalg.norm(mesh.x - point, axis=1).argmin())
    seeds = np.unique(mesh.triangles[(mesh.triangles == at).any(axis=1)])
    given = np.linalg.norm(mesh.x[seeds] - mesh.x[at], axis=1)
    return mesh.x[at], distances(mesh.x, mesh.triangles, seeds, given, 10.0, straight=False).away


def test_distances_in_a_plane_are_exact():
    mesh = start("disc", 900, 1.0)
    at, found = from_vertex(mesh, [0.3, 0.1, 0])
    assert found == pytest.approx(np.linalg.norm(mesh.x - at, axis=1), abs=1e-9)


def test_distances_on_a_cylinder_are_those_of_the_sheet_that_it_is_rolled_of():
    errors = []
    for count in (600, 2400):
        mesh = start("tube", count, 4.0)
        at, found = from_vertex(mesh, [1, 0, 0])
        turn = np.arctan2(mesh.x[:, 1], mesh.x[:, 0]) - np.arctan2(at[1], at[0])
        flat = np.hypot(turn, mesh.x[:, 2] - at[2])
        # where ways from both sides are about as long, the corners of a triangle have ways that are no neighbours
        errors.append(np.abs(found - flat)[np.abs(turn) < 2.5].max())
    assert errors[0] < 0.01
    assert errors[1] < 0.35 * errors[0], "order 2"


def test_distances_on_a_sphere_are_arcs():
    errors = []
    for count in (600, 2400, 9600):
        mesh = start("sphere", count, 1.0)
        at, found = from_vertex(mesh, [0, 0, 1.0])
        arc = np.arccos(np.clip(mesh.x @ at, -1, 1))
        errors.append(np.abs(found - arc)[arc < 2.0].max())
    assert errors[2] < 0.3 * errors[0] < 0.01


def test_distances_from_a_line_are_exact_and_from_a_ring_as_good_as_the_mesh():
    for count in (600, 2400):
        mesh = start("disc", count, 1.0)
        edge = np.sqrt(np.pi / count)
        radius = np.hypot(*mesh.x.T[:2])
        for exact, least in ((np.abs(mesh.x[:, 0]), 1e-5 * edge), (np.abs(radius - 0.4), 0.2 * edge)):
            seeds = np.flatnonzero(exact < 1.2 * edge)
            found = distances(mesh.x, mesh.triangles, seeds, exact[seeds], 10.0, straight=True).away
            assert found[radius > 0.1] == pytest.approx(exact[radius > 0.1], abs=least)


def test_what_is_beyond_the_limit_is_infinitely_far_and_what_is_carried_comes_from_the_nearest():
    mesh = start("strip", 900, 4.0)
    seeds = np.flatnonzero(np.abs(mesh.x[:, 1]) < 0.05)
    found = distances(mesh.x, mesh.triangles, seeds, np.abs(mesh.x[seeds, 1]), 0.3, straight=True)
    assert np.isinf(found.away[np.abs(mesh.x[:, 1]) > 0.31]).all()
    values = np.zeros((len(mesh.x), 1))
    values[seeds, 0] = mesh.x[seeds, 0]
    told = carried(found, values)[:, 0]
    reached = np.isfinite(found.away)
    # a line's nearest point lies straight across
    assert told[reached] == pytest.approx(mesh.x[reached, 0], abs=0.03)


#: A sheet of 4 by 1, bent to a U of radius .1 whose arms are .2 apart.
RADIUS = 0.1
#: What lies near the bend; a spot's frame is a direction in space, which the bend must not turn.
TOOLS = {
    "spot": {"kind": "spot", "at": (0.3, 0.1, 0), "radius": 0.6, "stretch": (1.5, 1.2), "frame": (0, 1, 0)},
    "polar": {"kind": "spot", "at": (0.3, 0.1, 0), "radius": 0.6, "stretch": (1.5, 1.1), "polar": True},
    "curve": {
        "kind": "curve",
        "points": [(0.2, -0.4, 0), (0.5, 0.4, 0)],
        "radius": 0.5,
        "stretch": (1.1, 1.4),
        "intensities": [0.2, 1.0],
    },
    "stroke": {"kind": "stroke", "points": [(0.3, 0.1, 0)], "radius": 0.6, "stretch": (1.3, 1.3)},
}


def bent(x):
    """Return points of the sheet where it is bent about the y axis: lengths along it stay."""
    s = x[:, 0]
    half = np.pi * RADIUS / 2
    turn = np.clip(s, -half, half) / RADIUS
    beyond = np.maximum(np.abs(s) - half, 0.0) * np.sign(s)
    across = RADIUS * np.sin(turn) + beyond * np.cos(turn)
    return np.stack([across, x[:, 1], RADIUS * (1 - np.cos(turn)) + beyond * np.sin(turn)], -1)


@pytest.mark.parametrize("name", TOOLS)
def test_a_sheet_that_is_bent_grows_where_the_flat_one_does(name):
    """Through space a tool near the bend reaches less far along the sheet, or more, than on the flat one."""
    tool = TOOLS[name]
    off = []
    for distance in ("surface", "space"):
        found = []
        for shape in (lambda x: x, bent):
            # triangles are small at the bend
            values = {"shape": "strip", "aspect": 4.0, "imperfection": 0, "remesh": 0, "contact": 0}
            state = Engine(GrowthParams.parse(values | {"tools": [tool | {"distance": distance}]}), 8000).state
            made = GrowthParams.parse({"tools": [tool | {"distance": distance}]}).tools[0]
            # placed on the flat sheet, so that it rides there
            state = replace(started(state, [made], 0.1, 0), x=shape(state.x))
            found.append(rates(state, {0: made}, 0.05).strain)
        off.append(np.abs(found[1] - found[0]).max() / np.abs(found[0]).max())
    assert off[0] < 0.05
    assert off[1] > 0.15
