"""Concentric spheres in one dimension: the smooth state and the tangent on spherical harmonics of degree l.

High-order elements along the radius R. Energy per fresh volume, with Jd = theta^3 in the core and 1 in the skin:

    Psi = mu Jd / 2 (J^(-2/3) I1(F) - 3) + p (J - Jd) - Jd p^2 / (2 kappa)

(Liu et al. 2014, Eq. 1-4; `solver.material`; the last term vanishes for incompressible layers). The smooth state is
r(R), with stretches lr = dr/dR and lt = r/R. A perturbation u = U(R) Y e_r + V(R) grad Y / k, with k^2 = l (l + 1),
decouples by degree; averaged over the sphere its second variation is a form in the four numbers
e = (U', U/R, V', V/R).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import qr

from ...arrays import Bools, Floats, Ints
from ...contract import NotConverged
from ...fem import gauss, lobatto, segment
from ..fresh.closed_form import flat_film_wavelength, sphere_radius

__all__ = ["RadialMesh", "RadialState", "linear_tangents", "radial_mesh", "smooth", "tangent"]


#: Core layer at the interface in flat-film wavelengths, and how fast layers grow inwards.
_FIRST, _GROWTH = 0.2, 2.0
_NEWTON_STEPS = 30


@dataclass(frozen=True, eq=False)
class RadialMesh:
    """Elements of degree k (displacement) and k - 1 (discontinuous pressure) between stone and surface.

    breaks: (ne + 1,) element boundaries [r1]. at: (ne, k+1) node numbers. position: (nodes,). radius, weight: (ne, nq)
    quadrature, weights with R^2. strain: (ne, nq, 4, 2k+2) nodal (U, V) to e. pressure: (nq, k). core: (ne,).
    shear: (ne, 1) shear modulus over the core's.
    """

    stone: float
    breaks: Floats
    at: Ints
    position: Floats
    radius: Floats
    weight: Floats
    strain: Floats
    pressure: Floats
    core: Bools
    shear: Floats

    def shrunk(self, s: float) -> Floats:
        """Return Jd (ne, 1) at shrinkage `s`."""
        return np.where(self.core, (1 - s) ** 3, 1.0)[:, None]


def radial_mesh(stone: float, thickness: float, gamma: float, order: int = 8) -> RadialMesh:
    """Return the mesh of a fruit with stone radius `stone` and skin `thickness`, in units of the interface radius."""
    first = _FIRST * min(flat_film_wavelength(thickness, gamma), 1.0)
    edges = [1.0]
    while edges[-1] - 1.3 * first > stone:
        edges.append(edges[-1] - first)
        first *= _GROWTH
    breaks = np.array([stone, *edges[::-1], 1 + thickness / 2, 1 + thickness])
    k, count = order, len(breaks) - 1
    points, w = gauss(k + 2)
    x = points[:, 0]
    shape, slope = segment(k, x)
    middle, half = (breaks[1:, None] + breaks[:-1, None]) / 2, (breaks[1:, None] - breaks[:-1, None]) / 2
    radius = middle + half * x
    strain = np.zeros((count, k + 2, 4, 2 * (k + 1)))
    strain[:, :, 0, : k + 1] = strain[:, :, 2, k + 1 :] = slope / half[..., None]
    strain[:, :, 1, : k + 1] = strain[:, :, 3, k + 1 :] = shape / radius[..., None]
    at = np.arange(count)[:, None] * k + np.arange(k + 1)
    position = np.empty(count * k + 1)
    position[at] = middle + half * lobatto(k)
    core = np.arange(count) < count - 2
    pressure: Floats = np.asarray(legendre.legvander(x, k - 1), dtype=float)
    shear = np.where(core, 1.0, gamma)[:, None]
    return RadialMesh(stone, breaks, at, position, radius, w * half * radius**2, strain, pressure, core, shear)


@dataclass(frozen=True, eq=False)
class RadialState:
    """The smooth state at shrinkage `s`: radii (nodes,) and pressures (ne, k), with stretches and p at quadrature."""

    s: float
    radii: Floats
    pressures: Floats
    lr: Floats
    lt: Floats
    p: Floats


def _state(mesh: RadialMesh, s: float, radii: Floats, pressures: Floats) -> RadialState:
    k = mesh.at.shape[1]
    lr, lt = np.einsum("eqij,ej->ieq", mesh.strain[:, :, :2, :k], radii[mesh.at])
    return RadialState(s, radii, pressures, lr, lt, pressures @ mesh.pressure.T)


def smooth(mesh: RadialMesh, s: float, kappa_ratio: float | None, guess: RadialState | None = None) -> RadialState:
    """Return the smooth state at shrinkage `s` by Newton on radii and pressures, from the closed form or `guess`.

    Raises:
        NotConverged: when Newton's iteration does not settle.

    """
    nodes, (count, k) = len(mesh.position), mesh.at.shape
    if guess is None:
        start = sphere_radius(mesh.position, 1 - s, mesh.stone)
        state = _state(mesh, s, start, np.zeros((count, k - 1)))
    else:
        state = _state(mesh, s, guess.radii, guess.pressures)
    jd, free = mesh.shrunk(s), slice(1, None)
    bulk = 0.0 if kappa_ratio is None else 1 / kappa_ratio
    rows = nodes + np.arange(count * (k - 1)).reshape(count, k - 1)
    mass = np.einsum("eq,qa,qb->eab", mesh.weight * jd / mesh.shear, mesh.pressure, mesh.pressure) * bulk
    for _ in range(_NEWTON_STEPS):
        lr, lt, p = state.lr, state.lt, state.p
        j, i1 = lr * lt**2, lr**2 + 2 * lt**2
        m = mesh.shear * jd * j ** (-2 / 3)
        pr = m * (lr - i1 / (3 * lr)) + p * j / lr
        pt = m * (lt - i1 / (3 * lt)) + p * j / lt
        stress = np.stack([pr, 2 * pt], axis=-1) * mesh.weight[..., None]
        full = np.zeros((nodes + rows.size,) * 2)
        force = np.zeros(nodes + rows.size)
        np.add.at(force, mesh.at, np.einsum("eqij,eqi->ej", mesh.strain[:, :, :2, :k], stress))
        stiff, coupling = _matrices(mesh, state, 0, k)
        np.add.at(full, (mesh.at[:, :, None], mesh.at[:, None, :]), stiff)
        full[rows[:, :, None], mesh.at[:, None, :]] = coupling
        full[mesh.at[:, None, :], rows[:, :, None]] = coupling
        full[rows[:, :, None], rows[:, None, :]] = -mass
        force[rows] = np.einsum("eq,qa->ea", mesh.weight * (j - jd), mesh.pressure)
        force[rows] -= np.einsum("eab,eb->ea", mass, state.pressures)
        step = np.linalg.solve(full[free, free], -force[free])
        radii = state.radii.copy()
        radii[1:] += step[: nodes - 1]
        state = _state(mesh, s, radii, state.pressures + step[rows - 1])
        if not (np.isfinite(step).all() and state.lr.min() > 0 and state.lt.min() > 0):
            break
        if np.abs(step[: nodes - 1]).max() < 1e-11:
            return state
    raise NotConverged(
        f"the smooth sphere was not found at s = {s:g}.", advice="Use a stiffer volume: a larger kappa ratio."
    )


def _matrices(mesh: RadialMesh, state: RadialState, degree: int, size: int) -> tuple[Floats, Floats]:
    """Return element stiffness (ne, size, size) at fixed pressure, and coupling (ne, k, size) of p with volume."""
    lr, lt = state.lr, state.lt
    big, wave = float(degree * (degree + 1)), np.sqrt(degree * (degree + 1.0))
    one, zero = np.ones_like(lr), np.zeros_like(lr)
    trace = np.stack([1 / lr, 2 / lt, zero, -wave / lt], axis=-1)
    work = np.stack([lr, 2 * lt, zero, -wave * lt], axis=-1)
    square = np.zeros((*lr.shape, 4, 4))  # H:H
    for (i, j), value in {(0, 0): 1.0, (1, 1): big + 2, (2, 2): 1.0, (3, 3): big, (1, 3): -2 * wave}.items():
        square[..., i, j] = square[..., j, i] = value * one
    turn = np.zeros_like(square)  # tr(G G), G = H F^-1
    terms = {(0, 0): 1 / lr**2, (1, 1): 2 / lt**2, (3, 3): (big - 1) / lt**2, (1, 3): -wave / lt**2}
    for (i, j), term in (terms | {(1, 2): wave / (lr * lt), (2, 3): -1 / (lr * lt)}).items():
        turn[..., i, j] = turn[..., j, i] = term
    volume = lr * lt**2
    m = mesh.shear * mesh.shrunk(state.s) * volume ** (-2 / 3)
    i1 = lr**2 + 2 * lt**2
    twice = np.einsum("eqi,eqj->eqij", trace, trace)
    cross = np.einsum("eqi,eqj->eqij", trace, work)
    moduli = m[..., None, None] * (
        square - 2 / 3 * (cross + cross.swapaxes(-1, -2)) + (i1 / 9)[..., None, None] * (2 * twice + 3 * turn)
    )
    moduli += (state.p * volume)[..., None, None] * (twice - turn)
    strain = mesh.strain[..., :size]
    stiff = strain.swapaxes(-1, -2) @ (mesh.weight[..., None, None] * moduli) @ strain
    dilation = np.einsum("eqi,eqij->eqj", trace, strain) * (mesh.weight * volume)[..., None]
    return stiff.sum(axis=1), np.einsum("qa,eqj->eaj", mesh.pressure, dilation)


def tangent(mesh: RadialMesh, state: RadialState, degree: int, kappa_ratio: float | None) -> Floats:
    """Return the symmetric tangent (n, n) on perturbations of `degree` with the stone fixed.

    Compressible layers condense their pressure; incompressible ones leave the perturbations that keep every volume,
    in an orthonormal basis of those. The smooth state is stable for `degree` while the lowest eigenvalue is positive.
    """
    stiff, coupling = _matrices(mesh, state, degree, _size(mesh, degree))
    if kappa_ratio is not None:
        stiff = stiff + _bulk(mesh, coupling, mesh.shrunk(state.s), kappa_ratio)
        return _assemble(mesh, stiff)
    basis = _volume_preserving(mesh, coupling)
    return basis.T @ _assemble(mesh, stiff) @ basis


def linear_tangents(mesh: RadialMesh, degree: int, kappa_ratio: float | None) -> tuple[Floats, Floats]:
    """Return the fresh sphere's tangent and the geometric stiffness of the stress per unit shrinkage, both (n, n).

    Liu et al. 2014, Eq. 11: the fresh shape would buckle where (first + s second) turns singular.
    """
    count, k = mesh.at.shape
    fresh = _state(mesh, 0.0, mesh.position, np.zeros((count, k - 1)))
    along, across = _stress_rate(mesh, fresh, kappa_ratio)
    big, wave = float(degree * (degree + 1)), np.sqrt(degree * (degree + 1.0))
    moduli = np.zeros((*along.shape, 4, 4))
    moduli[..., 0, 0] = moduli[..., 2, 2] = along
    moduli[..., 1, 1], moduli[..., 3, 3] = (big + 2) * across, big * across
    moduli[..., 1, 3] = moduli[..., 3, 1] = -2 * wave * across
    strain = mesh.strain[..., : _size(mesh, degree)]
    elements = (strain.swapaxes(-1, -2) @ (mesh.weight[..., None, None] * moduli) @ strain).sum(axis=1)
    stiff, coupling = _matrices(mesh, fresh, degree, _size(mesh, degree))
    if kappa_ratio is not None:
        stiff = stiff + _bulk(mesh, coupling, mesh.shrunk(0.0), kappa_ratio)
        return _assemble(mesh, stiff), _assemble(mesh, elements)
    basis = _volume_preserving(mesh, coupling)
    return basis.T @ _assemble(mesh, stiff) @ basis, basis.T @ _assemble(mesh, elements) @ basis


def _stress_rate(mesh: RadialMesh, fresh: RadialState, kappa_ratio: float | None) -> tuple[Floats, Floats]:
    """Return radial and hoop stress (ne, nq) per unit shrinkage at the fresh sphere."""
    # central differences of the exact state: off by 1e-12, far below round-off of what follows
    small = 1e-6
    state = smooth(mesh, small, kappa_ratio)
    back = smooth(mesh, -small, kappa_ratio)
    lr, lt, p = ((getattr(state, name) - getattr(back, name)) / (2 * small) for name in ("lr", "lt", "p"))
    mean = (lr + 2 * lt) / 3
    return 2 * mesh.shear * (lr - mean) + p, 2 * mesh.shear * (lt - mean) + p


def _size(mesh: RadialMesh, degree: int) -> int:
    return int(mesh.at.shape[1] * (1 if degree == 0 else 2))


def _bulk(mesh: RadialMesh, coupling: Floats, jd: Floats, kappa_ratio: float) -> Floats:
    mass = np.einsum("eq,qa,qb->eab", mesh.weight * jd / mesh.shear, mesh.pressure, mesh.pressure)
    return kappa_ratio * coupling.swapaxes(1, 2) @ np.linalg.solve(mass, coupling)


def _places(mesh: RadialMesh, size: int) -> tuple[Ints, int]:
    fields = size // mesh.at.shape[1]
    return np.concatenate([mesh.at * fields + f for f in range(fields)], axis=1), fields


def _assemble(mesh: RadialMesh, elements: Floats) -> Floats:
    at, fields = _places(mesh, elements.shape[1])
    full = np.zeros((len(mesh.position) * fields,) * 2)
    np.add.at(full, (at[:, :, None], at[:, None, :]), elements)
    return full[fields:, fields:]


def _volume_preserving(mesh: RadialMesh, coupling: Floats) -> Floats:
    """Return an orthonormal basis (n, n - ne k) of the perturbations without any volume change."""
    count, k, size = coupling.shape
    at, fields = _places(mesh, size)
    rows = np.zeros((count * k, len(mesh.position) * fields))
    rows[np.arange(count * k).reshape(count, k)[:, :, None], at[:, None, :]] = coupling
    basis: Floats = np.asarray(qr(rows[:, fields:].T)[0], dtype=float)
    return basis[:, count * k :]
