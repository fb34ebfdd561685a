"""Holds end at the line that was asked for: areas by clipping, energies of what is bent outside of it alone."""

from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.contract import Context
from solver.growth.engine import Engine
from solver.growth.fresh import fresh
from solver.growth.params import GrowthParams
from solver.growth.remeshing.cuts import cut
from solver.growth.remeshing.flips import flip
from solver.growth.settling.active import _part
from solver.growth.settling.energy import StepEnergy, elastic
from solver.growth.settling.tangent import Tangent
from solver.growth.shapes import Ground, start
from solver.growth.state import State
from solver.growth.tooling.holding import free_shares
from solver.growth.tooling.places import anywhere, share
from solver.growth.tooling.placing import border

from ._differences import differences

BENDING = 1e-3


def band(line: float, along: str = "x", width: float = 0.2) -> dict:
    """What lies below a line of a coordinate."""
    return {"kind": "band", "along": along, "low": line + width / 2, "high": line - width / 2}


def held(*places, shape: str = "disc", vertices: int = 300, axes=("x", "y", "z"), **values) -> State:
    attached = [{"where": where, "axes": axes} for where in places]
    params = GrowthParams.parse({"shape": shape, "imperfection": 0, "attached": attached, "tools": []} | values)
    return fresh(params, start(params.shape, vertices, params.aspect))


def outside(corners: np.ndarray, line: float, along: int = 0) -> float:
    """Return the share of a triangle (3, 3) in the plane that lies beyond a line, by clipping."""
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[along] > line:
            kept.append(a)
        if (a[along] > line) != (b[along] > line):
            kept.append(a + (line - a[along]) / (b[along] - a[along]) * (b - a))
    areas = [
        sum(p[0] * q[1] - p[1] * q[0] for p, q in zip(points, np.roll(points, -1, axis=0), strict=True)) / 2
        for points in (kept or [np.zeros(3)], corners)
    ]
    return areas[0] / areas[1]


def clipped(state: State, line: float, along: int = 0) -> np.ndarray:
    return np.array([outside(state.matter["home"][t], line, along) for t in state.mesh.triangles])


def bent(state: State, line: float, along: int, bending: str) -> float:
    """Return the energy of a sheet that is bent to a cylinder beyond a line near its middle, over what it should be.

    That is, of the same triangles bent all over with nothing held, half, and in proportion what lies between.
    """
    flat, material, found = state.matter["home"], shell.Material(0.1), []
    for where, loose in ((line, state.loose), (flat[:, along].min(), None)):
        x = flat.copy()
        x[:, 2] += BENDING / 2 * np.maximum(flat[:, along] - where, 0) ** 2
        found.append(elastic(replace(state, x=x, loose=loose), material, bending))
    return found[0] / (found[1] * (0.5 - line / np.ptp(flat[:, along])))


@pytest.mark.parametrize("bending", ["hinges", "mean_curvature"])
@pytest.mark.parametrize(("along", "aspect"), [("x", 1.0), ("y", 4.0)])
def test_what_is_bent_beyond_the_line_alone_has_the_energy_of_what_lies_there(bending, along, aspect):
    """Wherever the line lies between two rows, across them and along them, before and after cuts.

    Where all hinges are as stiff it is .99 down to .957 of that.
    """
    for line in np.linspace(-0.05, 0.05, 6):
        state = held(band(line, along), shape="strip", vertices=900, aspect=aspect, curved=False)
        finer, _ = cut(state, 0.9 * state.length)
        assert len(finer.x) > 1.5 * len(state.x)
        found = [bent(each, line, "xy".index(along), bending) for each in (state, finer)]
        assert found == pytest.approx([1.0, 1.0], abs=0.012), line


