"""Generators of growth against known answers: harmonic functions, clocks along curves, apexes, L-systems, weight."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from solver.contract import Context, InvalidGeometry, InvalidInput, Need
from solver.growth import SOLVER
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.shapes import Ground, Mesh, start
from solver.growth.tooling.harmonic import harmonic, harmonic_tensors
from solver.growth.tooling.places import Reaction, Texture, share
from solver.growth.tooling.placing import border, branched, started
from solver.growth.tooling.rates import rates
from solver.growth.tooling.textures import gray_scott, laid
from solver.shell import topology


def ground(mesh: Mesh) -> Ground:
    return Ground(mesh, np.empty(0, np.int64))


def engine(*tools, **values) -> Engine:
    return Engine(GrowthParams.parse({"tools": list(tools), "imperfection": 0, "remesh": 0} | values), 900)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_painted_borders_spread_as_harmonic_functions(order):
    """Re z^k on the rim of a disc is Re z^k inside it; the error falls with the square of the mesh size."""
    errors = []
    for count in (400, 1600):
        mesh = start("disc", count, 1.0)
        rim = border(topology(mesh.triangles, len(mesh.x)))
        exact = ((mesh.x[:, 0] + 1j * mesh.x[:, 1]) ** order).real
        errors.append(float(np.abs(harmonic(mesh.x, mesh.triangles, rim, exact[rim]) - exact).max()))
    assert errors[1] < 1e-10 if order == 1 else errors[1] < 0.45 * errors[0] < 0.01


def test_a_tensor_painted_on_both_sides_turns_in_between_and_keeps_its_rates():
    """Directions at +-45 degrees on the left and right of a strip: along x, or across it, in the middle."""
    mesh = start("strip", 600, 2.0)
    ends = np.flatnonzero(np.abs(np.abs(mesh.x[:, 0]) - 1.0) < 1e-9)
    left = mesh.x[ends, 0] < 0
    turn = np.where(left, np.pi / 8, -np.pi / 8)
    ways = np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
    pair = np.broadcast_to([0.8, 0.1], (len(ends), 2))
    found, along = harmonic_tensors(mesh.x, mesh.triangles, ends, ways, pair)
    middle = np.abs(mesh.x[:, 0]) < 0.05
    assert found == pytest.approx(np.broadcast_to([0.8, 0.1], found.shape), abs=1e-9)
    assert np.linalg.norm(along, axis=1) == pytest.approx(np.ones(len(along)))
    assert np.abs(along[middle, 0]).min() > 0.99
    assert np.abs((along[ends] * ways).sum(axis=1)) == pytest.approx(np.ones(len(ends)), abs=1e-9)


def test_a_part_without_paint_is_refused():
    mesh = start("disc", 100, 1.0)
    two = np.concatenate([mesh.triangles, mesh.triangles + len(mesh.x)])
    apart = np.concatenate([mesh.x, mesh.x + 5.0])
    with pytest.raises(InvalidInput, match="part"):
        harmonic(apart, two, np.array([0]), np.array([1.0]))


def test_a_texture_lies_where_its_map_says():
    square = start("square", 400, 1.0)
    x = square.x
    ramp = np.array([[0.0, 1.0], [0.0, 1.0]])
    assert laid(ramp, ground(square), "z") == pytest.approx(x[:, 0] + 0.5, abs=1e-9)
    assert laid(ramp.T, ground(square), "z") == pytest.approx(x[:, 1] + 0.5, abs=1e-9)
    tube = start("tube", 400, 2.0)
    waves = np.cos(2 * np.pi * np.arange(64) / 64)[None, :].repeat(2, axis=0)
    assert laid(waves, ground(tube), "round") == pytest.approx(tube.x[:, 0], abs=2e-3)


def test_a_map_of_a_body_lies_around_the_origin_as_in_files():
    """Coordinates themselves, drawn as maps are: y up, colatitude down from it, azimuth from x towards z."""
    sphere, errors = start("sphere", 2500, 1.0), []
    for rows in (32, 64):
        colatitude = (np.arange(rows) + 0.5) / rows * np.pi
        azimuth = (np.arange(2 * rows + 1) + 0.5) / (2 * rows + 1) * 2 * np.pi
        axes = (
            np.outer(np.sin(colatitude), np.cos(azimuth)),
            np.outer(np.cos(colatitude), np.ones_like(azimuth)),
            np.outer(np.sin(colatitude), np.sin(azimuth)),
        )
        # files turn z up into y up: (x, y, z) becomes (x, z, -y)
        turned = np.stack([sphere.x[:, 0], sphere.x[:, 2], -sphere.x[:, 1]])
        found = [share(Texture(picture=(axis + 1) / 2, projection="sphere"), ground(sphere), 0) for axis in axes]
        errors.append(np.abs(2 * np.array(found) - 1 - turned).max())
    assert errors[1] < 0.012
    assert errors[1] < errors[0]
    scaled = ground(sphere._replace(x=3.7 * sphere.x))
    assert share(Texture(picture=(axes[1] + 1) / 2, projection="sphere"), scaled, 0) == pytest.approx(found[1])


def test_a_picture_has_its_first_row_on_top():
    square = ground(start("square", 100, 1.0))
    rows = [[0.9, 0.9], [0.5, 0.5], [0.1, 0.1]]
    picture = share(Texture(picture=rows, projection="z"), square, 0)
    assert picture == pytest.approx(share(Texture(values=rows[::-1], projection="z"), square, 0))
    assert picture == pytest.approx(0.5 + 0.8 * square.mesh.x[:, 1])


@pytest.mark.parametrize("place", [{"kind": "texture", "picture": [[0, 1], [1, 0]]}, {"kind": "reaction", "steps": 1}])
def test_coordinates_are_asked_of_a_mesh_that_has_some(place):
    place = place | {"projection": "uv"}
    bare = start("square", 30, 1.0)
    mesh = {"points": bare.x.tolist(), "faces": bare.triangles.tolist()}
    surface = {"kind": "surface", "where": {"kind": "everywhere"}}
    for wrong in (
        {"tools": [surface | {"paced": place}]},
        {"thicknesses": [{"where": place, "times": 2}], "mesh": mesh},
        {"ribs": [{"where": place}]},
        {"attached": [{"where": place}]},
        {"bed": {"where": place, "wavelength": 1}},
    ):
        with pytest.raises(InvalidGeometry, match=r'projection = "uv" has no texture coordinates.*sphere'):
            GrowthParams.parse(wrong)
    with pytest.raises(InvalidInput, match="has none"):
        share(Reaction(projection="uv", steps=1), ground(bare), 0)


def test_runs_without_pictures_keep_their_words():
    """Stored runs are found by what their parameters say."""
    texture = {"kind": "texture", "values": [[0.0, 1.0], [1.0, 0.0]], "projection": "z"}
    assert Texture.model_validate(texture).model_dump(mode="json") == texture


def test_a_reaction_makes_a_pattern_of_its_seed():
    one, again, other = (gray_scott(0.035, 0.06, 32, 1500, seed) for seed in (1, 1, 2))
    assert (one == again).all()
    assert (one != other).any()
    assert one.std() > 0.2, "no pattern"


def test_a_curve_with_offsets_and_paces_runs_by_its_own_clock():
    """A ramp of intensity that begins later to the right, and goes twice as fast there."""
    tool = {
        "kind": "curve",
        "points": [(-1, 0, 0), (1, 0, 0)],
        "radius": 0.2,
        "stretch": (np.e, 1.0),
        "activation": [(0, 0), (1, 1)],
    }
    made = engine(tool | {"offsets": [0.0, 0.4], "paces": [1.0, 2.0]}, shape="strip", aspect=2.0)
    state = started(made.state, made.script.tools, 0.05, 0)
    middles = state.x[state.mesh.triangles].mean(axis=1)
    # the curve runs along x, and so does its first stretch: the trace is the share
    strain = rates(state, {0: made.script.tools[0]}, 0.5).strain
    share = strain[:, 0] + strain[:, 2]
    on = np.abs(middles[:, 1]) < 0.02
    u = (middles[on, 0] + 1) / 2
    expected = np.interp((0.5 - 0.4 * u) * (1 + u), [0, 1], [0, 1])
    assert on.sum() > 10
    assert share[on] == pytest.approx(expected, rel=0.12)
    assert not rates(state, {0: made.script.tools[0].model_copy(update={"delay": 0.6})}, 0.5).strain.any()


def test_a_surface_that_starts_later_further_out():
    tool = {
        "kind": "surface",
        "where": {"kind": "everywhere"},
        "later": {"kind": "band", "along": "radius", "low": 0.49, "high": 0.51},
        "offset": 0.5,
    }
    made = engine(tool, shape="disc")
    state = started(made.state, made.script.tools, 0.05, 0)
    out = np.linalg.norm(state.x[state.mesh.triangles].mean(axis=1), axis=1)
    early, late = (np.abs(rates(state, {0: made.script.tools[0]}, t).strain).sum(axis=1) for t in (0.25, 0.75))
    assert (early[out < 0.4] > 0).all()
    assert not early[out > 0.6].any()
    assert (late > 0).all()


def test_a_surface_goes_at_its_own_pace_further_out():
    """While (t - t0) pace < 1, the paper's 4.3: four times as fast outside it is over after a quarter of the time."""
    tool = {
        "kind": "surface",
        "where": {"kind": "everywhere"},
        "later": {"kind": "band", "along": "radius", "low": 0.49, "high": 0.51},
        "offset": 0.2,
        "paced": {"kind": "band", "along": "radius", "low": 0.49, "high": 0.51},
        "pace": 4.0,
        "activation": [(0, 1), (1, 1), (1.0001, 0)],
    }
    made = engine(tool, shape="disc")
    state = started(made.state, made.script.tools, 0.05, 0)
    out = np.linalg.norm(state.x[state.mesh.triangles].mean(axis=1), axis=1)
    for time, within, beyond in ((0.1, True, False), (0.4, True, True), (0.5, True, False), (1.1, False, False)):
        acts = np.abs(rates(state, {0: made.script.tools[0]}, time).strain).sum(axis=1) > 0
        assert (acts[out < 0.4] == within).all()
        assert (acts[out > 0.6] == beyond).all()


