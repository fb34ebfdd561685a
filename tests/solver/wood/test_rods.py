"""Rods and bonds against differences, plain numpy, closed forms and conservation laws."""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import simpson, solve_bvp
from scipy.linalg import eigh
from scipy.optimize import brentq

from solver.contract import Context, Need, NotConverged
from solver.wood import SOLVER
from solver.wood.forces.hessian import Stiffness
from solver.wood.model.bundle import lay
from solver.wood.model.state import Wood, scratch_for
from solver.wood.stepping.explicit import forces
from solver.wood.stepping.marching import explicit as march
from solver.wood.stepping.moment import begin, kinetic
from solver.wood.stepping.static import equilibrium

from ._bonds_twin import bond_energies

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}


def energies(wood: Wood) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return energies, forces (v, 3) and torques (e,)."""
    scratch, books = scratch_for(wood), np.zeros(6)
    forces(wood.motion, wood.rods, wood.turns, wood.bodies, scratch, wood.turning, 0.0, 1.0, books)
    return books[:4].copy(), scratch.f, scratch.torque


def shaken(**values) -> Wood:
    wood = lay(SOLVER.parse({"vertices": 10, **values}), 10)
    generator = np.random.default_rng(0)
    wood.motion.x[:] += generator.normal(0, 0.05 * wood.rods.rest.min(), wood.motion.x.shape)
    if wood.turning:
        wood.motion.theta[:] = generator.normal(0, 0.3, len(wood.motion.theta))
    energies(wood)  # carries the directors there
    return wood


@pytest.mark.parametrize(
    "values", [{"rods": 1}, {"rods": 12}, {"rods": 12, "twist": True}, {"curvature": 4, "rods": 9}]
)
def test_forces_are_the_energy_s_differences_and_balance(values):
    wood = shaken(**values)
    m = wood.motion
    generator = np.random.default_rng(1)
    _, f, torque = energies(wood)
    x, theta, frames = m.x.copy(), m.theta.copy(), [a.copy() for a in (m.d, m.old, m.reference)]
    h = 1e-7 * wood.rods.rest.min()
    way, turned = generator.normal(size=x.shape), generator.normal(size=theta.shape) * wood.turning
    found = []
    for sign in (1, -1):
        for target, kept in zip((m.d, m.old, m.reference), frames, strict=True):
            target[:] = kept
        m.x[:], m.theta[:] = x + sign * h * way, theta + sign * 1e-7 * turned
        found.append(energies(wood)[0].sum())
    change = (found[1] - found[0]) / 2
    assert (f * way).sum() * h + (torque * turned).sum() * 1e-7 == pytest.approx(change, rel=1e-6)
    scale = np.abs(f).max()
    assert np.abs(f.sum(0)).max() < 1e-12 * scale
    # spinning about the tangents takes part in the torques
    tangents = x[wood.rods.b] - x[wood.rods.a]
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    total = np.cross(x, f).sum(0) + torque @ tangents
    assert np.abs(total).max() < 1e-12 * scale * 0.15 * len(f)


def test_energies_are_those_of_plain_numpy():
    wood = shaken(rods=9)
    x, r = wood.motion.x, wood.rods
    e = x[r.b] - x[r.a]
    length = np.linalg.norm(e, axis=1)
    stretch = (r.k * (length / r.rest - 1) ** 2 * r.rest).sum() / 2
    u, w = e[r.before], e[r.after]
    lengths = length[r.before] * length[r.after]
    binormal = 2 * np.cross(u, w) / (lengths + (u * w).sum(1))[:, None]
    bend = (r.alpha * (binormal**2).sum(1) / r.span).sum()
    bonds = bond_energies(wood, x).sum()
    assert energies(wood)[0] == pytest.approx([stretch, bend, bonds, 0], rel=1e-11)


@pytest.mark.parametrize("values", [{"rods": 1}, {"rods": 9}])
def test_the_stiffness_is_the_forces_difference(values):
    wood = shaken(**values)
    m = wood.motion
    free = m.held == 0
    k = Stiffness(m.x, wood.rods, wood.bonds, free).matrix(m.x, wood.rods, wood.bonds)
    way = np.random.default_rng(2).normal(size=(int(free.sum()), 3))
    h, x, found = 1e-6 * wood.rods.rest.min(), m.x.copy(), []
    for sign in (1, -1):
        m.x[free] = x[free] + sign * h * way
        found.append(energies(wood)[1][free])
    expected = (found[1] - found[0]).ravel() / (2 * h)
    assert np.linalg.norm(k @ way.ravel() - expected) < 1e-6 * np.linalg.norm(expected)
    assert abs(k - k.T).max() < 1e-12 * abs(k).max()


@pytest.mark.parametrize("twist", [False, True])
def test_momentum_is_kept_to_round_off(twist):
    params = SOLVER.parse({"rods": 9, "vertices": 10, "clamp": "none", "bend": 0.02, "twist": twist, **PLAIN})
    wood = lay(params, 10)
    m = wood.motion
    m.v[:] = np.random.default_rng(3).normal(size=m.v.shape)
    start = m.mass @ m.v
    spin = (m.mass[:, None] * np.cross(m.x, m.v)).sum(0)
    (reached,) = march(wood, params, (2e-4,), 2e-7, 1.0, Context())
    n = reached.state.wood.motion
    scale = m.mass.sum()
    assert np.abs(n.mass @ n.v - start).max() < 1e-12 * scale
    if not twist:
        assert np.abs((n.mass[:, None] * np.cross(n.x, n.v)).sum(0) - spin).max() < 1e-12 * scale


def elastica(p: float) -> tuple[float, float]:
    """Return the tip's deflection and place along, over the length, for p = P L^2 / (E I)."""
    s = np.linspace(0, 1, 501)
    guess = np.vstack([p * (s - s * s / 2), p * (1 - s)])
    found = solve_bvp(
        lambda s, y: np.vstack([y[1], -p * np.cos(y[0])]), lambda a, b: np.array([a[0], b[1]]), s, guess, tol=1e-9
    )
    theta = found.sol(s)[0]
    return simpson(np.sin(theta), x=s), simpson(np.cos(theta), x=s)


