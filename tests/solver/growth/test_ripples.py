"""Ripples of a strip that grows along its edge, against the linear stability of a plate.

A strip held along one long side and at both ends grows in x by e(y): while it is flat, the resultant is
N(y) = -Y t e(y) along x alone. Von Karman's plate buckles in w = f(y) cos(k x) where

    D / 2 [(f'' - k^2 f)^2 + 2 (1 - nu_b) k^2 (f f'' + f'^2)] - Y t e k^2 f^2 / 2

summed over the width falls below 0 (Timoshenko and Gere 1961, section 8.1; for growing edges Audoly and Boudaoud 2003,
Liang and Mahadevan 2009). nu_b: Poisson's ratio in bending, -1/3 of hinges.
Waves that are 5 % longer or shorter appear .2 % later, and a strip of ten waves has one more or less: so which of them
a strip shows that has been grown a third beyond its threshold is the noise's choice, and the sheet's own modes at the
threshold are compared as well, with those of the finite strip by conforming elements (Bogner, Fox and Schmit 1965, of
scikit-fem). The plate is clamped at the line up to which the sheet was asked to be held, between two of its rows.
With 1, as the mean curvature alone has it, the threshold falls towards 0 for short waves: the mesh sets their length.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar
from scipy.sparse import csc_array
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementQuadBFS, MeshQuad

from solver.contract import Context
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.energy import StepEnergy
from solver.growth.settling.tangent import Tangent
from solver.shell import Material

ASPECT, THICKNESS, STRETCH, STEP = 8.0, 0.03, 1.05, 0.01


def smooth(y):
    v = np.clip(y / 0.5, 0, 1)
    return v * v * (3 - 2 * v)


def threshold(k, low, material, ratio=-1 / 3, cells=60):
    """Return the log stretch of the edge at which waves k appear, by Hermite elements from low (clamped) to 0.5."""
    h = (0.5 - low) / cells
    stiff, load = np.zeros((2 * cells + 2,) * 2), np.zeros((2 * cells + 2,) * 2)
    for s, weight in zip(*np.polynomial.legendre.leggauss(4), strict=True):
        s, weight = (s + 1) / 2, weight / 2 * h
        f = np.array([1 - 3 * s**2 + 2 * s**3, h * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, h * (s**3 - s**2)])
        df = np.array([-6 * s + 6 * s**2, h * (1 - 4 * s + 3 * s**2), 6 * s - 6 * s**2, h * (3 * s**2 - 2 * s)]) / h
        ddf = np.array([-6 + 12 * s, h * (-4 + 6 * s), 6 - 12 * s, h * (6 * s - 2)]) / h**2
        lap = ddf - k * k * f
        both = np.outer(f, ddf)
        bend = np.outer(lap, lap) + (1 - ratio) * k * k * (both + both.T + 2 * np.outer(df, df))
        for c in range(cells):
            own = slice(2 * c, 2 * c + 4)
            stiff[own, own] += weight * material.flexural * bend
            load[own, own] += weight * 2 * (1 + material.poisson) * smooth(low + (c + s) * h) * k * k * np.outer(f, f)
    # the load is no more than semidefinite: its inverse eigenvalues are sought
    return 1 / eigh(load[2:, 2:], stiff[2:, 2:], eigvals_only=True)[-1]


def grown_strip(border, seed=0):
    """Return an engine of a strip that is held below y = border, and in x at its ends."""
    held = [{"where": {"kind": "band", "along": "y", "low": border + 0.1, "high": border - 0.1}}]
    held += [
        {"where": {"kind": "band", "along": "x", "low": s * 3.9, "high": s * 4.0}, "axes": ("x",)} for s in (-1, 1)
    ]
    edge = {"kind": "band", "along": "y", "low": 0.0, "high": 0.5}
    values = {
        "shape": "strip",
        "aspect": ASPECT,
        "thickness": THICKNESS,
        "curved": False,
        "attached": held,
        "tools": [{"kind": "surface", "where": edge, "frame": (1, 0, 0), "stretch": (STRETCH, 1.0)}],
        "remesh": 0,
        "step": STEP,
        # five times less than usual: ripples of the start are seen before those of the edge
        "imperfection": 0.004,
        "seed": seed,
    }
    return Engine(GrowthParams.parse(values), 6000, 1e-7)


def edge_of(state):
    """Return the main wave number of the free edge, away from the ends, and how far it moves."""
    edge = state.x[np.isclose(state.x[:, 1], 0.5, atol=0.02)]
    return waves_of(*edge[:, [0, 2]].T)


def waves_of(x, z):
    """Return the main wave number of heights z (m,) at x (m,), away from the ends, and how far they reach."""
    x, z = x[np.argsort(x)], z[np.argsort(x)]
    at = np.linspace(-3.0, 3.0, 600)
    z = np.interp(at, x, z)
    # zero padding, finer than one wave over the length
    spectrum = np.abs(np.fft.rfft(np.hanning(600) * (z - z.mean()), 16 * 600))
    return 2 * np.pi * np.fft.rfftfreq(16 * 600, at[1] - at[0])[spectrum.argmax()], np.ptp(z)


@pytest.mark.slow
@pytest.mark.parametrize("border", [0.0, 0.15])
def test_ripples_of_a_growing_edge_come_when_a_plates_do_and_are_as_long(border):
    """Measured, seeds 0 to 3: k 3.86, 4.25, 4.25 and 3.86 for 4.18 (border 0), 6.21, 5.82, 6.21 and 6.21 for 6.06.

    Onset at 1.03, .95, 1.10 and .95 of the plate's, and .94, .90, .94 and .94. Half a wave more on the strip is .39 of
    k: which one it shows is the noise's choice, and two seeds lie about theory's. To 1e-6 the sheet lagged behind
    growth, its onset said 1.16 and 1.00; from 1e-7 to 1e-8 nothing changes at border 0.15. A step is 0.05 of the
    threshold, and so finely is the onset known. Without a border it hangs on what the sheet starts from, .85, 1.01 and
    1.16 at imperfections .02, .004 and .001, with one it does not.
    """
    material = Material(THICKNESS)
    expected = minimize_scalar(lambda k: threshold(k, border, material), bounds=(1.0, 25.0), method="bounded").x
    least = threshold(expected, border, material)
    onsets, waves = [], []
    for seed in (0, 1):
        engine, onset, found = grown_strip(border, seed), np.inf, 0.0
        while engine.state.time * np.log(STRETCH) < 1.3 * least:
            engine.advance(1e9, until=engine.state.time + STEP)
            found, height = edge_of(engine.state)
            if height > 0.1 * THICKNESS:
                onset = min(onset, engine.state.time * np.log(STRETCH))
        onsets.append(onset / least)
        waves.append(found)
    assert waves == pytest.approx([expected, expected], abs=np.pi / ASPECT)
    assert np.mean(waves) == pytest.approx(expected, rel=0.05)
    assert 0.9 < np.mean(onsets) < 1.2


def plates_modes(low, material, ratio=-1 / 3):
    """Return thresholds and wave numbers of the edge (6, 2) of a finite strip that is clamped at low, by scikit-fem.

    The first two are the strip's ends, where nothing holds it, the next two its waves with a crest or a node amid.
    """
    mesh = MeshQuad.init_tensor(np.linspace(-ASPECT / 2, ASPECT / 2, 121), np.linspace(low, 0.5, 11))
    basis = Basis(mesh, ElementQuadBFS(), intorder=6)

    @BilinearForm
    def bent(u, v, _):
        (uxx, uxy), (_, uyy) = u.hess
        (vxx, vxy), (_, vyy) = v.hess
        twist = uxx * vyy + uyy * vxx - 2 * uxy * vxy
        return material.flexural * ((uxx + uyy) * (vxx + vyy) - (1 - ratio) * twist)

    @BilinearForm
    def load(u, v, w):
        return 2 * (1 + material.poisson) * smooth(w.x[1]) * u.grad[0] * v.grad[0]

    clamped = basis.get_dofs(lambda x: np.isclose(x[1], low))
    free = basis.complement_dofs(np.concatenate([clamped.all(name) for name in ("u", "u_x", "u_y", "u_xy")]))
    values, ways = eigsh(load.assemble(basis)[free][:, free], 6, bent.assemble(basis)[free][:, free])
    edge, whole = np.isclose(mesh.p[1], 0.5), np.zeros((basis.N, 6))
    whole[free] = ways
    found = [
        (1 / v, waves_of(mesh.p[0][edge], w[basis.nodal_dofs[0]][edge])[0])
        for v, w in zip(values, whole.T, strict=True)
    ]
    return np.array(sorted(found))


def sheets_modes(border, vertices):
    """Return the same of the sheet, by its second derivative where it is flat."""
    engine = Engine(grown_strip(border).params, vertices, 1e-7)
    given, start, material = engine.params, engine.state, Material(THICKNESS)
    flat = {"where": {"kind": "everywhere"}, "axes": ("z",)}
    more = {"attached": [flat, *(a.model_dump() for a in given.attached)], "imperfection": 0, "step": 0.05}
    engine = Engine(GrowthParams.parse(given.model_dump() | more), vertices, 1e-8)
    free = np.flatnonzero(~start.held[:, 2])
    grown, matrices = [], []
    for k in (1, 2):
        state = replace(engine.reach(k * 0.05, Context()), held=start.held, loose=start.loose)
        whole = StepEnergy(state, material, 0.0, (), Tangent(state.mesh)).hessian(state.x).tocsr()
        matrices.append(csc_array(whole[3 * free + 2][:, 3 * free + 2]))
        grown.append(state.time * np.log(STRETCH))
    load = (matrices[0] - matrices[1]) / (grown[1] - grown[0])
    values, ways = eigsh(load, 6, matrices[0] + grown[0] * load)
    x, z = state.x, np.zeros((len(state.x), 6))
    z[free] = ways
    edge = np.isclose(x[:, 1], 0.5, atol=0.02)
    found = [(1 / v, waves_of(x[edge, 0], w[edge])[0]) for v, w in zip(values, z.T, strict=True)]
    return np.array(sorted(found))


@pytest.mark.parametrize("border", [0.0, 0.15])
def test_the_sheet_s_own_ripples_are_those_of_a_plate(border):
    """Measured, thresholds and wave numbers over the plate's: .991 and 1.000, .983 and .995 at 3000 vertices, 1.005 and
    1.016, .993 and 1.005 at 6000, 1.001 and 1.000, .999 and 1.000 at 12000.
    """
    found = sheets_modes(border, 3000)
    expected = plates_modes(border, Material(THICKNESS))
    threshold, wave = found[2:4].mean(axis=0) / expected[2:4].mean(axis=0)
    assert threshold == pytest.approx(1.0, abs=0.03)
    assert wave == pytest.approx(1.0, abs=0.03)
    # what the next waves cost: a strip that has ten of them may well show eleven
    assert expected[4, 0] / expected[2, 0] < 1.03


def test_bending_by_mean_curvature_does_not_hold_short_ripples():
    material = Material(THICKNESS)
    assert threshold(20.0, 0.0, material, 1.0) < 1e-4 * threshold(20.0, 0.0, material)
    assert threshold(4.0, 0.0, material, 1.0) < 0.2 * threshold(4.0, 0.0, material)