@pytest.mark.parametrize("line", [-0.53, 0.111])
def test_triangles_know_which_share_of_them_is_held_and_so_do_their_children(line):
    state = held(band(line))
    finer = flip(cut(cut(state, 0.9 * state.length)[0], 0.6 * state.length)[0])
    for each in (state, finer):
        exact = clipped(each, line)
        reached = each.loose != 1
        assert reached.any()
        # what is held whole bends nowhere, and is not asked
        near = (exact > 0) & (exact < 1)
        assert np.abs(each.loose - exact)[near].max() < 0.06
        assert np.abs(each.loose - exact)[near].mean() < 0.015
        assert each.loose[exact == 1] == pytest.approx(1.0)
        hinges = each.mesh.hinges[~each.held[each.mesh.hinges].all(axis=(1, 2))]
        bending = np.isin(each.mesh.triangles, hinges).all(axis=1)
        assert not (each.loose[bending & (exact == 0)] > 1e-12).any()


def test_a_direction_holds_the_bending_as_far_as_the_normal_lies_in_it():
    whole, part = held(band(0.1)), held(band(0.1), axes=("z",))
    free = ~whole.held[whole.mesh.hinges].all(axis=(1, 2))
    assert np.array_equal(free_shares(part)[0][free], free_shares(whole)[0][free])
    assert (held(band(0.1), axes=("x", "y")).loose == 1).all()
    upright = {"shape": "tube", "vertices": 400, "aspect": 2.0}
    assert held(band(1.0, "z"), axes=("z",), **upright).loose.min() > 0.99
    assert held(band(1.0, "z"), axes=("x", "y"), **upright).loose.min() < 0.01
    # a cone as high as it is wide: its normals have half their square along z
    cone = held(band(0.5, "z"), axes=("z",), shape="cone", vertices=400, aspect=1.0)
    assert cone.loose.min() == pytest.approx(0.5, abs=0.03)


def test_several_holds_hold_what_any_of_them_does():
    both = held(band(0.2), band(-0.4)).loose
    assert np.array_equal(both, held(band(0.2)).loose)
    crossed = held(band(-0.3), band(-0.3, "y"))
    exact = clipped(crossed, -0.3) * clipped(crossed, -0.3, 1)
    alone = (clipped(crossed, -0.3) == 1) | (clipped(crossed, -0.3, 1) == 1)
    near = (crossed.loose != 1) & alone & (exact > 0)
    assert near.any()
    assert np.abs(crossed.loose - exact)[near].max() < 0.06
    # directions of one and of another add up
    parts = {"attached": [{"where": band(0.2), "axes": [axis]} for axis in "xyz"]}
    assert held(**parts).loose == pytest.approx(held(band(0.2)).loose, abs=1e-12)


@pytest.mark.parametrize("kind", ["painted", "harmonic"])
def test_what_is_known_at_vertices_alone_is_held_up_to_half_between_them(kind):
    """Values that are even along the sheet: half of them is at a line, before and after cuts."""
    mesh = start("strip", 500, 4.0)
    values = np.clip(0.5 - (mesh.x[:, 0] - 0.07) / 5, 0, 1)
    place = {"kind": "painted", "values": values.tolist()}
    if kind == "harmonic":
        some = np.isclose(np.abs(mesh.x[:, 0]), 2.0)
        place = {"kind": kind, "points": mesh.x[some].tolist(), "values": values[some].tolist()}
    state = held(place, shape="strip", vertices=500, aspect=4.0)
    # harmonic values are even but for their last digits
    for each in (state, cut(state, 0.9 * state.length)[0]):
        exact = clipped(each, 0.07)
        near = (exact > 0) & (exact < 1)
        assert near.sum() > 10
        assert np.abs(each.loose - exact)[near].max() < 0.06