R, L, E, RHO = 5e-4, 0.15, 10e9, 600.0
AREA, SECOND = np.pi * R**2, np.pi * R**4 / 4
ONE = {"rods": 1, "radius": R, "length": L, "unevenness": 0.0, **PLAIN}


@pytest.mark.parametrize("p", [0.1, 1.0, 5.0])
def test_cantilever_is_the_elastica_s_to_second_order(p):
    exact = np.array(elastica(p)[::-1])
    load = (0.0, 0.0, p * E * SECOND / L**2)
    errors = []
    for vertices in (8, 15, 29):
        params = SOLVER.parse({**ONE, "vertices": vertices, "mode": "static", "tip_load": load})
        tip = SOLVER.solve(params, Need(stages=(1.0,))).tip_position.values[0]
        errors.append(np.linalg.norm(np.abs(tip[[0, 2]]) / L - np.abs(exact)))
    assert errors[-1] < 2e-3 * exact[1]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.35)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.35)


def modes(wood: Wood, scale: float = 0.0) -> np.ndarray:
    """Return frequencies squared."""
    m = wood.motion
    free = m.held == 0
    k = Stiffness(m.x, wood.rods, wood.bonds, free).matrix(m.x, wood.rods, wood.bonds).toarray()
    return eigh(k, np.diag(np.repeat(m.mass[free], 3)), eigvals_only=True)


def test_frequencies_of_bending_and_of_axial_waves():
    wood = lay(SOLVER.parse({**ONE, "vertices": 30}), 30)
    found = np.sqrt(modes(wood))
    bending = 1.8751040687**2 / L**2 * np.sqrt(E * SECOND / (RHO * AREA))
    assert found[0] == pytest.approx(bending, rel=2e-3)
    # clamped and free: a quarter of the wave, at the speed sqrt(E / rho)
    axial = np.pi / 2 / L * np.sqrt(E / RHO)
    assert np.abs(found / axial - 1).min() < 1e-3


def test_euler_s_load():
    params = SOLVER.parse({**ONE, "vertices": 30, "mode": "static", "tip_load": (-1.0, 0.0, 0.0)})

    def softest(load: float) -> float:
        wood = lay(params, 30)
        full = wood.motion.load.copy()
        wood.motion.load[:] = 0
        equilibrium(begin(wood), params, load, full)
        return float(modes(wood)[0])

    critical = np.pi**2 * E * SECOND / (4 * L**2)
    assert brentq(softest, 0.9 * critical, 1.1 * critical, xtol=1e-4 * critical) == pytest.approx(critical, rel=3e-3)


