"""The neo-Hookean law: energy, first Piola-Kirchhoff stress and tangent, for every road of finite elements here.

All its variants are, per fresh volume, linear in I1 = |F|^2 with coefficients that depend on J = det F alone:

    W(F) = a(J) I1 + b(J).

With G = F^-T the derivatives that are needed are dI1/dF = 2 F, dJ/dF = J G and dG_ij / dF_kl = -G_il G_kj (from
differentiating F^T G = 1). So with s = a' I1 + b', the slope of W by J at a fixed I1, and t = a'' I1 + b'' its slope,

    P    = dW/dF   = 2 a F + s J G,
    A    = d2W/dF2 = 2 a 1 (x) 1 + 2 a' J (F (x) G + G (x) F) + (t J + s) J G (x) G - s J [G_il G_kj]_ijkl.

The variants, with Jd the volume that a material which has dried (or grown) freely has over its fresh one:

    isochoric     a = Jd mu/2 J^(-2/3),  b = -3/2 Jd mu + Jd kappa/2 (J/Jd - 1)^2       Liu et al. 2014, Eq. 1-4
    at_pressure   the same a,            b = -3/2 Jd mu + p (J - Jd)                    its mixed form, p held
    logarithmic   a = mu/2,              b = -3/2 mu - mu ln J + lambda/2 (ln J)^2      decay's flesh

(J^(-2/3) of F and of its elastic part F / theta differ by the factor that I1 differs by, so theta enters through Jd
alone.) Fresh, F = 1 with Jd = 1: W = 0, P = 0 and A is that of linear elasticity with shear modulus mu and bulk
modulus kappa, or lambda + 2/3 mu. The fused kernels (dehydration/kernel, dehydration/implicit, dehydration/bifurcation,
decay/body/material) are checked against this one to 1e-12.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats

__all__ = ["Law", "at_pressure", "isochoric", "logarithmic"]

#: Value, slope and curvature by J of a coefficient.
Coefficient = Callable[[Floats], tuple[Floats, Floats, Floats]]


@dataclass(frozen=True)
class Law:
    """W = a(J) I1 + b(J) per fresh volume, in the unit of the moduli; F (..., 3, 3) with J > 0 throughout."""

    a: Coefficient
    b: Coefficient

    def function(self, f: Floats) -> Floats:
        """Return the energy density W (...)."""
        j, i1 = np.linalg.det(f), np.sum(f * f, axis=(-1, -2))
        return np.asarray(self.a(j)[0] * i1 + self.b(j)[0])

    def gradient(self, f: Floats) -> Floats:
        """Return the first Piola-Kirchhoff stress P (..., 3, 3)."""
        j, g, a, s, _ = self._slopes(f)
        return np.asarray(2 * _on(a[0], 2) * f + _on(s * j, 2) * g)

    def hessian(self, f: Floats) -> Floats:
        """Return the tangent A_ijkl = dP_ij / dF_kl (..., 3, 3, 3, 3)."""
        j, g, a, s, t = self._slopes(f)
        one = np.eye(3)
        mixed = np.einsum("...ij,...kl->...ijkl", f, g)
        out = _on(2 * a[0], 4) * np.einsum("ik,jl->ijkl", one, one)
        out = out + _on(2 * a[1] * j, 4) * (mixed + np.einsum("...ij,...kl->...ijkl", g, f))
        out += _on((t * j + s) * j, 4) * np.einsum("...ij,...kl->...ijkl", g, g)
        out -= _on(s * j, 4) * np.einsum("...il,...kj->...ijkl", g, g)
        return np.asarray(out)

    def _slopes(self, f: Floats) -> tuple[Floats, Floats, tuple[Floats, Floats, Floats], Floats, Floats]:
        """Return J, F^-T, a with its derivatives, s and t of the head."""
        j, i1 = np.linalg.det(f), np.sum(f * f, axis=(-1, -2))
        a, b = self.a(j), self.b(j)
        g = np.linalg.inv(f).swapaxes(-1, -2).astype(np.float64, copy=False)
        return j, g, a, a[1] * i1 + b[1], a[2] * i1 + b[2]


def _on(scalar: Floats, axes: int) -> Floats:
    """Give a field of numbers so many axes more, to multiply tensors with."""
    return np.asarray(scalar)[(..., *[None] * axes)]


def _shear(mu: float, volume: float) -> Coefficient:
    def a(j: Floats) -> tuple[Floats, Floats, Floats]:
        value = volume * mu / 2 * j ** (-2 / 3)
        return value, -2 / 3 * value / j, 10 / 9 * value / j**2

    return a


def isochoric(mu: float, kappa: float, volume: float = 1.0) -> Law:
    """Return the nearly incompressible law; volume: Jd, theta^3 in a flesh that shrinks to theta."""

    def b(j: Floats) -> tuple[Floats, Floats, Floats]:
        strain = j / volume - 1
        value = -1.5 * volume * mu + volume * kappa / 2 * strain**2
        return value, kappa * strain, np.full_like(j, kappa / volume)

    return Law(_shear(mu, volume), b)


def at_pressure(mu: float, pressure: float, volume: float = 1.0) -> Law:
    """Return the law of the mixed form at a pressure that is held, positive in tension."""

    def b(j: Floats) -> tuple[Floats, Floats, Floats]:
        return -1.5 * volume * mu + pressure * (j - volume), np.full_like(j, pressure), np.zeros_like(j)

    return Law(_shear(mu, volume), b)


def logarithmic(mu: float, lame: float) -> Law:
    """Return the compressible law with Lame's first parameter."""

    def a(j: Floats) -> tuple[Floats, Floats, Floats]:
        return np.full_like(j, mu / 2), np.zeros_like(j), np.zeros_like(j)

    def b(j: Floats) -> tuple[Floats, Floats, Floats]:
        log = np.log(j)
        slope = (lame * log - mu) / j
        return -1.5 * mu - mu * log + lame / 2 * log**2, slope, (lame - lame * log + mu) / j**2

    return Law(a, b)