PLACES = [
    {"kind": "everywhere"},
    {"kind": "ball", "centre": [0.3, 0, 0], "radius": 0.7},
    {"kind": "band", "along": "radius", "low": 0.9, "high": 0.2},
    {"kind": "rim", "width": 0.5},
    {"kind": "meridians", "count": 5, "width": 0.4},
    {"kind": "lines", "lines": [[[-1, 0, 0], [0.5, 0.2, 0]]], "width": 0.4},
    {"kind": "noise", "size": 0.4},
    {"kind": "texture", "values": [[0, 1, 0.3], [0.2, 0.6, 0.9]], "projection": "z"},
    {"kind": "texture", "values": [[0, 1, 0.3], [0.2, 0.6, 0.9]], "projection": "round"},
    {"kind": "texture", "values": [[0, 1, 0.3], [0.2, 0.6, 0.9]], "projection": "sphere"},
    {"kind": "reaction", "steps": 500, "size": 16},
]


@pytest.mark.parametrize("where", PLACES, ids=lambda where: f"{where['kind']}-{where.get('projection', '')}")
def test_a_place_is_told_anywhere_as_at_vertices(where):
    """Points are told by themselves: some of the vertices alone have the shares that they have among all."""
    params = GrowthParams.parse({"shape": "disc", "attached": [{"where": where}]})
    mesh = start("disc", 300, 1.0)
    place, ground = params.attached[0].where, Ground(mesh, border(shell.topology(mesh.triangles, len(mesh.x))))
    assert anywhere(place)
    assert np.array_equal(share(place, ground, 3, mesh.x[20:50]), share(place, ground, 3)[20:50])


def test_derivatives_are_those_of_differences_where_a_hold_ends():
    state = held(band(0.05), vertices=60, thickness=0.5)
    x = state.x + 0.1 * state.length * ~state.held * np.random.default_rng(0).normal(size=state.x.shape)
    energy = StepEnergy(state, shell.Material(0.5), 0.0, (), Tangent(state.mesh), gravity=(0.0, 0.0, 0.1))
    free = ~state.held.ravel()
    assert free_shares(state)[0].min() < 0.1
    matrix, gradient = energy.hessian(x).toarray()[free][:, free], energy(x)[1].ravel()[free]
    slopes, columns = differences(energy, x)
    assert np.abs(matrix - columns[free][:, free]).max() <= 1e-7 * np.abs(columns).max()
    assert np.abs(gradient - slopes[free]).max() <= 1e-6 * np.abs(gradient).max()


def test_a_part_that_settles_alone_is_as_stiff_as_in_the_whole():
    state = held(band(0.05))
    part = _part(state.mesh, np.hypot(*state.x[:, :2].T) < 0.3)
    whole, own = (
        StepEnergy(each, shell.Material(0.1), 0.0, (), Tangent(each.mesh)).stiffness for each in (state, part.of(state))
    )
    assert np.array_equal(own, whole[part.hinges])
    assert own.max() > 5 * own.min()


def test_what_is_led_takes_its_line_along_through_remeshing():
    """Half a disc is led away in its plane while the other half grows: what is held is found where it came from."""
    grow = {"kind": "surface", "where": band(-0.1, width=-0.2), "stretch": [2.0, 2.0]}
    hold = {"where": band(-0.3), "velocity": [-0.5, 0.0, 0.0]}
    params = GrowthParams.parse({"shape": "disc", "imperfection": 0, "tools": [grow], "attached": [hold]})
    state = Engine(params, 200, 1e-4, history=False).reach(1.0, Context())
    assert len(state.x) > 300, "nothing was cut"
    fixed = state.held.all(axis=1)
    assert state.x[fixed] == pytest.approx(state.matter["home"][fixed] + [-0.5, 0, 0], abs=1e-12)
    exact = clipped(state, -0.3)
    near = (exact > 0.02) & (exact < 0.98)
    assert near.sum() > 10
    assert np.abs(state.loose - exact)[near].max() < 0.06


def test_what_nothing_holds_is_asked_nothing():
    state = held()
    assert state.holds is None
    assert state.loose is None
    assert "home" not in state.matter
    # a place in which no vertex lies holds nothing
    missed = held({"kind": "ball", "centre": [0.03, 0.02, 0], "radius": 0.01})
    assert not missed.held.any()
    assert (missed.loose == 1).all()
