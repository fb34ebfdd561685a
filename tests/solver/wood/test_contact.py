"""Contact of edges with bodies: plain numpy, differences, momentum, Coulomb's law, blocks thinner than an edge."""

from dataclasses import replace

import numpy as np
import pytest

from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.contact.bodies import press
from solver.wood.contact.posing import pose
from solver.wood.model.arrays import Bodies, Poses, Rods
from solver.wood.model.bodies.building import bodied
from solver.wood.model.bundle import lay
from solver.wood.model.state import Wood, scratch_for

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}
BODIES = [
    {
        "shape": "cylinder",
        "size": (0.004, 0.2, 0),
        "friction": 0.5,
        "path": [{"time": 0, "position": (0.03, 0, 0.003)}, {"time": 1.0, "position": (0.035, 0.02, -0.02)}],
    },
    {"shape": "cylinder", "axis": "z", "size": (0.008, 0.01, 0), "path": [{"time": 0, "position": (0.07, 0.003, 0)}]},
    {"size": (0.02, 0.1, 0.01), "path": [{"time": 0, "position": (0.09, 0, -0.006)}]},
]


def bundle() -> Wood:
    """Return a shaken bundle among bodies, moving, with a severed edge in the first of them."""
    wood = lay(SOLVER.parse({"rods": 9, "vertices": 8, "length": 0.1, "radius": 0.004, "bodies": BODIES}), 8)
    generator = np.random.default_rng(0)
    wood.motion.x[:] += generator.normal(0, 2e-4, wood.motion.x.shape)
    wood.motion.v[:] = generator.normal(0, 1.0, wood.motion.v.shape)
    middle = (wood.motion.x[wood.rods.a] + wood.motion.x[wood.rods.b])[:, 0] / 2
    near = np.flatnonzero(np.abs(middle - 0.03) < 0.01)[:2]
    wood.rods.alive[near] = 0
    # a foot of each is in the body
    wood.motion.x[wood.rods.b[near]] = [[0.0301, 0.001, 0.002], [0.0295, 0.002, 0.0035]]
    return wood


def pressed(wood: Wood, dt: float = 1e-6):
    """Return energy, forces (v, 3), forces on the bodies and their moments (r, 6), powers (2,)."""
    m, b = wood.motion, wood.bodies
    poses, push = scratch_for(wood).poses, np.zeros((len(b.kind), 6))
    pose(b, 0.1, poses)
    f, power = np.zeros_like(m.x), np.zeros(2)
    energy = press(m.x, m.v, f, m.mass, wood.rods, b, poses, dt, push, power)
    return energy, f, push, power


