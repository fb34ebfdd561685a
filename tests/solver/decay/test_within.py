"""Rot and water in the flesh against closed forms: fronts, a ball that dries, budgets; and what is handed over."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from solver.contract import Context, InvalidGeometry, Need
from solver.decay import SOLVER, DecayParams
from solver.decay.body.flesh import Flesh, softened
from solver.decay.environment import reference_radius, saturation
from solver.decay.fields.diffusion import linked, rkl2, stages_for
from solver.decay.fields.layer import Layer
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.surfaces.surface import Surface, extent, lay, triangulated
from solver.decay.within import water
from solver.decay.within.given import Within
from solver.decay.within.joint import joined
from solver.fruit import Fruit
from solver.geometry.stuffing import boundary, stuffed
from solver.geometry.tetrahedra import edges, within

NO_ROT = np.empty(0)
#: Of the fruit that is a sphere, its skin included [r1].
RADIUS = 1.04


def shell_of_box(length: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (0, length) for y in (0, width) for z in (0, width)], float)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]]
    faces += [[0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return corners, np.array(faces)


def box(length: float, width: float, edge: float) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra of the lattice that fills fruits, in a box."""
    return stuffed(*shell_of_box(length, width), edge)


def medium(points: np.ndarray, tets: np.ndarray) -> Surface:
    """Tetrahedra alone as something to spread in."""
    links = edges(points, tets)
    both = np.concatenate([links.ends, links.ends[:, ::-1]])
    order = np.lexsort((both[:, 1], both[:, 0]))
    weight = np.concatenate([links.weight, links.weight])[order]
    start = np.searchsorted(both[order, 0], np.arange(len(points) + 1))
    stiffest = float((2 * np.bincount(both[order, 0], np.abs(weight)) / links.volume).max())
    return Surface(points, np.zeros((0, 3), int), links.volume, start, both[order, 1].copy(), weight, stiffest)


def test_a_quadratic_has_its_laplacian_inside_and_volumes_add_up():
    points, tets = box(2.0, 1.0, 0.17)
    links, y = edges(points, tets), (points**2).sum(axis=1)
    flow = np.zeros(len(points))
    i, j = links.ends.T
    np.add.at(flow, i, links.weight * (y[j] - y[i]))
    np.add.at(flow, j, links.weight * (y[i] - y[j]))
    inside = (points.min(axis=1) > 0.35) & (points[:, 1:].max(axis=1) < 0.65) & (points[:, 0] < 1.65)
    assert inside.sum() > 20
    assert np.allclose(flow[inside] / links.volume[inside], 6, rtol=1e-9)
    assert links.volume.sum() == pytest.approx(2.0, rel=0.02)


def test_fisher_s_front_runs_through_flesh_at_twice_the_root_of_r_d():
    """The wave that a steep start goes over to, 2 sqrt(r D), less 3 / (2 t) sqrt(D / r) while it forms (Bramson)."""
    bar = medium(*box(14.0, 0.4, 0.14))
    rate, spread, dt = 1.0, 0.04, 0.05
    u = (bar.points[:, 0] < 0.5).astype(float)
    everywhere = np.arange(len(u))
    links = linked(np.ones(len(u)), NO_ROT, everywhere, bar.start, bar.near, bar.weight, bar.area)
    passed, stages = [], max(3, stages_for(dt, spread * bar.stiffest))
    for step in range(480):
        for half in (0, 1):
            u = u / (u + (1 - u) * np.exp(-rate * dt / 2))
            if half == 0:
                rkl2(u, links, spread, 0.0, dt, stages, everywhere, bar.area)
                u = np.clip(u, 0, 1)
        if step + 1 in (240, 480):
            passed.append(14 * bar.mean(u))
    t1, t2 = 240 * dt, 480 * dt
    expected = 2 * np.sqrt(rate * spread) * (t2 - t1) - 1.5 * np.sqrt(spread / rate) * np.log(t2 / t1)
    assert passed[1] - passed[0] == pytest.approx(expected, rel=0.01)


