"""Where the tangent of an axisymmetric state turns singular, one azimuthal wavenumber at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs

from ...arrays import Bools, Floats
from ...contract import NotConverged
from ...linalg.banded import Pattern, pattern
from .base import BaseState, Meridian
from .meridional_elements import deformation, moduli, stress_moduli, tangents, volume_rates

__all__ = ["Critical", "Pencil", "Perturbations", "Tangent", "UnstableStart"]

Terms = tuple[Floats, Floats, Floats]


class UnstableStart(Exception):
    """The state that a search starts from is already unstable for some wavenumber."""


@dataclass(frozen=True, eq=False)
class Critical:
    """A mode: where it starts, and the height of its buckles (columns,) along the outward normal, largest one 1.

    vanishes: whether its own energy does so there; a turn of the whole fruit about a small held centre has hardly any
    and keeps it, so that what is left of rounding may look like a start.
    """

    s: float
    profile: Floats
    vanishes: bool = True


@dataclass(frozen=True, eq=False)
class Tangent:
    """Tangent of a state as entries of 1, m and m^2. whole: with pressures as unknowns. condensed: without them."""

    whole: Terms
    condensed: Terms


class Perturbations:
    """Unknowns (P, Q, c) of all nodes off the stone, then the pressures, and the tangents of smooth states on them.

    With the pressures kept the tangent varies slowly with s even where volumes hardly change, so that it can be
    interpolated; without them it is positive definite while the state is stable, so that it can be factored.

    turns: whether turns of the whole fruit are taken for modes where they look like some.
    """

    def __init__(self, meridian: Meridian, turns: bool = False) -> None:
        self.meridian, self.turns = meridian, turns
        mesh = meridian.mesh
        free = np.ones((len(mesh.position), 3), dtype=bool)
        free[:: mesh.levels] = False
        number = np.where(free.ravel(), np.cumsum(free.ravel()) - 1, -1).reshape(-1, 3)
        moved = number[mesh.nodes].reshape(len(mesh.nodes), 27)
        self.size = int(free.sum())
        pressures = self.size + np.arange(3 * len(mesh.nodes)).reshape(-1, 3)
        self.condensed: Pattern = pattern(moved, self.size)
        self.whole: Pattern = pattern(np.concatenate([moved, pressures], axis=1), self.size + pressures.size)
        self._surface = number[mesh.levels - 1 :: mesh.levels]
        self._axis = number[(mesh.position[:, 0] == 0.0) & free[:, 0]]
        outer = mesh.position[mesh.levels - 1 :: mesh.levels]
        along = np.gradient(outer, mesh.colatitude, axis=0, edge_order=2)
        normal = np.stack([-along[:, 1], along[:, 0]], axis=-1)
        self._normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def held(self, m: int) -> Bools:
        """Return which unknowns vanish on the axis for wavenumber `m`, (size of whole,)."""
        held = np.zeros(self.whole.size, dtype=bool)
        for component, carried in enumerate((m + 1, m - 1, m)):
            held[self._axis[:, component]] = carried != 0
        return held

    def exact(self, state: BaseState) -> Tangent:
        """Return the tangent at a smooth state."""
        mesh, inverse = self.meridian.mesh, self.meridian.compliance(state.s)
        f = deformation(mesh, state.moved)
        k0, k1, k2 = tangents(mesh, moduli(mesh, f, state.pressures @ mesh.pressure.T, state.s))
        b0, b1 = volume_rates(mesh, f)
        none = np.zeros_like(b0)
        mass = np.asarray(np.linalg.inv(inverse), dtype=float)
        whole = (_saddle(k0, b0, -mass), _saddle(k1, b1, 0 * mass), _saddle(k2, none, 0 * mass))
        half = b0.swapaxes(1, 2) @ inverse @ b1
        k0 += b0.swapaxes(1, 2) @ inverse @ b0
        k1 += half + half.swapaxes(1, 2)
        k2 += b1.swapaxes(1, 2) @ inverse @ b1
        return Tangent(
            tuple(self.whole.assemble(k) for k in whole),  # type: ignore[arg-type]
            tuple(self.condensed.assemble(k) for k in (k0, k1, k2)),  # type: ignore[arg-type]
        )

    def geometric(self) -> Tangent:
        """Return the geometric stiffness of the stress per unit shrinkage at the fresh shape (Eq. 11)."""
        mesh, small = self.meridian.mesh, 1e-5
        ahead, back = self.meridian.at(small), self.meridian.at(-small)
        rate = (deformation(mesh, ahead.moved) - deformation(mesh, back.moved)) / (2 * small)
        p = (ahead.pressures - back.pressures) @ mesh.pressure.T / (2 * small)
        strain = (rate + rate.swapaxes(-1, -2)) / 2
        mean = np.trace(strain, axis1=-2, axis2=-1) / 3
        one = np.eye(3)
        stress = 2 * mesh.shear[:, None, None, None] * (strain - mean[..., None, None] * one) + p[..., None, None] * one
        parts = tangents(mesh, stress_moduli(mesh, stress))
        none = np.zeros((len(mesh.nodes), 3, 27))
        empty = np.zeros((len(mesh.nodes), 3, 3))
        return Tangent(
            tuple(self.whole.assemble(_saddle(k, none, empty)) for k in parts),  # type: ignore[arg-type]
            tuple(self.condensed.assemble(k) for k in parts),  # type: ignore[arg-type]
        )

    def profile(self, vector: Floats) -> Floats:
        """Return the height of a mode over the surface's columns, largest one 1."""
        p, q, c = vector[self._surface].T
        height = self._normal[:, 0] * (p + q) / np.sqrt(2) + self._normal[:, 1] * c
        found: Floats = height / height[np.argmax(np.abs(height))]
        return found


