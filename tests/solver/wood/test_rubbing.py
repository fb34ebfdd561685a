"""Contact between rods: two that cross and collide, and the search for pairs against all pairs."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize

from solver.contract import Context, InvalidInput, Need
from solver.wood import SOLVER
from solver.wood.contact.listing import law
from solver.wood.contact.pairs import pairs
from solver.wood.contact.rubbing import MIDDLE, rub
from solver.wood.model.arrays import Rubbing
from solver.wood.model.bundle import lay
from solver.wood.stepping.marching import explicit
from solver.wood.stepping.moment import kinetic

PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}
VALUES = {"rods": 2, "vertices": 11, "reach": 0.0, "clamp": "none", "radius": 0.004, "length": 0.1, **PLAIN}


def crossed(friction):
    """Return the parameters and two free rods, the upper one across the lower and falling on it askew."""
    params = SOLVER.parse({**VALUES, "rod_contact": True, "rod_friction": friction})
    wood = lay(params, 11)
    x = wood.motion.x.reshape(2, 11, 3)
    x[0, :, 1:] = 0.0
    s = x[1, :, 0] - 0.05
    x[1, :, 0], x[1, :, 1], x[1, :, 2] = 0.052, s, 0.01
    x[1, :, 2] = 1.2 * law(wood, params)[0]
    wood.motion.v.reshape(2, 11, 3)[1] = [0.3, 0.0, -1.0]
    return params, wood


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_two_crossing_rods_collide(friction):
    params, wood = crossed(friction)
    m = wood.motion
    momentum, energy = m.mass @ m.v, kinetic(wood)
    upper = np.arange(22) >= 11
    (found,) = explicit(wood, params, (4e-3,), 8e-7, 1.0, Context())
    n = found.state.wood.motion
    assert n.mass @ n.v == pytest.approx(momentum, abs=1e-13 * np.abs(momentum).max())
    # they bounce: the lower one was pushed down, the upper one up
    assert n.mass[~upper] @ n.v[~upper, 2] < 0.2 * momentum[2]
    lost = found.energy[2]
    dragged = n.mass[~upper] @ n.v[~upper, 0]
    if friction:
        assert 0.005 * energy < lost < energy
        push = -(n.mass[~upper] @ n.v[~upper, 2])
        assert 0 < dragged <= friction * push * 1.01
    else:
        assert abs(lost) < 1e-9 * energy
        assert abs(dragged) < 0.05 * momentum[0]
    assert found.error < 2e-3


def test_without_contact_they_pass():
    params, wood = crossed(0.0)
    params = params.model_copy(update={"rod_contact": False})
    (found,) = explicit(wood, params, (4e-3,), 8e-7, 1.0, Context())
    n = found.state.wood.motion
    assert np.abs(n.v[:11]).max() < 1e-6


def test_boxes_find_what_all_pairs_do():
    wood = lay(SOLVER.parse({"rods": 30, "vertices": 6, "length": 0.05, "reach": 1.2}), 6)
    x = wood.motion.x + np.random.default_rng(0).normal(0, 5e-4, wood.motion.x.shape)
    r, reach = wood.rods, 1.5e-3
    found = {tuple(p) for p in pairs(x, r, wood.rod, reach)}
    assert all(wood.rod[e] != wood.rod[w] for e, w in found)
    share = np.linspace(0, 1, 41)
    real = np.flatnonzero(r.k > 0)
    points = x[r.a[real], None] * (1 - share[:, None]) + x[r.b[real], None] * share[:, None]
    for p, e in enumerate(real):
        for q in range(p + 1, len(real)):
            w = real[q]
            if wood.rod[e] == wood.rod[w]:
                continue
            least = np.linalg.norm(points[p][:, None] - points[q][None], axis=-1).min()
            if least < 0.95 * reach:
                assert (e, w) in found
            if least > 1.1 * reach:
                assert (e, w) not in found
    assert found


def test_a_bundle_at_rest_touches_nothing_and_one_that_parts_keeps_its_books():
    values = {"rods": 12, "vertices": 10, "length": 0.1, "radius": 0.005, "clamp": "both", "pull": (2.0, 0, 0)}
    with pytest.raises(InvalidInput):
        SOLVER.parse({**values, "rod_contact": True, "mode": "static"})
    need = Need(stages=(2e-4, 1.5e-3))
    plain = SOLVER.solve(SOLVER.parse(values), need)
    found = SOLVER.solve(SOLVER.parse({**values, "rod_contact": True, "step": plain.attrs["step"]}), need)
    assert found.broken_rods[1] > 6
    assert found.residual.max() < 0.02


#: Two rods of two edges: across, along and beside each other, askew, and end on.
PLACES = {
    "cross": ([0.004, 0.004, 0.004], [-0.012, -0.002, 0.008], [0.0018] * 3),
    "along": ([0.003, 0.013, 0.023], [0.0] * 3, [0.0018] * 3),
    "askew": ([0.003, 0.013, 0.023], [-0.001, 0.0, 0.001], [0.0017] * 3),
    "end": ([0.003, 0.004, 0.005], [0.0] * 3, [0.0017, 0.0117, 0.0217]),
}
THICK = 2e-3


def two(place, friction):
    """Return x, v (6, 3), masses, rods and all pairs of two rods of two edges, nearly touching as named."""
    wood = lay(SOLVER.parse({"rods": 2, "vertices": 3, "clamp": "none", "radius": 0.004, "length": 0.02}), 3)
    generator = np.random.default_rng(0)
    x = np.zeros((2, 3, 3))
    x[0, :, 0] = [0, 0.01, 0.02]
    x[1] = np.array(PLACES[place]).T
    x = x.reshape(6, 3) + generator.normal(0, 1e-5, (6, 3))
    pair = np.array(list(product([0, 1], [2, 3])), np.int32)
    rubbing = Rubbing(pair, np.array([THICK, 1e5, friction, 1e-4]))
    return x, 3e-4 * generator.normal(size=x.shape), wood.motion.mass, wood.rods, rubbing


def rubbed(x, v, mass, rods, rubbing):
    f, power = np.zeros_like(x), np.zeros(2)
    return rub(x, v, f, mass, rods, rubbing, 1e-3, power), f, power


@pytest.mark.parametrize("place", PLACES)
def test_energy_is_that_of_points_found_by_search(place):
    x, v, mass, rods, rubbing = two(place, 0.0)
    wanted = 0.0
    for e, w in rubbing.pair:
        a, b, c, d = (x[n] for n in (rods.a[e], rods.b[e], rods.a[w], rods.b[w]))

        def square(y, a=a, b=b, c=c, d=d):
            apart = a + y[0] * (b - a) - c - y[1] * (d - c)
            return 1e6 * (apart @ apart + MIDDLE * THICK**2 * ((y[0] - 0.5) ** 2 + (y[1] - 0.5) ** 2))

        starts = product([0.1, 0.9], repeat=2)
        best = min(minimize(square, y, bounds=[(0, 1)] * 2, tol=1e-14).fun for y in starts)
        gap = max(THICK - 1e-3 * np.sqrt(best), 0.0)
        ease = 1e-4
        wanted += 1e5 * (gap**3 / (6 * ease) if gap < ease else gap**2 / 2 - gap * ease / 2 + ease**2 / 6)
    assert rubbed(x, v, mass, rods, rubbing)[0] == pytest.approx(wanted, rel=1e-5)
    assert wanted > 0


@pytest.mark.parametrize(("place", "friction"), list(product(PLACES, [0.0, 0.5])))
def test_forces_are_differences_of_the_energy_and_keep_momentum(place, friction):
    x, v, *rest = two(place, friction)
    way, h = np.random.default_rng(1).normal(size=x.shape), 1e-9
    (up, _, _), (down, _, _) = (rubbed(x + s * h * way, v, *rest) for s in (1, -1))
    _, f, _ = rubbed(x, v, *rest)
    assert np.abs(f.sum(0)).max() < 1e-14 * np.abs(f).max()
    if not friction:
        assert (f * way).sum() == pytest.approx((down - up) / (2 * h), rel=1e-7)


def test_pressed_rods_rest_where_the_penalty_bears_the_load():
    params, wood = crossed(0.3)
    params = params.model_copy(update={"damping": 3000.0})
    m, load = wood.motion, 4.0
    m.v[:] = 0.0
    m.x.reshape(2, 11, 3)[1, :, 0] = 0.05
    share = m.mass / m.mass.reshape(2, 11).sum(1).repeat(11)
    m.load[:, 2] = load * share * np.where(np.arange(22) < 11, 1.0, -1.0)
    (found,) = explicit(wood, params, (0.03,), 8e-7, 1.0, Context())
    thick, k, _, ease = law(wood, params)
    depth = load / k + ease / 2 if load > k * ease / 2 else np.sqrt(2 * ease * load / k)
    energy = k * (depth**2 / 2 - depth * ease / 2 + ease**2 / 6) if depth > ease else k * depth**3 / (6 * ease)
    # the distance that counts is a little longer than the way between the points
    assert found.state.books[3] == pytest.approx(energy, rel=0.03)
    x = found.state.wood.motion.x.reshape(2, 11, 3)
    middle = [np.interp(0.05, x[0, :, 0], x[0, :, 2]), np.interp(0.0, x[1, :, 1], x[1, :, 2])]
    assert middle[1] - middle[0] == pytest.approx(thick - depth, rel=0.03)