def flow(s: Surface, y: np.ndarray, spread: float, end: float, steps: int) -> np.ndarray:
    everywhere, dt, out = np.arange(len(y)), end / steps, y.copy()
    links = linked(np.ones(len(y)), NO_ROT, everywhere, s.start, s.near, s.weight, s.area)
    for _ in range(steps):
        rkl2(out, links, spread, 0.0, dt, max(3, stages_for(dt, spread * s.stiffest)), everywhere, s.area)
    return out


def test_the_slowest_round_mode_of_a_ball_of_skin_and_flesh_fades_as_its_eigenvalue_says():
    """sin(k r) / r with tan k R = k R, nothing through the skin: exp(-k^2 D t)."""
    k = brentq(lambda x: np.tan(x) - x, 4.3, 4.6) / RADIUS
    errors = []
    for cells, count in ((12, 2500), (24, 20000)):
        ball = joined(lay(Fruit(stone=(0, 0)), cells), count, 0.01)
        r = np.maximum(np.linalg.norm(ball.points, axis=1), 1e-9)
        # the flesh lies drawn in under the outermost layer
        r[len(ball.cover.points) :] *= RADIUS - 0.01
        r[len(ball.cover.points) :] /= RADIUS
        mode = np.sin(k * r) / r
        mode -= ball.mean(mode)
        left = flow(ball, 5 + mode, 0.05, 0.6, 20)
        left -= ball.mean(left)
        kept = ball.total(left * mode) / ball.total(mode * mode)
        errors.append(abs(-np.log(kept) / (k * k * 0.05 * 0.6) - 1))
    assert errors[1] < 0.02
    assert errors[1] < 0.5 * errors[0]


def ball_of_water(
    monkeypatch: pytest.MonkeyPatch | None = None, count: int = 6000, **more: object
) -> tuple[water.Water, DecayParams]:
    values = {"stone": (0, 0), "humidity": 0.0, "weight": 100.0, "water_content": 80.0, "within": {}, **more}
    params = DecayParams.parse(values)
    assert params.within is not None
    if monkeypatch is not None:
        monkeypatch.setattr(water, "activity", lambda wet: np.asarray(wet))
        monkeypatch.setattr(water, "rising", lambda wet: np.ones(len(wet)))
    joint = joined(lay(params, 16), count, params.within.skin)
    return water.Water(params, params.within, joint, extent(params)), params


def test_a_ball_dries_as_the_series_says(monkeypatch):
    """Crank 1975, 6.3.4: flux at the surface in proportion to what is there; Biot's number is some 6 here.

    On the first days what dries is thinner than the lattice's edge; the error falls with it and with the edge.
    """
    air = {"transpiration": 3.0, "temperature": 20.0, "open_transpiration": 0.0}
    coarse, params = ball_of_water(monkeypatch, 3000, **air)
    fine, _ = ball_of_water(monkeypatch, 24000, **air)
    radius = (params.weight * 1e-6 / (4 / 3 * np.pi)) ** (1 / 3)
    speed = 3.0 * 1e-6 * float(saturation(20.0)) / (1e6 * 0.8)
    biot = speed * radius / params.within.water
    assert 4 < biot < 7
    roots = [brentq(lambda b: b / np.tan(b) + biot - 1, (n + 1e-9) * np.pi, (n + 1 - 1e-9) * np.pi) for n in range(40)]
    errors = []
    for found in (coarse, fine):
        wet, sound = found.fresh, np.zeros(16 * 16 * 10 + 2)
        for day in range(0, 30, 5):
            wet = found.advance(wet, sound, float(day), day + 5.0)
            fo = params.within.water * (day + 5) * 86400 / radius**2
            left = sum(6 * biot**2 * np.exp(-b * b * fo) / (b * b * (b * b + biot * (biot - 1))) for b in roots)
            errors.append(abs(found.lost(wet) / (0.8 * (1 - left)) - 1))
    # days 5 to 30 of both
    assert max(errors[:6]) < 0.03
    assert max(errors[8:]) < 0.007
    assert all(b < 0.8 * a for a, b in zip(errors[:6], errors[6:], strict=True))


