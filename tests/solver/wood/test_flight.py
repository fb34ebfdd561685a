"""Bodies with a mass: Euler's equations by another integrator and in closed form, collisions, falls, momenta."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from solver import meshes
from solver.contract import Context, InvalidGeometry, InvalidInput, Need
from solver.wood import SOLVER
from solver.wood.model.bodies.solids import weight_of
from solver.wood.model.bundle import lay
from solver.wood.params import Body
from solver.wood.stepping.flying import fly, moving
from solver.wood.stepping.marching import explicit

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}, "unevenness": 0.0}
HERE = [{"time": 0, "position": (0.05, 0.0, 0.0)}]


def flung(body: dict, time: float, steps: int):
    """Return the bodies after `time` [s] of flight in so many steps, and those before."""
    params = SOLVER.parse({"rods": 1, "vertices": 4, "bodies": [body], **PLAIN})
    before, after = lay(params, 4).copied().bodies, lay(params, 4).copied().bodies
    for _ in range(steps):
        fly(after, time / steps)
    return before, after


def by_another(body: dict, time: float) -> Rotation:
    """Return the attitude by Euler's equations, integrated to 1e-11."""
    parsed = Body(**body)
    weight = weight_of(parsed)
    inertia = parsed.mass / weight.volume * weight.inertia
    start = Rotation.from_rotvec(parsed.path[0].turn)

    def rate(_, y):
        q, w = y[:4], y[4:]
        x, v, s = q[:3], w, q[3]
        turn = 0.5 * np.concatenate([s * v + np.cross(x, v), [-x @ v]])
        return np.concatenate([turn, np.linalg.solve(inertia, np.cross(inertia @ w, w))])

    first = np.concatenate([start.as_quat(), start.inv().apply(parsed.spin)])
    end = solve_ivp(rate, (0, time), first, "DOP853", rtol=1e-11, atol=1e-12).y[:4, -1]
    return Rotation.from_quat(end / np.linalg.norm(end))


TURNED = [{"time": 0, "position": (0.05, 0.0, 0.0), "turn": (0.4, -0.2, 0.9)}]
BRICK = {"size": (0.03, 0.05, 0.08), "mass": 0.4, "spin": (30.0, 5.0, -12.0), "path": TURNED}


@pytest.mark.parametrize(
    "body",
    [
        BRICK,
        # about the intermediate axis, which tumbles
        {**BRICK, "spin": (0.01, 40.0, 0.0), "path": HERE},
        {**BRICK, "shape": "wedge", "size": (0.0, 0.04, 0.09), "angle": 0.6},
    ],
)
def test_a_body_tumbles_as_euler_says_to_second_order(body):
    time, missed = 1.0, []
    wanted = by_another(body, time)
    for steps in (2000, 4000):
        before, after = flung(body, time, steps)
        found = Rotation.from_quat(after.flight.turn[0], scalar_first=True)
        missed.append((found * wanted.inv()).magnitude())
        # the angular momentum is not touched; the energy comes back
        assert np.array_equal(after.flight.momentum, before.flight.momentum)
        assert moving(after) == pytest.approx(moving(before), rel=1e-4)
        assert np.linalg.norm(after.flight.turn[0]) == pytest.approx(1.0, abs=1e-14)
    assert missed[1] < 5e-3
    assert np.log2(missed[0] / missed[1]) == pytest.approx(2.0, abs=0.15)


def test_the_brick_that_turns_about_its_middle_axis_flips():
    _, after = flung({**BRICK, "spin": (0.01, 40.0, 0.0), "path": HERE}, 0.25, 500)
    heights = []
    for _ in range(2000):
        fly(after, 5e-4)
        heights.append(Rotation.from_quat(after.flight.turn[0], scalar_first=True).as_matrix()[1, 1])
    assert min(heights) < -0.95
    assert max(heights) > 0.95