def depth(b: Bodies, r: int, o: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the depth of o from the centre and the outward normal."""
    if b.kind[r] == 0:
        gaps, sides = b.half[r] - np.abs(o), np.diag(np.sign(o))
    else:
        axis = np.eye(3)[b.axis[r]]
        flat = o - (o @ axis) * axis
        gaps = np.array([b.half[r, 0] - np.linalg.norm(flat), b.half[r, 1] - abs(o @ axis)])
        sides = np.stack([flat / np.linalg.norm(flat), np.sign(o @ axis) * axis])
    return float(gaps.min()), sides[int(gaps.argmin())]


def test_contact_is_that_of_plain_numpy_and_keeps_momentum():
    wood, dt = bundle(), 1e-3
    m, rods, b = wood.motion, wood.rods, wood.bodies
    energy, f, push, power = pressed(wood, dt)
    speeds = np.array([[0.005, 0.02, -0.023], [0, 0, 0], [0, 0, 0]])
    centres = b.ways.points[:, 0] + 0.1 * speeds
    wanted, own, powers, dead = np.zeros_like(f), 0.0, np.zeros(2), 0
    for r in range(3):
        for e in np.flatnonzero(rods.k > 0):
            n = b.first[e + 1] - b.first[e]
            places = (np.arange(n) + 0.5) / n if rods.alive[e] else np.array([0.0, 1.0])
            for u in places:
                share = np.array([1 - u, u])
                ends = [rods.a[e], rods.b[e]]
                gap, normal = depth(b, r, share @ m.x[ends] - centres[r])
                if gap <= 0:
                    continue
                dead += not rods.alive[e]
                k, ease = b.k[r] * rods.rest[e] / len(places), b.ease[r]
                size = k * gap**2 / (2 * ease) if gap < ease else k * (gap - ease / 2)
                own += k * gap**3 / (6 * ease) if gap < ease else k * (gap**2 / 2 - gap * ease / 2 + ease**2 / 6)
                slide = share @ m.v[ends] - speeds[r]
                slide -= slide @ normal * normal
                slip = np.linalg.norm(slide)
                drag = min(b.friction[r] * size, slip * m.mass[ends].min() / len(places) / (2 * dt))
                force = size * normal - drag * slide / slip
                wanted[ends] += share[:, None] * force
                powers += [force @ speeds[r], drag * slip]
    assert dead > 0
    assert (np.abs(push).max(1) > 0).all()
    assert energy == pytest.approx(own, rel=1e-12)
    assert np.abs(f - wanted).max() < 1e-12 * np.abs(wanted).max()
    assert power == pytest.approx(powers, rel=1e-12)
    given, moment = push[:, :3], push[:, 3:]
    assert np.abs(f.sum(0) + given.sum(0)).max() < 1e-13 * np.abs(f).max() * len(f)
    arms = np.cross(m.x, f).sum(0) + np.cross(centres, given).sum(0) + moment.sum(0)
    assert np.abs(arms).max() < 1e-13 * np.abs(np.cross(m.x, f)).max() * len(f)


def test_forces_are_the_energy_s_differences():
    wood = bundle()
    wood = replace(wood, bodies=wood.bodies._replace(friction=np.zeros(3)))
    m = wood.motion
    f = pressed(wood)[1]
    way = np.random.default_rng(2).normal(size=f.shape)
    x, h, found = m.x.copy(), 1e-9, []
    for sign in (1, -1):
        m.x[:] = x + sign * h * way
        found.append(pressed(wood)[0])
    assert (f * way).sum() == pytest.approx((found[1] - found[0]) / (2 * h), rel=1e-6)


def one(kind: int, k: float = 1e3) -> tuple[Rods, Bodies]:
    """Return an edge of 0.1 m and a body with half sides, or radius and half length, of 1 m; friction 0.4."""
    zero, flag = np.zeros(1), np.ones(1, np.uint8)
    none = np.zeros(0)
    rods = Rods(
        np.zeros(1, np.int32),
        np.ones(1, np.int32),
        zero + 0.1,
        zero + 1,
        flag,
        none,
        none,
        none,
        none,
        none,
        zero,
        zero + 1,
    )
    shape = {"size": (2.0, 2.0, 2.0)} if kind == 0 else {"shape": "cylinder", "size": (2.0, 2.0, 0)}
    body = {**shape, "friction": 0.4, "path": [{"time": 0, "position": (0, 0, 0)}]}
    bodies = bodied(SOLVER.parse({"bodies": [body]}), k * 0.1, 0.0, rods)
    assert bodies.k == pytest.approx(k)
    return rods, bodies


@pytest.mark.parametrize("kind", [0, 1])
def test_friction_is_coulomb_s(kind):
    rods, body = one(kind)
    f, push, power = np.zeros((2, 3)), np.zeros((1, 6)), np.zeros(2)
    x, v = np.array([[0.0, 0.1, 0.99], [0.0, 0.2, 0.99]]), np.array([[2.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    poses = Poses(*np.zeros((3, 1, 3)), np.eye(3)[None], *np.zeros((2, 1, 3)))
    pose(body, 0.0, poses)
    energy = press(x, v, f, np.ones(2), rods, body, poses, 1e-3, push, power)
    # 1e3 N/m2 on 0.1 m at a depth of 0.01 m
    assert f[0] == pytest.approx([-0.2, 0, 0.5])
    assert f[1] == pytest.approx([-0.2, 0, 0.5])
    # at y = .15 and z = .99 from the centre
    assert push[0] == pytest.approx([0.4, 0, -1.0, -0.15, 0.396, -0.06], rel=1e-3)
    assert power == pytest.approx([0, 0.8])
    assert energy == pytest.approx(0.005)


SINGLE = {"rods": 1, "radius": 0.002, "length": 0.1, "unevenness": 0.0, **PLAIN}


def test_a_dragged_rod_slides_by_coulomb_s_law():
    path = [{"time": t, "position": (0.05 + t, 0, -0.01)} for t in (0.0, 1.0)]
    plate = {"size": (0.5, 0.1, 0.02), "friction": 0.25, "path": path}
    values = {**SINGLE, "vertices": 6, "gravity": 9.81, "clamp": "none", "bodies": [plate], "damping": 20.0}
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.03, 0.08)))
    # the plate goes 1 m/s, the rod less all the time
    given = np.diff(found.impulse.values, axis=0)[0]
    assert given[0] == pytest.approx(0.25 * given[2], rel=5e-3)
    assert abs(given[1]) < 1e-9 * abs(given[2])
    assert given[2] == pytest.approx(-600 * np.pi * 0.002**2 * 0.1 * 9.81 * 0.05, rel=0.05)
    assert found.residual.values.max() < 0.02


def held() -> tuple[np.ndarray, float, float]:
    """Return the vertices' z (6,), the force on a thin block [N] and the largest error of the balance."""
    path = [{"time": 0.0, "position": (0.05, 0, 0.008)}, {"time": 0.02, "position": (0.05, 0, 0.004)}]
    block = {"size": (0.002, 0.05, 0.01), "path": path}
    values = {**SINGLE, "vertices": 6, "clamp": "both", "bodies": [block], "damping": 400.0}
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(0.04, 0.05)))
    z = np.append(found.rod_position.values[1, :, 0, 2], found.rod_position.values[1, -1, 1, 2])
    return z, float(np.diff(found.impulse.values[:, 2])[0] / 0.01), float(found.residual.values.max())


