"""Tapered, bent and forked bundles against closed forms; as laid they cost nothing."""

import numpy as np
import pytest
from scipy.linalg import solve_banded
from scipy.sparse.linalg import splu

from solver.contract import InvalidInput, Need
from solver.wood import SOLVER, WoodParams
from solver.wood.forces.hessian import Stiffness
from solver.wood.model.bundle import lay
from solver.wood.model.state import Wood, scratch_for
from solver.wood.shape.curve import Curve
from solver.wood.stepping.explicit import forces

E, G, RADIUS = 10e9, 0.7e9, 0.01
AREA, SECOND, KAPPA = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4, 0.9
PLAIN = {"fracture": "none", "grain": {"strength": 0.0}}


def params(**values: object) -> WoodParams:
    found = SOLVER.parse({"rods": 40, "vertices": 24, **PLAIN, **values})
    assert isinstance(found, WoodParams)
    return found


def pushed(wood: Wood) -> tuple[np.ndarray, np.ndarray]:
    """Return energies (4,) [J] and forces (v, 3) [N]."""
    scratch, books, m = scratch_for(wood), np.zeros(6), wood.motion
    forces(m, wood.rods, wood.turns, wood.bodies, scratch, wood.turning, 0.0, 1.0, books)
    return books[:4].copy(), scratch.f.copy()


def arc(radius: float, angle: float, points: int = 13, turn: float = 0.0) -> list[tuple[float, ...]]:
    """Return points of a circle that sets out along x and bends towards z, turned about x."""
    a = np.linspace(0, angle, points)
    up = radius * (1 - np.cos(a))
    return [tuple(p) for p in np.stack([radius * np.sin(a), -up * np.sin(turn), up * np.cos(turn)], 1).tolist()]


