"""The shrunk sphere at finite bulk modulus: the radial equilibrium equation in strong form, Chebyshev collocation.

Shares nothing with the elements: no energy, no weak form, no mesh. Spectral, so its own error is at rounding level.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator

Floats = NDArray[np.float64]

#: Increments from the fresh shape.
_LED = 8


def _chebyshev(count: int, low: float, high: float) -> tuple[Floats, Floats]:
    """Points on [low, high], ascending, and the differentiation matrix (Trefethen 2000, chapter 6)."""
    x = -np.cos(np.pi * np.arange(count) / (count - 1))
    c = np.where((np.arange(count) == 0) | (np.arange(count) == count - 1), 2.0, 1.0) * (-1.0) ** np.arange(count)
    gap = x[:, None] - x[None, :] + np.eye(count)
    d = np.outer(c, 1 / c) / gap
    d -= np.diag(d.sum(axis=1))
    return low + (x + 1) / 2 * (high - low), d * 2 / (high - low)


def radial_reference(
    theta: float, stone: float, thickness: float, gamma: float, kappa_ratio: float, count: int = 24
) -> Callable[[Floats], Floats]:
    """Return r(R) of a core of radius 1 with mu = 1 and Fd = theta I in a skin of `thickness` and mu = gamma."""
    core, skin = _chebyshev(count, stone, 1.0), _chebyshev(count, 1.0, 1.0 + thickness)
    layers = [(*core, theta, 1.0), (*skin, 1.0, gamma)]

    def stresses(radius: Floats, layer: tuple[Floats, Floats, float, float]) -> tuple[Floats, Floats]:
        fresh, derivative, t, mu = layer
        a, b = derivative @ radius, radius / fresh
        ratio = a * b**2 / t**3
        shear = mu * t**3 * ratio ** (-2 / 3) / t**2
        invariant, p = a**2 + 2 * b**2, kappa_ratio * mu * (ratio - 1)
        return shear * (a - invariant / (3 * a)) + p * b**2, shear * (b - invariant / (3 * b)) + p * a * b

    def residual(unknown: Floats) -> Floats:
        parts = unknown.reshape(2, count)
        rows, radial = [], []
        for radius, layer in zip(parts, layers, strict=True):
            pr, pt = stresses(radius, layer)
            rows.append((layer[1] @ pr + 2 * (pr - pt) / layer[0])[1:-1])
            radial.append(pr)
        ends = [parts[0, 0] - stone, parts[0, -1] - parts[1, 0], radial[0][-1] - radial[1][0], radial[1][-1]]
        return np.concatenate([*rows, ends])

    unknown = np.concatenate([core[0], skin[0]])
    # a stiff skin stays far from the incompressible shape: it is led there from the fresh one
    for led in np.linspace(1.0, theta, _LED + 1)[1:]:
        layers[0] = (*core, led, 1.0)
        last = np.inf
        for _ in range(60):
            jacobian = np.stack([residual(unknown + 1e-30j * e).imag / 1e-30 for e in np.eye(2 * count)], axis=1)
            step = np.linalg.solve(jacobian, residual(unknown))
            unknown, size = unknown - step, float(np.abs(step).max())
            if size < 1e-13 or (size < 1e-10 and size > last / 2):
                break
            last = size
        else:
            raise RuntimeError("the radial reference did not converge")
    within, outside = (
        BarycentricInterpolator(layer[0], r) for layer, r in zip(layers, unknown.reshape(2, -1), strict=True)
    )

    def radius_at(fresh: Floats) -> Floats:
        at = np.asarray(fresh, dtype=float)
        inside = at <= 1 + 1e-12
        result = np.empty_like(at)
        result[inside], result[~inside] = within(at[inside]), outside(at[~inside])
        return result

    return radius_at