def test_water_leaves_from_the_middle_of_the_outermost_flesh(monkeypatch):
    """Half of that layer is not in its way, which is most of what is lost too much on the first days."""
    given = {"transpiration": 3.0, "temperature": 20.0, "open_transpiration": 0.0}
    found, params = ball_of_water(monkeypatch, 12000, **given)
    radius = (params.weight * 1e-6 / (4 / 3 * np.pi)) ** (1 / 3)
    whole = 3.0 * 1e-6 * float(saturation(20.0)) / (1e6 * 0.8) * radius / params.within.water
    lost, fo = found.lost(found.advance(found.fresh, np.zeros(16 * 16 * 10 + 2), 0.0, 5.0)), params.within.water * 432e3
    errors = []
    for biot in (whole, 1 / (1 / whole - 0.005 / float(np.linalg.norm(lay(params, 16).points[0])))):
        roots = [brentq(lambda b, g=biot: b / np.tan(b) + g - 1, (n + 1e-9) * np.pi, (n + 1 - 1e-9) * np.pi)
                 for n in range(40)]  # fmt: skip
        kept = (6 * biot**2 * np.exp(-b * b * fo / radius**2) / (b * b * (b * b + biot * (biot - 1))) for b in roots)
        errors.append(lost / (0.8 * (1 - sum(kept))) - 1)
    assert abs(errors[1]) < 0.008
    assert errors[0] > 2 * abs(errors[1])


