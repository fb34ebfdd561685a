"""Contact between rods: two that cross and collide, and the grid against all pairs."""

import numpy as np
import pytest

from solver.contract import Context, InvalidInput, Need
from solver.wood import SOLVER
from solver.wood.bundle import lay
from solver.wood.listing import law
from solver.wood.moment import kinetic
from solver.wood.rubbing import pairs
from solver.wood.stepping import explicit

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


def test_the_grid_finds_what_all_pairs_do():
    wood = lay(SOLVER.parse({"rods": 30, "vertices": 6, "length": 0.05, "reach": 1.2}), 6)
    x = wood.motion.x + np.random.default_rng(0).normal(0, 5e-4, wood.motion.x.shape)
    r, b, reach = wood.rods, wood.bonds, 1.5e-3
    found = {tuple(p) for p in pairs(x, r, b, wood.rod, reach)}
    share = np.linspace(0, 1, 41)
    real = np.flatnonzero(r.k > 0)
    points = x[r.a[real], None] * (1 - share[:, None]) + x[r.b[real], None] * share[:, None]
    bonded = set()
    for i, j in zip(b.i, b.j, strict=True):
        for e in np.flatnonzero((r.a == i) | (r.b == i)):
            bonded.add((min(e, j), max(e, j)))
    for p, e in enumerate(real):
        for q in range(p + 1, len(real)):
            w = real[q]
            if wood.rod[e] == wood.rod[w]:
                continue
            least = np.linalg.norm(points[p][:, None] - points[q][None], axis=-1).min()
            if least < 0.95 * reach and (e, w) not in bonded:
                assert (e, w) in found
            if least > 1.1 * reach or (e, w) in bonded:
                assert (e, w) not in found
    assert found


def test_a_bundle_at_rest_touches_nothing_and_one_that_parts_keeps_its_books():
    values = {"rods": 12, "vertices": 10, "length": 0.1, "radius": 0.005, "clamp": "both", "pull": (2.0, 0, 0)}
    with pytest.raises(InvalidInput):
        SOLVER.parse({**values, "rod_contact": True, "mode": "implicit"})
    need = Need(stages=(2e-4, 1.5e-3))
    plain = SOLVER.solve(SOLVER.parse(values), need)
    found = SOLVER.solve(SOLVER.parse({**values, "rod_contact": True, "step": plain.attrs["step"]}), need)
    assert found.broken_rods[1] > 6
    assert found.residual.max() < 0.02