def test_a_symmetric_top_precesses_at_its_rate():
    """Its axis goes round the angular momentum at L over the inertia across (Landau and Lifshitz, section 33)."""
    body = {
        "shape": "cylinder",
        "axis": "z",
        "size": (0.06, 0.02, 0),
        "mass": 0.3,
        "spin": (6.0, 0, 45.0),
        "path": HERE,
    }
    across = 0.3 * (0.06**2 / 16 + 0.02**2 / 12)
    momentum = np.array([across * 6.0, 0.0, 0.3 * 0.06**2 / 8 * 45.0])
    time, missed = 0.7, []
    wanted = Rotation.from_rotvec(momentum / across * time).apply([0, 0, 1.0])
    for steps in (1500, 3000):
        before, after = flung(body, time, steps)
        assert before.flight.momentum[0] == pytest.approx(momentum, rel=1e-12)
        assert moving(before) == pytest.approx(0.5 * momentum @ [6.0, 0, 45.0], rel=1e-12)
        missed.append(
            np.linalg.norm(Rotation.from_quat(after.flight.turn[0], scalar_first=True).apply([0, 0, 1.0]) - wanted)
        )
    assert missed[1] < 1e-4
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.1)


def totals(wood):
    """Return momentum (3,) and angular momentum (3,) about the origin, of wood and bodies."""
    m, b = wood.motion, wood.bodies
    solid = np.isin(np.arange(len(m.x)), np.concatenate([wood.rods.a, wood.rods.b]))
    p = m.mass[solid, None] * m.v[solid]
    heavy = b.free.mass[:, None] * b.flight.v
    turning = np.cross(m.x[solid], p).sum(0) + (np.cross(b.flight.place, heavy) + b.flight.momentum).sum(0)
    return p.sum(0) + heavy.sum(0), turning


def marched(values: dict, times: tuple[float, ...], vertices: int = 12):
    params = SOLVER.parse(values)
    wood = lay(params, vertices)
    return totals(wood), list(explicit(wood, params, times, 5e-7, 1.0, Context()))


ROD = {"rods": 1, "vertices": 12, "length": 0.2, "radius": 0.003, "clamp": "none", **PLAIN}
BALL = {
    "shape": "ball",
    "size": (0.03, 0, 0),
    "mass": 0.01,
    "velocity": (0, 0, -3.0),
    "friction": 0.0,
    "path": [{"time": 0, "position": (0.13, 0.002, 0.016)}],
}


def test_a_ball_bounces_off_a_rod_in_space_elastically():
    before, (hit, after) = marched({**ROD, "bodies": [BALL]}, (0.0005, 0.004))
    energy = 0.5 * 0.01 * 9
    assert hit.energy[1] > 0.02 * energy
    for stage in (hit, after):
        # kinetic and elastic, nothing lost and nothing put in
        assert sum(stage.energy[:2]) == pytest.approx(energy, rel=2e-4)
        assert abs(stage.energy[2]) + abs(stage.energy[3]) < 1e-12
        found = totals(stage.state.wood)
        assert np.abs(found[0] - before[0]).max() < 1e-12 * np.abs(before[0]).max()
        assert np.abs(found[1] - before[1]).max() < 1e-12 * np.abs(before[1]).max()
    flight = after.state.wood.bodies.flight
    # smooth: it gets no spin, and lost what the rod has
    assert np.abs(flight.momentum).max() < 1e-12
    assert after.state.impulse[0, :3] == pytest.approx(0.01 * (flight.v[0] - [0, 0, -3.0]), abs=1e-15)


def test_an_end_on_collision_is_newton_s():
    """A ball on a short stiff rod's end along its axis: velocities of two point masses that bounce."""
    heavy = 600 * np.pi * 0.003**2 * 0.05
    ball = {**BALL, "size": (0.02, 0, 0), "velocity": (-0.5, 0, 0), "mass": 0.02}
    ball["path"] = [{"time": 0, "position": (0.0602, 0.0, 0.0)}]
    values = {**ROD, "length": 0.05, "contact_stiffness": 2e4, "bodies": [ball]}
    _, (after,) = marched(values, (0.01,), 8)
    m = after.state.wood.motion
    # what it leaves to waves along the rod is small, as the contact is soft beside it
    wanted = (0.02 - heavy) / (0.02 + heavy) * -0.5, 2 * 0.02 / (0.02 + heavy) * -0.5
    real = m.mass < 0.5
    assert after.state.wood.bodies.flight.v[0, 0] == pytest.approx(wanted[0], rel=2e-3)
    assert m.mass[real] @ m.v[real, 0] / m.mass[real].sum() == pytest.approx(wanted[1], rel=2e-2)