def test_water_that_spreads_at_once_is_an_ordinary_equation():
    """One number for the whole fruit: wc dw/dt = -K A P_sat (a(w) - humidity) / weight, with Raoult's law."""
    found, params = ball_of_water(transpiration=2.0, humidity=40.0, within={"water": 3e-9}, open_transpiration=0.0)
    area = extent(params).area * reference_radius(params, extent(params)) ** 2

    def slope(_: float, w: np.ndarray) -> np.ndarray:
        a = 1 / (1 + (1 / 0.98 - 1) / w)
        pressure = float(saturation(params.temperature)) * (a - 0.4)
        return -2.0 * area * 1e-6 * 86400 * pressure / params.weight / 0.8

    known = solve_ivp(slope, (0, 15), [1.0], rtol=1e-9, t_eval=[5, 15]).y[0]
    wet, sound = found.fresh, np.zeros(16 * 16 * 10 + 2)
    for day in range(15):
        wet = found.advance(wet, sound, float(day), day + 1.0)
        if day in (4, 14):
            assert found.lost(wet) == pytest.approx(0.8 * (1 - known[day // 10]), rel=0.01)


def test_water_spreads_as_fast_as_in_a_pear_at_both_temperatures():
    """Inner cortex of Conference pears: 123.0e-13 m2/s at 1 degC, 435.9e-13 at 20 degC."""
    assert water.diffusivity(Within(), 20.0) == pytest.approx(435.9e-13, rel=1e-3)
    assert water.diffusivity(Within(), 1.0) == pytest.approx(123.0e-13, rel=0.02)


def test_broken_skin_loses_more_and_dries_what_is_below():
    found, _ = ball_of_water(transpiration=0.2)
    rays = lay(Fruit(stone=(0, 0)), 16).points
    wet = found.advance(found.fresh, (rays[:, 1] > 0.8).astype(float), 0.0, 3.0)
    skin = wet[: len(rays)]
    assert skin[rays[:, 1] > 0.9].max() < skin[rays[:, 1] < 0].min() - 0.2
    assert wet.min() >= 0


def lesion(**more: object) -> tuple[System, object]:
    even = {"stone": (0, 0), "noise": 0.0, "unevenness": 0.0, "spawning": 0.0, "rot_spawning": 0.0}
    wound = {"wounds": ({"colatitude": 0},), "within": {"water": 0.0}, "transpiration": 0.0, "open_transpiration": 0.0}
    params = DecayParams.parse({**even, **wound, **more})
    system = System(params, 32, False, None, 12000)
    day, state = 0.0, system.start
    while day < 6.0:
        dt = min(0.05, system.next_root(state, day + 0.05) - day)
        state = system.advance(state, day, dt) if dt > 0 else state
        day += dt
        if dt < 0.05:
            state = system.root(state)
    return system, state


def test_a_lesion_is_as_deep_as_it_is_wide_and_its_budget_is_closed():
    system, state = lesion()
    assert system.joint is not None
    rot, points = system.rot.share(state.rot), system.joint.points
    far = np.linalg.norm(points - [0, RADIUS, 0], axis=1)
    above = np.arange(len(points)) < len(system.surface.points)
    flesh = ~above & (np.abs(points[:, [0, 2]]).max(axis=1) < 0.15)
    wide, deep = (float(far[(rot > 0.4) & there].max()) for there in (above, flesh))
    assert 0.4 < wide < 1.2
    # within the lattice's own edge
    assert deep == pytest.approx(wide, abs=0.1)
    assert system.rot.budget_error(state.rot) < 1e-12


def test_how_much_rots_does_not_hang_on_the_mesh():
    """A vertex of the skin that were tied to three points of the flesh would carry rot from one to the other, below it.

    So tied, coarse flesh rotted by a fifth more than four times as many points did, and each finer mesh by less.
    """
    found = []
    for count in (3000, 12000):
        even = {"stone": (0, 0), "noise": 0.0, "unevenness": 0.0, "spawning": 0.0, "rot_spawning": 0.0}
        params = DecayParams.parse({**even, "wounds": ({"colatitude": 37, "radius": 0.3},), "within": {}})
        system = System(params, 32, False, None, count)
        *_, last = march(system, (6.0,), 1e-4, 0.2, Context())
        assert system.joint is not None
        found.append(system.joint.mean(system.rot.share(last.state.rot)))
    assert found[0] == pytest.approx(found[1], rel=0.03)


def test_all_of_the_skin_lies_over_flesh_and_all_of_its_surface_below_skin():
    """Where the skin is finer, a vertex lies over one point; where it is coarser, its area is shared among several."""
    for cells, count in ((32, 3000), (8, 12000)):
        ball = joined(lay(Fruit(stone=(0, 0)), cells), count, 0.01)
        above = len(ball.cover.points)
        rows = np.repeat(np.arange(len(ball.area)), np.diff(ball.start))
        across = (rows < above) & (ball.near >= above)
        through = np.bincount(rows[across], ball.weight[across], above)
        np.testing.assert_allclose(through, 2 / 0.01 * ball.cover.area, rtol=1e-12)
        outside = above + np.unique(boundary(ball.tets))
        met = set(ball.near[across].tolist())
        assert met == set(outside.tolist())
        several = np.bincount(rows[across], minlength=above) > 1
        assert several.mean() < 0.02 if cells == 32 else several.mean() > 0.98


def test_rot_that_starts_inside_comes_to_the_skin_and_takes_nothing_from_nowhere():
    joint = joined(lay(Fruit(stone=(0, 0)), 16), 6000, 0.01)
    params = DecayParams.parse({"stone": (0, 0), "within": {}})
    system = System(params, 16, False, None, 6000)
    layer = Layer(joint, system.rot.rates, np.ones(len(joint.points)), np.ones(len(joint.points)))
    inside = np.linalg.norm(joint.points, axis=1) < 0.4
    state = layer.fresh._replace(u=np.where(inside, layer.rates.cap, 0.0))
    before = joint.total(layer.rates.theta * state.n + state.u)
    for _ in range(120):
        state = layer.advance(state, 0.1)
    assert layer.share(state)[: len(joint.cover.points)].min() > 0.5
    assert joint.total(layer.rates.theta * state.n + state.u + state.v) == pytest.approx(before, rel=1e-12)


def test_a_stone_is_no_flesh_and_volumes_are_the_fruit_s():
    fruit = Fruit(stone=(0.4, 0.4))
    joint = joined(lay(fruit, 24), 12000, 0.01, fruit)
    flesh = joint.total(1.0) / (4 / 3 * np.pi * (RADIUS**3 - 0.4**3))
    assert flesh == pytest.approx(1, rel=0.02)
    assert np.linalg.norm(joint.flesh, axis=1).min() > 0.3
    assert np.linalg.norm(joint.core, axis=1).max() < 0.45
    corners = np.concatenate([joint.flesh, joint.core])[joint.cells]
    whole = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    assert whole == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.02)


def test_a_place_is_found_in_its_tetrahedron():
    points, tets = box(1.0, 1.0, 0.2)
    places = np.random.default_rng(0).uniform(0.15, 0.85, (200, 3))
    assert np.allclose(within(points, tets, places) @ (points @ [1.0, -2.0, 3.0]), places @ [1.0, -2.0, 3.0])


def test_what_evaporates_comes_from_where_it_is_gone():
    volume, stone = np.array([1.0, 2.0, 1.0]), np.zeros(3, bool)
    even = softened(Flesh(), 1.0, 0.2, np.zeros(3), stone, volume)
    uneven = softened(Flesh(), 1.0, 0.2, np.zeros(3), stone, volume, 1.0, np.array([0.4, 0.1, 0.0]))
    assert uneven.booked == pytest.approx(even.booked)
    assert uneven.dried == pytest.approx(even.dried)
    gone = 1 - uneven.shrinkage**3
    assert gone[0] == pytest.approx(4 * gone[1])
    assert gone[2] == 0
    # a share for each even flesh: the same to the last digit but one
    alike = softened(Flesh(), 1.0, 0.2, np.zeros(3), stone, volume, 1.0, np.full(3, 0.7))
    assert np.allclose(alike.shrinkage, even.shrinkage, rtol=1e-14)


WEIGHT = ("mass", "water_lost", "juice_lost", "respired", "density")
NEED = Need(stages=(0, 6, 9), quality="preview", resolution=16, fields=(*SOLVER.default_fields, *WEIGHT))


@pytest.fixture(scope="module")
def solved():
    values = {"within": {}, "body": "quasi-static", "wounds": ({"colatitude": 0},)}
    return SOLVER.solve(SOLVER.parse(values, preset="apple"), NEED)


def test_a_run_hands_its_flesh_over_where_the_body_has_it(solved):
    assert solved["flesh_rot"].dims == ("stage", "flesh_point")
    rot, place = solved["flesh_rot"].values, solved["flesh_position"].values
    assert rot[0].max() == 0
    assert 0.02 < rot[1].mean() < rot[2].mean()
    assert (solved["budget_error"] < 1e-12).all()
    # it shrank with the body that lies about it
    size = [np.ptp(place[k][:, 0]) / np.ptp(solved["position"].values[k][..., 0]) for k in range(3)]
    assert np.allclose(size, 1, atol=0.03)
    assert np.ptp(place[2][:, 0]) < np.ptp(place[0][:, 0])
    wet = solved["flesh_water"].values
    assert wet[0].min() == 1
    assert 0 < wet[2].min() < 1


def test_weight_is_closed_with_fields_inside(solved):
    total = solved["mass"] + solved["water_lost"] + solved["juice_lost"] + solved["respired"]
    assert np.allclose(total, 1, atol=1e-6)
    assert solved["density"].min() > 0.8


def test_stages_of_flesh_do_not_depend_on_each_other(solved):
    values = {"within": {}, "body": "quasi-static", "wounds": ({"colatitude": 0},)}
    alone = SOLVER.solve(SOLVER.parse(values, preset="apple"), NEED.model_copy(update={"stages": (9.0,)}))
    for name in ("flesh_rot", "flesh_water", "flesh_position"):
        assert np.array_equal(alone[name].values[0], solved[name].values[2])


def test_a_heap_and_a_mesh_too_thin_are_refused():
    with pytest.raises(InvalidGeometry, match="within"):
        DecayParams.parse({"within": {}, "heap": {}})
    with pytest.raises(InvalidGeometry, match="thin"):
        joined(triangulated(*shell_of_box(1.0, 0.002)), 300, 0.0005)


def test_the_skin_is_joined_to_what_lies_below_it_alone():
    """Flesh ends at a core as well: a link from there to the skin would lead rot and water past all that is between."""
    params = SOLVER.parse({"within": {}, "body": "quasi-static"}, preset="apple")
    joint = System(params, 16, False, None, 4000).joint
    assert joint is not None
    skin = len(joint.cover.points)
    row = np.repeat(np.arange(len(joint.points)), np.diff(joint.start))
    across = (row < skin) & (joint.near >= skin)
    far = np.linalg.norm(joint.points[row[across]] - joint.points[joint.near[across]], axis=1)
    assert far.max() < 0.2