HELIX = [(0.05 * np.sin(a), 0.03 * a, 0.05 * (1 - np.cos(a))) for a in np.linspace(0, 3, 16)]
SHAPES = {
    "tapered": {"taper": 0.4},
    "arc": {"spine": arc(0.1, 1.2)},
    "helix": {"spine": HELIX},
    "tapered helix": {"spine": HELIX, "taper": 0.5},
    "tapered arc with spiral grain": {"curvature": 4.0, "taper": 0.6, "grain": {"strength": 0.0, "spiral": 8.0}},
    "fork": {"fork": {"at": 0.05}},
    "tapered fork": {"fork": {"at": 0.05, "share": 0.5, "lean": 0.0}, "taper": 0.6},
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("clamp", ["none", "start", "both"])
def test_as_laid_nothing_is_stretched_bent_sheared_or_twisted(shape, clamp):
    wood = lay(params(**SHAPES[shape], clamp=clamp), 24)
    energy, force = pushed(wood)
    assert energy.max() < 1e-20
    assert np.abs(force[wood.motion.held == 0]).max() < 1e-12 * float(wood.rods.k.max())


@pytest.mark.parametrize("shape", ["tapered helix", "tapered fork"])
def test_forces_are_the_energy_s_differences_and_balance(shape):
    wood = lay(params(**SHAPES[shape], clamp="none", twist=False), 24)
    m, generator = wood.motion, np.random.default_rng(0)
    m.x[:] += generator.normal(0, 0.02 * wood.rods.rest.min(), m.x.shape)
    pushed(wood)  # carries the directors there
    kept, way = [a.copy() for a in m], generator.normal(size=m.x.shape)
    h, found = 1e-7 * float(wood.rods.rest.min()), []
    for step in (0.0, h, -h):
        for now, was in zip(m, kept, strict=True):
            now[:] = was
        m.x[:] += step * way
        energy, force = pushed(wood)
        found.append((energy.sum(), force))
    force = found[0][1]
    assert (force * way).sum() * h == pytest.approx((found[2][0] - found[1][0]) / 2, rel=1e-5)
    assert np.abs(force.sum(0)).max() < 1e-11 * np.abs(force).max()


@pytest.mark.parametrize("clamp", ["none", "start"])
def test_a_circle_by_points_is_a_curvature(clamp):
    by_points = lay(params(spine=arc(0.1, 1.5, 60), clamp=clamp, length=0.15), 24)
    by_number = lay(params(curvature=10.0, length=0.15, clamp=clamp), 24)
    free, real = by_number.motion.held == 0, by_number.rods.k > 0
    # to the fourth order of the points' distance
    assert by_points.motion.x[free] == pytest.approx(by_number.motion.x[free], abs=1e-7)
    assert by_points.rods.rest[real] == pytest.approx(by_number.rods.rest[real], abs=1e-7)
    assert by_points.bonds.rest == pytest.approx(by_number.bonds.rest, abs=1e-7)


def test_sections_are_carried_along_without_spin():
    """The change of one axis of the section has no part along the other, and the curve is passed evenly."""
    curve = Curve(HELIX)
    s = np.linspace(0, curve.length, 4001)
    place, tangent, first, second = curve.frame(s)
    spin = (np.diff(first, axis=0) * (second[1:] + second[:-1]) / 2).sum(1) / np.diff(s)
    assert np.abs(spin).max() < 1e-3 / curve.length
    assert np.abs((tangent * first).sum(1)).max() < 1e-12
    assert np.linalg.norm(np.diff(place, axis=0), axis=1) == pytest.approx(np.diff(s), rel=1e-5)


def torques(wood: Wood) -> np.ndarray:
    """Return the torques (e,) [N m] about the rods' own axes."""
    scratch, books, m = scratch_for(wood), np.zeros(6), wood.motion
    forces(m, wood.rods, wood.turns, wood.bodies, scratch, wood.turning, 0.0, 1.0, books)
    return np.where(wood.turns.inertia > 0, scratch.torque, 0.0)


def stiff_in_spin(wood: Wood) -> np.ndarray:
    """Return the derivatives of torques by angles (3, e) in bands, by differences: neighbours in a rod alone meet."""
    theta, count, h = wood.motion.theta, len(wood.motion.theta), 1e-5
    bands, rest = np.zeros((3, count)), torques(wood)
    for first in range(3):
        theta[first::3] += h
        change = (rest - torques(wood)) / h
        theta[first::3] -= h
        for band, off in ((0, -1), (1, 0), (2, 1)):
            own = np.arange(first, count, 3)
            own = own[(own + off >= 0) & (own + off < count)]
            bands[band, own] = change[own + off]
    fixed = wood.turns.inertia == 0
    bands[:, fixed] = 0.0
    bands[1, fixed] = 1.0
    return bands


def sag(asked: WoodParams) -> np.ndarray:
    """Return how far the end moves (3,) [m] under its small dead load.

    By turns in places, with a matrix that leaves out what rods' own twist and rest curvature add, a part in as many as
    there are rods, and in the rods' spin: so it takes some rounds, with the forces themselves.
    """
    wood = lay(asked, asked.vertices)
    m, free = wood.motion, wood.motion.held == 0
    start = m.x.copy()
    k = splu(Stiffness(m.x, wood.rods, wood.bonds, free).matrix(m.x, wood.rods, wood.bonds).tocsc())
    spin = stiff_in_spin(wood)
    for _ in range(100):
        force, torque = pushed(wood)[1][free].ravel(), torques(wood)
        turned = solve_banded((1, 1), spin, torque)
        if np.linalg.norm(force) < 1e-4 * np.linalg.norm(m.load[free]) and np.abs(turned).max() < 1e-7:
            break
        m.x[free] += k.solve(force).reshape(-1, 3)
        m.theta[:] += turned
    else:
        raise AssertionError("no rest was found")
    load = np.linalg.norm(m.load, axis=1)
    found: np.ndarray = load @ (m.x - start) / load.sum()
    return found


@pytest.mark.parametrize("taper", [0.4, 0.7])
@pytest.mark.parametrize("quality", ["preview", "default"])
def test_a_tapered_cantilever_sags_as_a_cone_does(taper, quality):
    """Euler and Bernoulli with E I(x), and shear: P L^3 / (3 E I0 taper) + P L / (kappa G A0 taper)."""
    length, load = 0.4, 1.0
    values = {"mode": "static", "length": length, "taper": taper, "tip_load": (0, 0, -load), "vertices": 30}
    found = SOLVER.solve(params(**values), Need(stages=(1.0,), quality=quality, fields=("tip_position",)))
    wanted = load * (length**3 / (3 * E * SECOND) + length / (KAPPA * G * AREA)) / taper
    assert -found.tip_position.values[0, 2] == pytest.approx(wanted, rel=0.02)


def test_a_tapered_bundle_weighs_what_a_cone_does():
    wood = lay(params(taper=0.5, gravity=9.81, clamp="none"), 24)
    assert wood.motion.mass.sum() == pytest.approx(600 * AREA * 0.15 * (1 + 0.5 + 0.25) / 3, rel=1e-3)
    assert -wood.motion.load[:, 2].sum() == pytest.approx(9.81 * wood.motion.mass.sum(), rel=1e-12)


@pytest.mark.parametrize("way", ["x", "y", "z"])
def test_a_quarter_circle_sags_as_castigliano_says(way):
    """Clamped along x, bent up to z. By the energy of bending, twist, tension and shear of thin curved bars."""
    radius, load = 0.3, 0.1
    pull = load * np.eye(3)["xyz".index(way)]
    asked = params(spine=arc(radius, np.pi / 2), tip_load=tuple(pull), rods=60, vertices=31)
    moved = sag(asked) / load
    bend, twist = radius**3 / (E * SECOND), radius**3 / (G * 2 * SECOND)
    strain = np.pi / 4 * radius * (1 / (E * AREA) + 1 / (KAPPA * G * AREA))
    along = {
        "x": np.pi / 4 * bend + strain,
        "y": np.pi / 4 * bend + (3 * np.pi / 4 - 2) * twist + np.pi / 2 * radius / (KAPPA * G * AREA),
        "z": (3 * np.pi / 4 - 2) * bend + strain,
    }[way]
    # twisted, rods resist besides what holds them together: 60 of them by a part in sixty
    assert moved["xyz".index(way)] == pytest.approx(along, rel=0.04 if way == "y" else 0.02)
    if way != "y":
        other = -bend / 2 + (1 / (E * AREA) - 1 / (KAPPA * G * AREA)) * radius / 2
        assert moved[2 if way == "x" else 0] == pytest.approx(other, rel=0.02)


def test_the_limbs_of_a_fork_part_and_are_round():
    """Leonardo's rule: both together have the stem's section; neither passes through the other."""
    fork = {"at": 0.05, "angle": 0.6, "lean": 0.3, "share": 0.4}
    wood = lay(params(fork=fork, rods=200, length=0.15, clamp="none", unevenness=0.0), 46)
    x, area = wood.motion.x[wood.grid], np.pi * wood.rods.radius.reshape(len(wood.grid), -1)[:, 0] ** 2
    branch = x[:, -1, 2] > 0
    assert area[branch].sum() / area.sum() == pytest.approx(0.4, abs=0.05)
    t = x[:, -1] - x[:, -2]
    t /= np.linalg.norm(t, axis=1)[:, None]
    assert np.arctan2(t[branch, 2], t[branch, 0]) == pytest.approx(0.6, abs=1e-6)
    assert np.arctan2(t[~branch, 2], t[~branch, 0]) == pytest.approx(-0.3, abs=1e-6)
    for mine in (branch, ~branch):
        own = x[mine, -1] - area[mine] @ x[mine, -1] / area[mine].sum()
        round_ = (area[mine, None, None] * own[:, :, None] * own[:, None]).sum(0) / area[mine].sum()
        second = np.sort(np.linalg.eigvalsh(round_))[1:]
        # of a disk of the limb's area, both
        assert second == pytest.approx(area[mine].sum() / np.pi / 4, rel=0.12)
    apart = np.linalg.norm(x[branch][:, None, :, None] - x[~branch][None, :, None, ::3], axis=-1)
    assert apart.min() > 0.8 * np.linalg.norm(x[branch][:, None, 0] - x[~branch][None, :, 0], axis=-1).min()
    across = branch[wood.rod[wood.bonds.i]] != branch[wood.rod[wood.bonds.j]]
    places = wood.straight[wood.rods.a[wood.bonds.i[across]], 0]
    # the crotch: some way beyond the fork they still touch, at the end no more
    assert 0.05 < places.max() < 0.09


def test_what_cannot_be_is_refused():
    for values, said in (
        ({"spine": [(0, 0, 0), (0.1, 0, 0)], "length": 0.2}, "the spine is 0.1 m long"),
        ({"spine": [(0, 0, 0)]}, "two points"),
        ({"spine": [(0, 0, 0), (0, 0, 0)]}, "are the same"),
        ({"spine": arc(0.015, 2.0)}, "more sharply"),
        ({"spine": arc(0.05, 6.2)}, "passes through its own"),
        ({"spine": arc(0.1, 1.0), "curvature": 1.0}, "its own curvature"),
        ({"spine": arc(0.1, 1.0), "mode": "static"}, "curved axes, forks"),
        ({"fork": {"at": 0.05}, "mode": "static"}, "curved axes, forks"),
        ({"fork": {"at": 0.14}}, "before they part"),
        ({"fork": {"at": 0.05}, "curvature": 1.0}, "straight, round stems"),
        ({"fork": {"at": 0.05}, "rods": 7}, "8 rods or more"),
        ({"fork": {"at": 0.05}, "grain": {"spiral": 2.0}}, "straight below it"),
        ({"taper": 0.0}, "taper"),
        ({"spine": "round"}, "points x, y, z"),
    ):
        with pytest.raises(InvalidInput, match=said):
            params(**values)
