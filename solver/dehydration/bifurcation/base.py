"""The smooth shape of an axisymmetric fruit before it buckles, by Newton's iteration in the meridional plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from ...arrays import Floats
from ...contract import Context, InvalidInput, NotConverged
from ...linalg.banded import Pattern, pattern
from ..params import DehydrationParams
from .meridional_elements import axisymmetric_tangent, axisymmetric_volume_rate, deformation, forces, moduli
from .meridional_mesh import PER_WAVELENGTH, MeridionalMesh, build

__all__ = ["BaseState", "Meridian", "base_state"]


#: Bulk over shear modulus that stands for incompressible; s_cr is off by about 2 / PENALTY, relative.
PENALTY = 1e6
#: Largest and smallest step in s of the march to a state, and what counts as converged [r1].
_STEP, _SMALLEST, _SETTLED = 0.08, 1e-4, 1e-9
_NEWTON_STEPS = 15
_CHUNK = 20000
#: A fruit without a stone gets one this small, held in its centre: columns of elements would meet in a point there. The
#: shape farther out changes by about its volume, 1e-5.
_CENTRE = 0.02


class Meridian:
    """Mesh, matrix pattern and compressibility of one fruit: what all its smooth states share."""

    def __init__(
        self, params: DehydrationParams, per_wavelength: float, kappa_ratio: float | None, split: int = 1
    ) -> None:
        self.params = params if params.has_stone else params.model_copy(update={"stone": (_CENTRE, _CENTRE)})
        self.mesh: MeridionalMesh = build(self.params, per_wavelength, split)
        self.bulk = PENALTY if kappa_ratio is None else kappa_ratio
        mesh = self.mesh
        free = np.ones((len(mesh.position), 2), dtype=bool)
        free[:: mesh.levels] = False
        free[mesh.position[:, 0] == 0.0, 0] = False
        number = np.where(free.ravel(), np.cumsum(free.ravel()) - 1, -1).reshape(-1, 2)
        self.free = free
        self.pattern: Pattern = pattern(number[mesh.nodes].reshape(len(mesh.nodes), 18), int(free.sum()))

    def compliance(self, s: float) -> Floats:
        """Return the inverse (ne, 3, 3) of the pressures' mass matrix over the bulk modulus."""
        mesh = self.mesh
        scale = mesh.weight * mesh.shrunk(s) / (self.bulk * mesh.shear[:, None])
        return np.linalg.inv(np.einsum("eq,qa,qb->eab", scale, mesh.pressure, mesh.pressure))

    def fresh(self) -> BaseState:
        """Return the stress-free state s = 0."""
        return BaseState(self, 0.0, self.mesh.position, np.zeros((len(self.mesh.nodes), 3)))

    def at(self, s: float, start: BaseState | None = None, context: Context | None = None) -> BaseState:
        """Return the smooth state at `s`, marched from `start` (the fresh one) in steps that shrink where needed.

        Raises:
            NotConverged: when even small steps do not converge; `last_stage` is the last s that did.

        """
        state = start or self.fresh()
        step = _STEP
        while state.s != s:
            if context is not None:
                context.check_cancelled()
            last = abs(s - state.s) <= step * 1.0001
            target = s if last else state.s + np.copysign(step, s - state.s)
            moved = self._newton(state, target)
            if moved is not None:
                state = moved
                continue
            step = min(step, abs(target - state.s)) / 2
            if step < _SMALLEST:
                raise NotConverged(
                    f"the smooth shape was not found beyond s = {state.s:g}.",
                    advice="Ask for less shrinkage, or a finer quality.",
                    last_stage=state.s,
                )
        return state

    def _newton(self, state: BaseState, s: float) -> BaseState | None:
        mesh, inverse = self.mesh, self.compliance(s)
        moved, pressures = state.moved, state.pressures
        for _ in range(_NEWTON_STEPS):
            f = deformation(mesh, moved)
            if np.linalg.det(f).min() <= 0.0:
                return None
            p = pressures @ mesh.pressure.T
            force, gain = forces(mesh, f, p, s)
            rate = axisymmetric_volume_rate(mesh, f)
            # pressures that follow from the volumes, linearised about the pressures at hand
            lack = np.einsum("eab,eb->ea", inverse, gain) - pressures
            matrix = axisymmetric_tangent(mesh, moduli(mesh, f, p, s)) + rate.swapaxes(1, 2) @ inverse @ rate
            load = force.reshape(-1, 18) + np.einsum("eai,ea->ei", rate, lack)
            found = self.pattern.solve(self.pattern.assemble(matrix), -self.pattern.vector(load))
            step = np.zeros_like(moved)
            step[self.free] = found
            moved = moved + step
            elements = step[mesh.nodes].reshape(-1, 18)
            pressures = pressures + lack + np.einsum("eab,ebi,ei->ea", inverse, rate, elements, optimize=True)
            size = float(np.abs(found).max())
            if not np.isfinite(size) or size > 1.0:
                return None
            if size < _SETTLED:
                return BaseState(self, s, moved, pressures)
        return None


