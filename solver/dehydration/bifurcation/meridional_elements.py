"""Element forces and tangents of an axisymmetric state, for perturbations of any azimuthal wavenumber.

The energy is that of `radial_elements`. A perturbation (a cos m phi, c cos m phi, b sin m phi) along (r, y, phi) has
the gradient H = (T0 + m T1) e in the nine numbers e = (a_R, a_Y, a/R, b_R, b_Y, b/R, c_R, c_Y, c/R), so that the
tangent is a polynomial of second degree in m. The nodal unknowns are (P, Q, c) with P = (a + b) / sqrt 2 and
Q = (a - b) / sqrt 2, the parts of wavenumber m + 1 and m - 1 of the Cartesian displacement: a smooth field has P = 0 on
the axis always, Q = 0 unless m = 1, and c = 0 unless m = 0.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from .meridional_mesh import MeridionalMesh

__all__ = [
    "axisymmetric_tangent",
    "axisymmetric_volume_rate",
    "deformation",
    "forces",
    "moduli",
    "stress_moduli",
    "tangents",
    "volume_rates",
]


# H in the order rR rY rPhi yR yY yPhi phiR phiY phiPhi
_T0, _T1 = np.zeros((9, 9)), np.zeros((9, 9))
_T0[[0, 1, 3, 4, 6, 7, 8], [0, 1, 6, 7, 3, 4, 2]] = 1.0
_T0[2, 5] = -1.0
_T1[[2, 5, 8], [2, 8, 5]] = [-1.0, -1.0, 1.0]


def deformation(mesh: MeridionalMesh, moved: Floats) -> Floats:
    """Return F (ne, 9, 3, 3), rows (r, y, phi), columns (R, Y, Phi), of nodes moved to (nodes, 2)."""
    f = np.zeros((*mesh.weight.shape, 3, 3))
    f[..., :2, :2] = np.einsum("eqkn,eni->eqik", mesh.gradient[:, :, :2], moved[mesh.nodes])
    f[..., 2, 2] = np.einsum("eqn,en->eq", mesh.gradient[:, :, 2], moved[mesh.nodes][..., 0])
    return f


def _parts(mesh: MeridionalMesh, f: Floats, s: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return J, I1, the isochoric factor mu Jd J^(-2/3) (all (ne, 9)) and F^-T."""
    plane = f[..., 0, 0] * f[..., 1, 1] - f[..., 0, 1] * f[..., 1, 0]
    volume = plane * f[..., 2, 2]
    inverse = np.zeros_like(f)
    inverse[..., 0, 0], inverse[..., 1, 1] = f[..., 1, 1] / plane, f[..., 0, 0] / plane
    inverse[..., 0, 1], inverse[..., 1, 0] = -f[..., 1, 0] / plane, -f[..., 0, 1] / plane  # transposed already
    inverse[..., 2, 2] = 1 / f[..., 2, 2]
    factor = mesh.shear[:, None] * mesh.shrunk(s) * volume ** (-2 / 3)
    return volume, (f * f).sum(axis=(-1, -2)), factor, inverse


def forces(mesh: MeridionalMesh, f: Floats, p: Floats, s: float) -> tuple[Floats, Floats]:
    """Return element forces (ne, 9, 2) and the volume gained over its target, (ne, 3). `p`: (ne, 9) pressure."""
    volume, i1, factor, inverse = _parts(mesh, f, s)
    stress = factor[..., None, None] * (f - (i1 / 3)[..., None, None] * inverse)
    stress += (p * volume)[..., None, None] * inverse
    stress *= mesh.weight[..., None, None]
    force = np.einsum("eqik,eqkn->eni", stress[..., :2, :2], mesh.gradient[:, :, :2])
    force[..., 0] += np.einsum("eq,eqn->en", stress[..., 2, 2], mesh.gradient[:, :, 2])
    return force, (mesh.weight * (volume - mesh.shrunk(s))) @ mesh.pressure


def moduli(mesh: MeridionalMesh, f: Floats, p: Floats, s: float) -> Floats:
    """Return d2 Psi / dF2 (ne, 9, 9, 9) at fixed pressure, times the quadrature weight."""
    volume, i1, factor, inverse = _parts(mesh, f, s)
    shape = (*volume.shape, 9)
    g, h = inverse.reshape(shape), f.reshape(shape)
    twice = g[..., :, None] * g[..., None, :]
    turn = np.einsum("eqkj,eqil->eqijkl", inverse, inverse).reshape(*shape, 9)
    cross = g[..., :, None] * h[..., None, :]
    factor, bulk = factor * mesh.weight, p * volume * mesh.weight
    out: Floats = (factor * i1 * 2 / 9 + bulk)[..., None, None] * twice
    out += (factor * i1 / 3 - bulk)[..., None, None] * turn
    out -= (factor * 2 / 3)[..., None, None] * (cross + cross.swapaxes(-1, -2))
    out[..., np.arange(9), np.arange(9)] += factor[..., None]
    return out