HAMMER = {
    "size": (0.02, 0.03, 0.03),
    "mass": 0.05,
    "velocity": (0.5, 0.2, -8.0),
    "spin": (3.0, -20.0, 5.0),
    "path": [{"time": 0, "position": (0.12, 0.001, 0.022), "turn": (0.1, 0.2, 0.3)}],
}


#: Friction between rods is known to miss the couple of its arm, the rods' thickness.
SPLITS = {"strain_limit": 1e-3, "cleavage": 2e5, "toughness": 1.0, "rod_friction": 0.0}


@pytest.mark.parametrize("more", [{"fracture": "none"}, SPLITS])
def test_momenta_of_wood_and_hammer_are_kept_through_blows_friction_and_breaks(more):
    values = {"rods": 7, "vertices": 16, "length": 0.15, "radius": 0.005, "clamp": "none", "bodies": [HAMMER], **more}
    before, (after,) = marched(values, (0.003,), 16)
    state = after.state
    assert np.abs(state.impulse[0, :3]).max() > 0.01
    assert np.abs(state.wood.bodies.flight.momentum - lay(SOLVER.parse(values), 16).bodies.flight.momentum).max() > 1e-5
    found = totals(state.wood)
    assert np.abs(found[0] - before[0]).max() < 1e-12 * np.abs(before[0]).max()
    assert np.abs(found[1] - before[1]).max() < 1e-12 * np.abs(before[1]).max()
    assert (state.bonds + state.rods > 0) == ("strain_limit" in more)
    assert after.error < 0.01


def test_a_thrown_wedge_s_momenta_are_kept():
    """Its centre of mass is neither its middle nor its edge; it meets a rod with its side."""
    path = [{"time": 0, "position": (0.09, 0.0, 0.004), "turn": (0.0, 0.3, 0.0)}]
    wedge = {
        "shape": "wedge",
        "size": (0, 0.03, 0.05),
        "angle": 0.5,
        "mass": 0.05,
        "velocity": (0, 0, -5),
        "path": path,
    }
    before, (after,) = marched({**ROD, "bodies": [{**wedge, "spin": (0, 30, 5)}]}, (0.002,))
    flight, found = after.state.wood.bodies.flight, totals(after.state.wood)
    assert np.abs(after.state.impulse[0, 2]) > 1e-3
    assert np.abs(found[0] - before[0]).max() < 1e-12 * np.abs(before[0]).max()
    assert np.abs(found[1] - before[1]).max() < 1e-12 * np.abs(before[1]).max()
    assert after.error < 1e-3
    assert np.linalg.norm(flight.turn[0]) == pytest.approx(1.0, abs=1e-14)


def test_a_weight_falls_down_its_guide_and_a_ram_is_driven():
    weight = {"size": (0.02, 0.02, 0.02), "mass": 2.0, "path": [{"time": 0, "position": (0.05, 0, 0.5)}]}
    ram = {**weight, "mass": 3.0, "guide": (0, 3.0, -4.0), "force": (7.0, 0.0, 0.0)}
    free = {**weight, "mass": 3.0, "force": (6.0, 0.0, 0.0), "velocity": (0.0, 1.0, 0.0)}
    values = {"rods": 1, "vertices": 4, "gravity": 9.81, "damping": 30.0, "bodies": [weight, ram, free], **PLAIN}
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.01, 0.02), quality="preview"))
    t = found.stage.values
    start = np.array([0.05, 0, 0.5])
    along = np.array([0, 0.6, -0.8])
    way = np.array([0.5 * 9.81 * t**2 * -np.array([[0], [0], [1.0]]), 0.5 * 0.8 * 9.81 * t**2 * along[:, None]])
    place = found.body_place.values
    assert place[:, 0] - start == pytest.approx(way[0].T, abs=1e-9)
    assert place[:, 1] - start == pytest.approx(way[1].T, abs=1e-9)
    assert place[:, 2, :2] - start[:2] == pytest.approx(np.stack([t**2, t], 1), abs=1e-9)
    assert found.body_velocity.values[:, 1] == pytest.approx(0.8 * 9.81 * t[:, None] * along, abs=1e-9)
    # mean ways between stages
    assert found.body_shift.values[1, 1] == pytest.approx((way[1][:, 0] + way[1][:, 1]) / 2, abs=1e-9)
    assert found.residual.values.max() < 1e-6
    assert np.abs(found.body_force.values).max() == 0


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({**HAMMER, "path": [*HAMMER["path"], {"time": 1, "position": (0, 0, 0)}]}, "follows no path"),
        ({**HAMMER, "path": [{"time": 0.1, "position": (0, 0, 0)}]}, "follows no path"),
        ({**HAMMER, "mass": None}, "give it a mass"),
        ({**HAMMER, "mass": 0.0}, "greater than 0"),
        ({**HAMMER, "pivot": (0, 0, 1)}, "leave the pivot out"),
        ({**HAMMER, "guide": (0, 0, 1)}, "does not turn"),
        ({**HAMMER, "guide": (0, 0, 1), "spin": (0, 0, 0)}, "along its guide"),
        ({**HAMMER, "guide": (0, 0, 0), "spin": (0, 0, 0)}, "no direction"),
        ({"shape": "ball", "size": (0, 0, 0), "path": HERE}, "positive"),
    ],
)
def test_impossible_flights_are_refused_with_advice(body, said):
    with pytest.raises(InvalidInput, match=said):
        SOLVER.parse({"bodies": [body]})


