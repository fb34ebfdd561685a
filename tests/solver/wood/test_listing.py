"""Which rods may touch: what whole bonds hold together does not, and lists hold as long as they say."""

import numpy as np
import pytest

from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.contact.listing import Listing, Near, law
from solver.wood.contact.pairs import pairs
from solver.wood.model.bundle import lay
from solver.wood.stepping.moment import begin

FEW = {"rods": 20, "vertices": 12, "length": 0.06, "radius": 0.005}


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ({}, True),
        ({"fracture": "none"}, False),
        ({"mode": "static"}, False),
        ({"rods": 1}, False),
        ({"fracture": "none", "rod_contact": True}, True),
        ({"rod_contact": False}, False),
    ],
)
def test_rods_touch_by_default_where_they_may_break(values, wanted):
    params = SOLVER.parse({**FEW, **values})
    assert params.touching is wanted
    assert Listing(lay(params, 12), params).on is wanted


def chords(wood):
    """Return the lengths of bonds, by hand."""
    x, r, b = wood.motion.x, wood.rods, wood.bonds
    one = x[r.a[b.i]] + b.at[:, None] * (x[r.b[b.i]] - x[r.a[b.i]])
    return np.linalg.norm(one - x[r.a[b.j]] - b.share[:, None] * (x[r.b[b.j]] - x[r.a[b.j]]), axis=1)


def test_what_bonds_hold_apart_does_not_touch():
    """Against a search by hand: a pair is left out if a whole, long bond joins the one's edge with the other's rod."""
    params = SOLVER.parse(FEW)
    wood = lay(params, 12)
    rng = np.random.default_rng(1)
    wood.motion.x[:] += rng.normal(0, 2.5e-4, wood.motion.x.shape)
    gone = (wood.rods.a[wood.bonds.i] % 11 < 4) & (rng.random(len(wood.bonds.i)) < 0.7)
    wood.bonds.on[gone] = rng.integers(0, 3, gone.sum()) // 2 * 2
    listing, thick = Listing(wood, params), float(law(wood, params)[0])
    found = {tuple(p) for p in listing.fitted(begin(wood)).scratch.rubbing.pair.tolist()}
    bonds, a, b = wood.bonds, wood.rods.a, wood.rods.b
    holds = (bonds.on == 1) & (chords(wood) > 1.1 * thick)
    assert 0 < holds.sum() < len(holds)
    lost = {*bonds.i[~holds].tolist(), *bonds.j[~holds].tolist()}
    held = set()
    for i, j in zip(bonds.i[holds].tolist(), bonds.j[holds].tolist(), strict=True):
        for e, w in ((i, j), (j, i)):
            held |= {(e, int(o)) for o in np.flatnonzero((a == a[w]) | (a == b[w]) | (b == a[w]))}
    held = {(e, w) for e, w in held if e not in lost and w not in lost}
    near = pairs(wood.motion.x, wood.rods, wood.rod, thick)
    wanted = {(int(e), int(w)) for e, w in near if not {(e, w), (w, e)} & held}
    assert wanted <= found
    assert not {(e, w) for e, w in found if {(e, w), (w, e)} & held}
    assert wanted
    assert len(wanted) < len(near)


def test_a_bond_that_is_pressed_lets_its_rods_touch_from_then_on():
    params = SOLVER.parse({**FEW, "unevenness": 0.0})
    wood = lay(params, 12)
    listing, state, first = Listing(wood, params), begin(wood), wood.motion.x.copy()
    assert not len(listing.fitted(state).scratch.rubbing.pair)
    wood.motion.x[:, 1:] *= 0.85
    pressed = listing.fitted(state).scratch.rubbing.pair
    assert len(pressed) > 0
    wood.motion.x[:] = first
    assert len(listing.fitted(state).scratch.rubbing.pair) > 0


def test_a_bond_that_breaks_lets_its_rods_touch():
    params = SOLVER.parse(FEW)
    wood = lay(params, 12)
    listing, state = Listing(wood, params), begin(wood)
    state = listing.fitted(state)
    assert not len(state.scratch.rubbing.pair)
    wood.bonds.on[:] = 2
    state = listing.fitted(state)
    assert len(state.scratch.rubbing.pair)


def test_pairs_hold_until_a_vertex_has_left_its_margin():
    params = SOLVER.parse(FEW)
    wood = lay(params, 12)
    near = Near(wood, 1e-3, 1e-4)
    first, wide = wood.motion.x.copy(), 0.15e-3
    for way, span, speed, holds in (
        (0.9 * wide, 0.0, 0.0, True),
        (1.1 * wide, 0.0, 0.0, False),
        (0.5 * wide, 1e-4, 0.4 * wide / 1e-4, True),
        (0.5 * wide, 1e-4, 0.6 * wide / 1e-4, False),
    ):
        wood.motion.x[:] = first
        wood.motion.x[30, 1] += way
        wood.motion.v[:] = 0.0
        wood.motion.v[30, 1] = speed
        assert near.holds(wood, span) is holds


def test_a_branch_torn_apart_keeps_its_books():
    values = {**FEW, "clamp": "both", "pull": (5.0, 0, 0), "strain_limit": 2e-3, "cleavage": 1e6}
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(2e-4, 1e-3, 2e-3), fields=("broken_rods", "broken_bonds")))
    assert found.broken_rods[-1] > 5
    assert found.residual.max() < 0.02