def test_a_block_of_a_tenth_of_an_edge_holds_a_rod():
    z, force, error = held()
    # its lower side is at -1 mm, in the middle of the third edge; what it covers has a tenth of an edge's stiffness
    k, ease = 0.1 * 10e9 * np.pi * 0.002**2 / 0.02, 0.1 * 0.002
    depth = np.sqrt(2 * ease * force / k)
    assert depth < ease
    assert z[2:4].mean() == pytest.approx(-1e-3 + depth, abs=2e-6)
    assert error < 1e-2
    # a beam clamped at both ends; five edges make it some percent too soft or stiff
    stiffness = 192 * 10e9 * np.pi * 0.002**4 / 4 / 0.1**3
    assert force == pytest.approx(stiffness * 1e-3, rel=0.2)


def test_a_wide_plate_meets_an_edge_s_stiffness_and_a_block_the_same_wherever_it_is():
    plate = {"size": (0.3, 0.1, 0.02), "path": [{"time": 0, "position": (0.05, 0, -0.01 + 1e-3)}]}
    values = {**SINGLE, "vertices": 6, "clamp": "none", "contact_stiffness": 1e4}
    _, f, _, _ = pressed(lay(SOLVER.parse({**values, "bodies": [plate]}), 6))
    ease = 0.1 * 0.002
    assert f[:, 2].sum() == pytest.approx(5 * 1e4 * (1e-3 - ease / 2))
    found = []
    for x in np.linspace(0.03, 0.07, 41):
        block = {"shape": "cylinder", "size": (0.01, 0.05, 0), "path": [{"time": 0, "position": (x, 0, -0.0042)}]}
        energy, f, _, _ = pressed(lay(SOLVER.parse({**values, "bodies": [block]}), 6))
        found.append([f[:, 2].sum(), f[:, 0].sum(), energy])
    up, along, energy = np.array(found).T
    assert np.ptp(up) < 0.01 * up.mean()
    assert np.abs(along).max() < 0.01 * up.mean()