def test_a_curve_is_made_about_the_apex_where_it_is_then():
    """The ring follows a hot spot that has moved, at its distance, and rides on the surface afterwards."""
    spot = {"kind": "spot", "at": (0, 0, 1), "radius": 0.5, "stretch": (4, 4)}
    ring = {"kind": "curve", "apex": {"tool": 0, "radius": 0.2}, "closed": True, "start": 0.5}
    made = engine(spot, ring, shape="sphere")
    while made.state.time < 0.55 - 1e-9:
        made.advance(1e9, until=made.state.time + 0.05)
    state = made.state
    tip = state.spots[0][0].anchor.at(state.x, state.mesh.triangles)[0]
    points = state.curves[1].at(state.x, state.mesh.triangles)
    assert tip[2] > 1.1
    assert np.linalg.norm(points - tip, axis=1) == pytest.approx(np.full(len(points), 0.2), rel=0.25)
    assert KDTree(state.x).query(points)[0].max() < 0.12


def test_an_apex_without_its_spot_is_refused():
    with pytest.raises(InvalidInput, match="no hot spot"):
        engine({"kind": "curve", "apex": {"tool": 3}}).advance(1e9, until=0.05)


def test_an_l_system_writes_the_spots_it_should():
    """Lindenmayer's algae, A -> AB, B -> A: Fibonacci's numbers, with letters in their order."""
    tool = {"kind": "spot", "at": (0, 0, 1), "splits": (0.1, 0.2, 0.3, 0.4), "rules": {"A": ["AfB"], "B": ["A"]}}
    made = engine(tool, shape="sphere")
    state = started(made.state, made.script.tools, 0.05, 0)
    words = []
    for time in (0.1, 0.2, 0.3, 0.4):
        state = branched(replace(state, time=time), {0: made.script.tools[0]}, 0)
        words.append("".join(spot.letter for spot in state.spots[0]))
    assert words == ["AB", "ABA", "ABAAB", "ABAABABA"]