def stress_moduli(mesh: MeridionalMesh, stress: Floats) -> Floats:
    """Return the geometric part H_iJ S_JK H_iK of `stress` (ne, 9, 3, 3), times the quadrature weight."""
    weighted = stress * mesh.weight[..., None, None]
    out = np.zeros((*mesh.weight.shape, 3, 3, 3, 3))
    for i in range(3):
        out[..., i, :, i, :] = weighted
    return out.reshape(*mesh.weight.shape, 9, 9)


def volume_rates(mesh: MeridionalMesh, f: Floats) -> tuple[Floats, Floats]:
    """Return (b0, b1), each (ne, 3, 27): b0 + m b1 maps nodal (P, Q, c) to the pressures' volume changes."""
    volume, _, _, inverse = _parts(mesh, f, 0.0)
    g = (inverse * (volume * mesh.weight)[..., None, None]).reshape(*volume.shape, 9)
    both = []
    for turn in (_T0, _T1):
        strain = (g @ turn).reshape(*volume.shape, 3, 3)
        rate = np.einsum("qa,eqfk,eqkn->eafn", mesh.pressure, strain, mesh.gradient, optimize=True)
        both.append(_circular(rate, axis=2).transpose(0, 1, 3, 2).reshape(len(rate), 3, 27))
    return both[0], both[1]


def tangents(mesh: MeridionalMesh, second: Floats) -> tuple[Floats, Floats, Floats]:
    """Return (K0, K1, K2), each (ne, 27, 27) on nodal (P, Q, c): the form `second` (ne, 9, 9, 9) at wavenumber m.

    It is K0 + m K1 + m^2 K2, averaged over azimuth, times two.
    """
    half = _T0.T @ second @ _T1
    return (
        _integrate(mesh, _T0.T @ second @ _T0),
        _integrate(mesh, half + half.swapaxes(-1, -2)),
        _integrate(mesh, _T1.T @ second @ _T1),
    )


def axisymmetric_tangent(mesh: MeridionalMesh, second: Floats) -> Floats:
    """Return the tangent (ne, 18, 18) of the form `second` on axisymmetric nodal displacements (a, c)."""
    form = _T0.T @ second @ _T0
    chosen = np.array([0, 1, 2, 6, 7, 8])
    blocks = _blocks(mesh, form[:, :, chosen[:, None], chosen])
    return blocks.transpose(0, 3, 1, 4, 2).reshape(len(blocks), 18, 18)


def axisymmetric_volume_rate(mesh: MeridionalMesh, f: Floats) -> Floats:
    """Return b (ne, 3, 18), which maps axisymmetric nodal displacements (a, c) to the pressures' volume changes."""
    volume, _, _, inverse = _parts(mesh, f, 0.0)
    g = inverse * (volume * mesh.weight)[..., None, None]
    rate = np.zeros((len(g), 3, 9, 2))
    rate[:] = np.einsum("qa,eqik,eqkn->eani", mesh.pressure, g[..., :2, :2], mesh.gradient[:, :, :2], optimize=True)
    rate[..., 0] += np.einsum("qa,eq,eqn->ean", mesh.pressure, g[..., 2, 2], mesh.gradient[:, :, 2], optimize=True)
    return rate.reshape(len(g), 3, 18)


def _integrate(mesh: MeridionalMesh, forms: Floats) -> Floats:
    out = _circular(_circular(_blocks(mesh, forms), axis=1), axis=2)
    return out.transpose(0, 3, 1, 4, 2).reshape(len(out), 27, 27)


def _blocks(mesh: MeridionalMesh, forms: Floats) -> Floats:
    """Return (ne, fields, fields, 9, 9): forms (ne, 9, 3 fields, 3 fields) integrated over shape derivatives."""
    count, fields = len(mesh.nodes), forms.shape[-1] // 3
    left = mesh.gradient.reshape(count, 27, 9).swapaxes(1, 2)
    out = np.zeros((count, fields, fields, 9, 9))
    for i in range(fields):
        for j in range(i, fields):
            part = forms[:, :, 3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
            if part.any():
                block = left @ (part @ mesh.gradient).reshape(count, 27, 9)
                out[:, i, j], out[:, j, i] = block, block.swapaxes(1, 2)
    return out


def _circular(values: Floats, axis: int) -> Floats:
    """Turn components (a, b, c) along `axis` into (P, Q, c)."""
    a, b, c = np.moveaxis(values, axis, 0)
    return np.stack([(a + b) / np.sqrt(2), (a - b) / np.sqrt(2), c], axis=axis)