def test_a_body_that_begins_in_the_wood_is_refused():
    body = {**HAMMER, "path": [{"time": 0, "position": (0.12, 0.001, 0.01)}]}
    values = {"rods": 7, "vertices": 8, "length": 0.15, "radius": 0.005, "bodies": [body]}
    with pytest.raises(InvalidGeometry, match="body 0 begins in the wood"):
        SOLVER.solve(SOLVER.parse(values), Need(stages=(1e-4,)))


def test_a_hammer_keeps_its_real_mass_where_the_wood_s_are_scaled():
    """It loses what the wood as a whole takes, whose real mass counts: as much as by real masses, within 5 %."""
    values = {**ROD, "rods": 7, "radius": 0.005}
    path = [{"time": 0, "position": (0.13, 0.002, 0.0195)}]
    values["bodies"] = [{**BALL, "mass": 0.05, "velocity": (0, 0, -0.05), "path": path}]
    found = []
    for scaling in (1.0, 25.0):
        asked = SOLVER.parse({**values, "mass_scaling": scaling, "contact_stiffness": 2e3})
        run = SOLVER.solve(asked, Need(stages=(0.1,), fields=("body_velocity",), quality="preview"))
        found.append(run.body_velocity.values[0, 0, 2])
        assert run.residual.values.max() < 0.02
    assert found[1] == pytest.approx(found[0], rel=0.05)
    assert found[0] > -0.045


def test_auto_takes_real_masses_for_what_is_thrown():
    found = SOLVER.parse({"mode": "auto", "bodies": [HAMMER]})
    run = SOLVER.solve(found.model_copy(update={"rods": 1}), Need(stages=(1e-5,), quality="preview"))
    assert run.attrs["mass_scaling"] == 1.0
    assert "strikes with its inertia" in run.attrs["note"]


def test_the_stage_s_mesh_shows_the_body_where_it_has_flown():
    path = [{"time": 0, "position": (0.12, 0.001, 0.3), "turn": (0.1, 0.2, 0.3)}]
    values = {"rods": 1, "vertices": 4, "bodies": [{**HAMMER, "path": path, "spin": (30.0, -200.0, 50.0)}], **PLAIN}
    run = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.0, 0.01), quality="preview"))
    assert run.body_place.values[1, 0] - run.body_place.values[0, 0] == pytest.approx([0.005, 0.002, -0.08], abs=1e-9)
    for n in range(2):
        shown = meshes.frame(run, n)
        corners = shown.vertices[shown.fields["body"] == 1]
        turn = Rotation.from_rotvec(run.body_turn.values[n, 0])
        own = turn.inv().apply(corners - run.body_place.values[n, 0])
        assert len(own) == 24
        assert np.abs(own) == pytest.approx(np.tile([0.01, 0.015, 0.015], (24, 1)), abs=1e-6)
    assert np.linalg.norm(run.body_turn.values[1, 0] - run.body_turn.values[0, 0]) > 1.0