def _saddle(stiff: Floats, rate: Floats, mass: Floats) -> Floats:
    out = np.empty((len(stiff), 30, 30))
    out[:, :27, :27], out[:, 27:, 27:] = stiff, mass
    out[:, 27:, :27], out[:, :27, 27:] = rate, rate.swapaxes(1, 2)
    return out


@dataclass(frozen=True, eq=False)
class Pencil:
    """K(s) by interpolation between tangents at increasing shrinkages `at`; the first state must be stable.

    compliance: (ne, 3, 3) at the first state.
    """

    space: Perturbations
    at: tuple[float, ...]
    terms: tuple[Terms, ...]
    condensed: Terms
    compliance: Floats

    @classmethod
    def exact(cls, space: Perturbations, states: Sequence[BaseState]) -> Pencil:
        """Return the tangents at the smooth `states` (in increasing s)."""
        all_of_them = [space.exact(state) for state in states]
        first = states[0].s
        return cls(
            space,
            tuple(state.s for state in states),
            tuple(tangent.whole for tangent in all_of_them),
            all_of_them[0].condensed,
            space.meridian.compliance(first),
        )

    @classmethod
    def linear(cls, space: Perturbations, lower: float = 0.0) -> Pencil:
        """Return the paper's eigenproblem, K(s) = K(0) + s K_geometric, looked at from s = `lower`."""
        fresh, rate = space.exact(space.meridian.fresh()), space.geometric()

        def at(s: float, first: Terms, second: Terms) -> Terms:
            return tuple(a + s * b for a, b in zip(first, second, strict=True))  # type: ignore[return-value]

        ends = (lower, lower + 1.0)
        terms = tuple(at(s, fresh.whole, rate.whole) for s in ends)
        condensed = at(lower, fresh.condensed, rate.condensed)
        return cls(space, ends, terms, condensed, space.meridian.compliance(0.0))

    def critical(self, m: int, count: int = 2) -> list[Critical]:
        """Return the first modes of wavenumber `m`, at most `count`, first one first; s is infinite if none comes.

        Raises:
            UnstableStart: the first state is not stable.
            NotConverged: the eigenvalues were not found.

        """
        space, held = self.space, self.space.held(m)
        factor = space.condensed.factor(space.condensed.hold(_at(self.condensed, m), held[: space.size], 1.0))
        if factor is None:
            raise UnstableStart(f"m = {m}")
        matrices = [space.whole.matrix(space.whole.hold(_at(terms, m), held, 0.0)) for terms in self.terms]
        fall = (matrices[0] - matrices[-1]) / (self.at[-1] - self.at[0])
        rate = matrices[0][space.size :, : space.size]

        def step(right: Floats) -> Floats:
            load = fall @ right.ravel()
            force, gain = load[: space.size], load[space.size :]
            gain = np.einsum("eab,eb->ea", self.compliance, gain.reshape(-1, 3)).ravel()
            moved = factor.solve(np.where(held[: space.size], 0.0, force + rate.T @ gain))
            shift = np.einsum("eab,eb->ea", self.compliance, (rate @ moved).reshape(-1, 3)).ravel()
            return np.concatenate([moved, shift - gain])

        start = np.random.default_rng(m).normal(size=len(held)) * ~held
        shape = (len(held), len(held))
        operator = LinearOperator(shape, matvec=step, dtype=float)
        try:
            values, vectors = eigs(operator, k=count, which="LR", v0=step(start), ncv=24, tol=1e-7, maxiter=40)
        except ArpackNoConvergence as error:
            values, vectors = error.eigenvalues, error.eigenvectors  # type: ignore[assignment]
            if not len(values):
                raise NotConverged(f"the modes of wavenumber {m} were not found.", advice="Try quality fine.") from None
        found = [
            (vector.real, *self._root(vector.real, matrices, self.at[0] + 1 / value.real))
            for value, vector in zip(values, vectors.T, strict=True)
            if value.real > 1e-3 and abs(value.imag) < 1e-6 * value.real
        ]
        modes = [
            Critical(s, space.profile(vector), vanishes)
            for vector, s, vanishes in found
            if vanishes or m > 1 or space.turns
        ]
        none = [Critical(np.inf, np.zeros(len(space.meridian.mesh.colatitude)))]
        return sorted(modes, key=lambda mode: mode.s) or none

    def _root(self, vector: Floats, matrices: Sequence[sparse.csr_array], near: float) -> tuple[float, bool]:
        """Return where the mode's own energy vanishes, off by the mode's square; `near` and False where it does not."""
        if len(matrices) == 2:
            return near, True
        energies = [float(vector @ (matrix @ vector)) for matrix in matrices]
        roots = np.roots(np.polyfit(np.array(self.at) - self.at[1], energies, len(self.at) - 1)) + self.at[1]
        real = roots[np.isreal(roots)].real
        real = real[real > self.at[0]]
        return (float(real[np.argmin(np.abs(real - near))]), True) if len(real) else (near, False)


def _at(terms: Terms, m: int) -> Floats:
    return terms[0] + m * terms[1] + m * m * terms[2]