@pytest.mark.parametrize("rods", [1, 7])
def test_what_has_buckled_is_no_equilibrium(rods):
    """Beyond Euler's load what is straight balances, or leans against the load, and would not last."""
    critical = np.pi**2 * E * SECOND / (4 * L**2)
    slender = {"length": L, "radius": R, "rods": rods, "vertices": 12, "mode": "static", **PLAIN}

    def pressed(load: float, across: float) -> xr.Dataset:
        params = SOLVER.parse({**slender, "tip_load": (-load * critical, 0.0, across)})
        return SOLVER.solve(params, Need(stages=(0.5, 1.0), quality="preview", fields=("tip_position",)))

    assert pressed(0.9, -1e-3 * critical).converged.all()
    for across in (0.0, -1e-4 * critical):
        with pytest.raises(NotConverged, match="buckled") as caught:
            pressed(1.3, across)
        assert caught.value.last_stage == 0.5
        assert caught.value.partial is not None
        assert caught.value.partial.converged.all()


def test_what_is_slender_bends_under_loads_that_are_nothing_to_its_strength():
    """F L^3 / 3 E I at 10,000 radii, under a billionth of what it bears; it stayed where it was."""
    radius, length = 1e-3, 10.0
    second = np.pi * radius**4 / 4
    load = 3 * E * second * 1e-3 / length**2
    values = {"length": length, "radius": radius, "rods": 1, "vertices": 40, "mode": "static", **PLAIN}
    params = SOLVER.parse({**values, "tip_load": (0.0, 0.0, -load)})
    found = SOLVER.solve(params, Need(stages=(1.0,), quality="preview", fields=("tip_position",)))
    assert found.converged.all()
    assert -found.tip_position.values[0, 2] == pytest.approx(1e-3 * length, rel=0.01)
    # further than numbers tell
    thin = SOLVER.parse({**values, "radius": 1e-4, "tip_load": (0.0, 0.0, -load * 1e-4)})
    with pytest.raises(NotConverged, match="so slender"):
        SOLVER.solve(thin, Need(stages=(1.0,), quality="preview", fields=("tip_position",)))


def test_torsion_swings_with_its_wave():
    g = 0.7e9
    params = SOLVER.parse({**ONE, "vertices": 20, "twist": True})
    wood = lay(params, 20)
    middle = wood.motion.x[wood.rods.a, 0] / 2 + wood.motion.x[wood.rods.b, 0] / 2
    wood.motion.theta[:] = 0.1 * np.sin(np.pi * np.maximum(middle, 0) / (2 * L))
    half = 2 * L / np.sqrt(g / RHO)
    tip = wood.motion.theta[-1]
    (reached,) = march(wood, params, (half,), 2e-7, 1.0, Context())
    assert reached.state.wood.motion.theta[-1] == pytest.approx(-tip, rel=2e-3)
    assert reached.error < 1e-3


def test_a_curved_axis_is_at_rest_and_follows_a_turn():
    params = SOLVER.parse({"rods": 9, "vertices": 12, "curvature": 5.0, "clamp": "none", **PLAIN})
    wood = lay(params, 12)
    stiff = energies(wood)[0]
    assert stiff.max() < 1e-20
    angle = 0.7
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    # in small turns, as a run would make them
    part = np.array([[1, 0, 0], [0, np.cos(angle / 7), -np.sin(angle / 7)], [0, np.sin(angle / 7), np.cos(angle / 7)]])
    for _ in range(7):
        wood.motion.x[:] = wood.motion.x @ part.T
        wood.motion.theta[:] += (
            (angle / 7) * ((wood.motion.x[wood.rods.b] - wood.motion.x[wood.rods.a])[:, 0]) / wood.rods.rest
        )
        energies(wood)
    assert np.allclose(np.linalg.matrix_power(part, 7), turn)
    # the frames' spin is only near the turn's own part along the tangents: first order in the small turns
    assert energies(wood)[0][1] < 1e-2 * float((wood.rods.alpha / wood.rods.span).sum())
    assert kinetic(wood) == 0
