"""Bundles against Timoshenko's beam: stiffness, first frequency; slender and thick, even and uneven, every quality."""

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

from benchmarks.wood.bundles import beam_frequency, beam_sag
from solver.contract import Need
from solver.wood import SOLVER
from solver.wood.forces.hessian import Stiffness
from solver.wood.model.bundle import lay
from solver.wood.model.curves import held
from solver.wood.model.state import Wood
from solver.wood.settings import choose

E, RADIUS = 10e9, 0.01
SECOND = np.pi * RADIUS**4 / 4
PLAIN = {"fracture": "none", "grain": {"stiffness": 0.0, "strength": 0.0}}


def bundle(slender: float, **values):
    return {"radius": RADIUS, "length": slender * RADIUS, "clamp": "start", **PLAIN, **values}


@pytest.mark.parametrize("quality", ["preview", "default"])
@pytest.mark.parametrize("unevenness", [0.0, 0.3])
@pytest.mark.parametrize(("slender", "rods"), [(10, 40), (30, 20), (100, 20), (100, 100)])
def test_a_bundle_is_as_stiff_as_timoshenko_s_beam(slender, rods, unevenness, quality):
    length = slender * RADIUS
    load = 1e-3 * E * SECOND / length**2
    values = bundle(slender, rods=rods, unevenness=unevenness, mode="static", tip_load=(0, 0, -load))
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=(1.0,), quality=quality, fields=("tip_position",)))
    # without load the rods' centroid is on the axis
    assert -found.tip_position.values[0, 2] == pytest.approx(beam_sag(length, load), rel=0.02)


@pytest.mark.parametrize(("slender", "rods", "unevenness"), [(10, 40, 0.3), (40, 20, 0.0), (100, 20, 0.3)])
def test_a_bundle_swings_as_timoshenko_s_beam(slender, rods, unevenness):
    params = SOLVER.parse(bundle(slender, rods=rods, unevenness=unevenness))
    wood = lay(params, choose(params, "preview").vertices)
    m, free = wood.motion, wood.motion.held == 0
    k = Stiffness(m.x, wood.rods, wood.bonds, free).matrix(m.x, wood.rods, wood.bonds).tocsc()
    root = 1 / np.sqrt(np.repeat(m.mass[free], 3))
    scaled = k.multiply(root[:, None]).multiply(root).tocsc()
    start = np.ones(len(root))
    found = np.sqrt(eigsh(scaled, 2, sigma=0, v0=start, return_eigenvectors=False))
    assert found.min() == pytest.approx(beam_frequency(slender * RADIUS), rel=0.02)


def ends(wood: Wood, x: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return place and slope of both ends of each bond."""
    b = wood.bonds
    return [held(x, wood.rods, edge, share) for edge, share in ((b.i, b.at), (b.j, b.share))]


@pytest.mark.parametrize("clamp", ["none", "start", "both"])
def test_a_bend_and_a_turn_as_a_whole_stretch_no_bond(clamp):
    """A circular arc, sections square to it: what a chord would be stretched by is missing."""
    wood = lay(SOLVER.parse(bundle(20, rods=30, clamp=clamp, vertices=8, unevenness=0.6)), 8)
    x, bend = wood.motion.x.copy(), 0.5
    kappa = bend / (20 * RADIUS)
    bent = np.column_stack([(1 / kappa - x[:, 2]) * np.sin(kappa * x[:, 0]), x[:, 1], np.zeros(len(x))])
    bent[:, 2] = 1 / kappa - (1 / kappa - x[:, 2]) * np.cos(kappa * x[:, 0])
    if clamp == "none":
        (one, _), (other, _) = ends(wood, bent)
        straight = np.linalg.norm(one - other, axis=1) / wood.bonds.rest - 1
        chord = (kappa * wood.rods.rest.max() ** 2 / 8) / wood.bonds.rest.min()
        assert np.abs(straight).max() < 0.05 * chord
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turned = x @ (turn * np.sign(np.linalg.det(turn))).T + [0.3, 0.2, 0.1]
    (one, m0), (other, m1) = ends(wood, turned)
    d = one - other
    length = np.linalg.norm(d, axis=1)
    assert length == pytest.approx(wood.bonds.rest, rel=1e-12)
    assert ((m0 + m1) / 2 * d).sum(1) / length == pytest.approx(wood.bonds.cosine, abs=1e-12)