def test_a_fork_turns_by_its_angle():
    tool = {
        "kind": "spot",
        "at": (0, 0, 0),
        "radius": 0.3,
        "spread": 1.0,
        "splits": (0.1,),
        "turn": 45.0,
        "shrink": 0.5,
        "rules": {"A": ["[+f!A][-f!A]"]},
    }
    made = engine(tool, shape="disc")
    state = started(made.state, made.script.tools, 0.05, 0)
    spots = branched(replace(state, time=0.1), {0: made.script.tools[0]}, 0).spots[0]
    ends = np.array([spot.anchor.at(state.x, state.mesh.triangles)[0] for spot in spots])
    r = 0.3 * np.sqrt(0.5)
    assert ends == pytest.approx(np.array([[r, r, 0], [r, -r, 0]]), abs=1e-6)
    assert [spot.radius for spot in spots] == [0.15, 0.15]


@pytest.mark.parametrize(
    ("tool", "said"),
    [
        ({"kind": "spot", "at": (0, 0, 1), "rules": {"A": ["[A"]}}, "tools.0.spot.rules.*brackets"),
        ({"kind": "spot", "at": (0, 0, 1), "rules": {"A": ["Ax"]}}, "tools.0.spot.rules.*signs"),
        ({"kind": "curve"}, "tools.0.curve.*apex"),
        ({"kind": "curve", "points": [(0, 0, 0), (1, 0, 0)], "paces": [1]}, "tools.0.curve.*paces"),
        ({"kind": "surface", "where": {"kind": "texture", "values": [[1, 2], [3]]}}, "tools.0.*texture"),
        ({"kind": "surface", "where": {"kind": "texture", "picture": [[1, 0]]}}, "tools.0.*two at least"),
        ({"kind": "surface", "where": {"kind": "texture"}}, "tools.0.*either values or a picture"),
        ({"kind": "surface", "where": {"kind": "texture", "picture": [[1, 2], [0, 0]]}}, "tools.0.*less than or equal"),
    ],
)
def test_a_wrong_entry_is_named(tool, said):
    with pytest.raises(InvalidInput, match=said):
        engine(tool)