@dataclass(frozen=True, eq=False)
class BaseState:
    """The smooth shape at shrinkage `s`: `moved` (nodes, 2) are its (r, y) [r1], `pressures` (ne, 3) by element.

    Call it with fresh points to learn where they go.
    """

    meridian: Meridian
    s: float
    moved: Floats
    pressures: Floats

    @cached_property
    def _spline(self) -> tuple[CubicSpline, CubicSpline]:
        mesh = self.meridian.mesh
        shift = (self.moved - mesh.position).reshape(len(mesh.colatitude), mesh.levels, 2)
        none = np.zeros(mesh.levels)
        # across the pole r is odd and y even
        odd: Any = ((2, none), (2, none))
        even: Any = ((1, none), (1, none))
        return (
            CubicSpline(mesh.colatitude, shift[..., 0], bc_type=odd),
            CubicSpline(mesh.colatitude, shift[..., 1], bc_type=even),
        )

    def __call__(self, points: Floats) -> Floats:
        """Return where fresh points (n, 3) [r1] of the fruit are in this state, (n, 3); inside the stone they stay."""
        points = np.asarray(points, dtype=float)
        parts = [self._move(points[i : i + _CHUNK]) for i in range(0, len(points), _CHUNK)]
        return np.concatenate(parts) if parts else points.copy()

    def _move(self, points: Floats) -> Floats:
        mesh, params = self.meridian.mesh, self.meridian.params
        radius = np.hypot(points[:, 0], points[:, 2])
        distance = np.hypot(radius, points[:, 1])
        safe = np.where(distance > 0, distance, 1.0)
        rays = points / safe[:, None]
        rays[distance == 0] = [0.0, 1.0, 0.0]
        colatitude = _parametric(params, np.arctan2(radius, points[:, 1]))
        interface = np.hypot(*params.generatrix(colatitude))
        stone = params.stone_distance(rays)
        inner = np.clip((distance - stone) / (interface - stone), 0.0, 1.0)
        depth = inner + np.clip((distance - interface) / params.exocarp_thickness, 0.0, 1.0)
        element = np.clip(np.searchsorted(mesh.depth[::2], depth, side="right") - 1, 0, mesh.levels // 2 - 1)
        lower, upper = mesh.depth[2 * element], mesh.depth[2 * element + 2]
        x = 2 * (depth - lower) / (upper - lower) - 1
        weights = np.stack([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2], axis=-1)
        rows = np.arange(len(points))[:, None]
        at = 2 * element[:, None] + np.arange(3)
        outwards, along = ((weights * spline(colatitude)[rows, at]).sum(axis=1) for spline in self._spline)
        on_axis = radius == 0
        stretch = outwards / np.where(on_axis, 1.0, radius)
        shift = np.stack([points[:, 0] * stretch, along, points[:, 2] * stretch], axis=-1)
        found: Floats = points + shift
        return found


def _parametric(params: DehydrationParams, polar: Floats) -> Floats:
    """Return the parametric colatitude whose ray has the polar angle `polar` [radian], both (n,)."""
    fine = np.linspace(0, np.pi, 2001)

    def angle(at: Floats) -> Floats:
        x, y = params.generatrix(at)
        return np.arctan2(np.maximum(x, 0.0), y)

    found = np.interp(polar, angle(fine), fine)
    for _ in range(3):
        inside = np.clip(found, 1e-6, np.pi - 1e-6)
        slope = (angle(inside + 1e-6) - angle(inside - 1e-6)) / 2e-6
        found = np.clip(found - (angle(found) - polar) / slope, 0.0, np.pi)
    return found


def base_state(
    params: DehydrationParams,
    s: float,
    *,
    kappa_ratio: float | None = None,
    quality: str = "default",
    per_wavelength: float | None = None,
    context: Context | None = None,
) -> BaseState:
    """Return the smooth, axisymmetric state at shrinkage `s`; s < 0 is swelling.

    It is an equilibrium whether or not it is stable: beyond the onset the real fruit leaves it. `per_wavelength`
    overrides the elements per flat-film wavelength that `quality` stands for. Displacements converge with third order.

    Raises:
        InvalidInput: the fruit's equator is not a circle, or its flesh does not shrink evenly.
        NotConverged: no equilibrium was found.

    """
    if not params.dries_evenly:
        raise InvalidInput(
            "the smooth shape in the meridional plane needs flesh that shrinks evenly.",
            advice="Leave out wetness, anisotropy and light.",
        )
    if not params.is_axisymmetric:
        raise InvalidInput(
            "the smooth shape in the meridional plane needs a circular equator.", advice="Set r8 equal to r4."
        )
    meridian = Meridian(params, per_wavelength or PER_WAVELENGTH[quality], kappa_ratio)
    return meridian.at(s, context=context)
