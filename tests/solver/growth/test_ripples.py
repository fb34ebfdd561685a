"""Ripples of a strip that grows along its edge, against the linear stability of a plate.

A strip held along one long side and at both ends grows in x by e(y): while it is flat, the resultant is
N(y) = -Y t e(y) along x alone. Von Karman's plate buckles in w = f(y) cos(k x) where

    D / 2 [(f'' - k^2 f)^2 + 2 (1 - nu_b) k^2 (f f'' + f'^2)] - Y t e k^2 f^2 / 2

summed over the width falls below 0 (Timoshenko and Gere 1961, section 8.1; for growing edges Audoly and Boudaoud 2003,
Liang and Mahadevan 2009). nu_b: Poisson's ratio in bending, -1/3 of hinges.
With 1, as the mean curvature alone has it, the threshold falls towards 0 for short waves: the mesh sets their length.
"""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar

from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
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


def grown_strip(border):
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
    }
    return Engine(GrowthParams.parse(values), 6000, 1e-7)


def edge_of(state):
    """Return the main wave number of the free edge, away from the ends, and how far it moves."""
    edge = state.x[np.isclose(state.x[:, 1], 0.5, atol=0.02)]
    x, z = edge[np.argsort(edge[:, 0])][:, [0, 2]].T
    at = np.linspace(-3.0, 3.0, 600)
    z = np.interp(at, x, z)
    # zero padding, finer than one wave over the length
    spectrum = np.abs(np.fft.rfft(np.hanning(600) * (z - z.mean()), 16 * 600))
    return 2 * np.pi * np.fft.rfftfreq(16 * 600, at[1] - at[0])[spectrum.argmax()], np.ptp(z)


@pytest.mark.slow
@pytest.mark.parametrize("border", [0.0, 0.15])
def test_ripples_of_a_growing_edge_come_when_a_plates_do_and_are_as_long(border):
    """Measured: k 4.18 for 4.04 (border 0) and 5.42 for 5.58; onset at 1.01 and 0.91 of the plate's.

    To 1e-6 the sheet lagged behind growth, its onset said 1.16 and 1.00; from 1e-7 to 1e-8 nothing changes at border
    0.15. A step is 0.05 of the threshold, and so finely is the onset known. Without a border it hangs on what the sheet
    starts from, .85, 1.01 and 1.16 at imperfections .02, .004 and .001, with one it does not.
    """
    engine = grown_strip(border)
    state, material = engine.state, Material(THICKNESS)
    low = state.x[state.held[:, 2], 1].max()
    expected = minimize_scalar(lambda k: threshold(k, low, material), bounds=(1.0, 25.0), method="bounded").x
    least = threshold(expected, low, material)
    onset, found = np.inf, 0.0
    while engine.state.time * np.log(STRETCH) < 1.3 * least:
        engine.advance(1e9, until=engine.state.time + STEP)
        found, height = edge_of(engine.state)
        if height > 0.1 * THICKNESS:
            onset = min(onset, engine.state.time * np.log(STRETCH))
    assert found == pytest.approx(expected, rel=0.05)
    assert 0.9 < onset / least < 1.2


def test_bending_by_mean_curvature_does_not_hold_short_ripples():
    material = Material(THICKNESS)
    assert threshold(20.0, 0.0, material, 1.0) < 1e-4 * threshold(20.0, 0.0, material)
    assert threshold(4.0, 0.0, material, 1.0) < 0.2 * threshold(4.0, 0.0, material)