def test_a_hanging_strip_stretches_by_its_weight():
    """A strip of weight q per area held above: strain q (L - s) / E, E = 2 (1 + nu) mu; nu = 0 gives elongation."""
    weight, length = 0.01, 2.0
    made = Engine(
        GrowthParams.parse(
            {
                "shape": "strip",
                "aspect": length,
                "poisson": 0.0,
                "imperfection": 0,
                "remesh": 0,
                "tools": [],
                "gravity": (weight, 0, 0),
                "attached": [{"where": {"kind": "band", "along": "x", "low": -0.9, "high": -1.0}}],
            }
        ),
        600,
        1e-7,
    )
    made.advance(1e9, until=0.05)
    assert made.state.x[:, 0].max() - 1.0 == pytest.approx(weight * (length - 0.05) ** 2 / 4, rel=0.03)


def test_normalised_outgrowth_stays_flat():
    """G19: kept in its plane, what grows out at a disc's rim fits best at lambda = 1."""
    energies = []
    for normalised in (0.0, 1.0, 2.0):
        turns = 2 * np.pi * np.arange(32) / 32
        rim = {
            "kind": "curve",
            "points": [(np.cos(t), np.sin(t), 0.0) for t in turns],
            "closed": True,
            "radius": 0.5,
            "stretch": (1.0, 2.0),
            "normalised": normalised,
        }
        held = {"where": {"kind": "everywhere"}, "axes": ["z"]}
        values = {"shape": "disc", "tools": [rim], "attached": [held]}
        run = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.5,), quality="preview", fields=("stored_energy",)))
        energies.append(float(run.stored_energy[0]))
    print(energies)
    assert energies[1] < 0.25 * min(energies[0], energies[2])


@pytest.mark.parametrize("distance", ["space", "surface"])
def test_a_polar_spot_grows_away_from_itself_and_around(distance):
    """Whichever way a triangle lies from the spot, turned by an angle as well."""
    for angle in (0.0, 30.0):
        spot = {"kind": "spot", "at": (0.2, 0.1, 0), "radius": 0.5, "kernel": "flat", "stretch": (1.5, 1.1)}
        made = engine(spot | {"polar": True, "angle": angle, "distance": distance}, shape="disc")
        state, tool = made.state, made.params.tools[0]
        state = started(state, [tool], 0.1, 0)
        found = rates(state, {0: tool}, 0.05).strain
        p = state.x[state.mesh.triangles]
        way = p.mean(axis=1) - [0.2, 0.1, 0]
        far = np.linalg.norm(way, axis=1)
        whole = (np.linalg.norm(p - [0.2, 0.1, 0], axis=2) < 0.5).all(axis=1) & (far > 0.06)
        assert whole.sum() > 100
        turned = np.radians(angle)
        cos, sin = way[:, 0] / far, way[:, 1] / far
        outward = np.stack(
            [cos * np.cos(turned) - sin * np.sin(turned), sin * np.cos(turned) + cos * np.sin(turned)], -1
        )
        first = (p[:, 1] - p[:, 0])[:, :2]
        first /= np.linalg.norm(first, axis=1)[:, None]
        v = np.stack([(outward * first).sum(-1), outward[:, 1] * first[:, 0] - outward[:, 0] * first[:, 1]], -1)
        e11, e12, e22 = found.T
        along = e11 * v[:, 0] ** 2 + 2 * e12 * v[:, 0] * v[:, 1] + e22 * v[:, 1] ** 2
        # the slope of distances that are linear within a triangle is not quite the way to its middle
        assert along[whole] == pytest.approx(np.log(1.5), abs=1e-9 if distance == "space" else 0.02)
        assert (e11 + e22)[whole] == pytest.approx(np.log(1.5) + np.log(1.1), abs=1e-9)


def test_a_disc_that_grows_away_from_its_middle_alone_is_a_cone():
    """ds^2 = s^2 dr^2 + r^2 dphi^2 is the metric of a cone of slant s and base 1, (s^2 - 1)^(1/2) high: no strain."""
    spot = {"kind": "spot", "at": (0, 0, 0), "radius": 3.0, "kernel": "flat", "stretch": (1.2, 1.0), "polar": True}
    run = engine(spot, shape="disc", thickness=0.01, curved=False, step=0.25)
    state = run.reach(1.0, Context())
    x = state.x - state.x.mean(axis=0)
    axis = np.linalg.svd(x, full_matrices=False)[2][2]
    height = np.ptp(x @ axis)
    # the apex is rounded off over some thicknesses
    assert height == pytest.approx(np.sqrt(1.2**2 - 1), rel=0.05)
    rim = border(state.mesh)
    base = np.linalg.norm(x[rim] - (x[rim] @ axis)[:, None] * axis, axis=1)
    assert base == pytest.approx(1.0, rel=0.03)
