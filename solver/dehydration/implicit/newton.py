"""Newton's method for the equilibrium of a loaded mesh: mixed Newton steps, backtracking, adaptive increments."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...arrays import Bools, Floats
from ...contract import Context, InvalidInput, NotConverged
from ...fem import HEX27
from ...linalg.multifrontal import Analysis, Factor, analyse, factorise
from ..params import DehydrationParams
from .assembly import Assembled, Pattern, assemble, build_pattern
from .hexahedron import POINTS, PRESSURE
from .mesh import QuadraticMesh

__all__ = ["Equilibrium", "Loading", "Model", "build_model", "equilibrium", "masked"]

#: (fresh points (n, 3), shrinkage s) -> diagonal of Fd in the core, (n, 3); any shape that broadcasts to it.
Loading = Callable[[Floats, float], Any]

MOST_STEPS = 14
"""Newton steps of one increment before it is cut; a quadratic one takes 3 to 5."""
LEAST_INCREMENT = 1e-4
"""Shrinkage below which an increment is not cut further."""
CRUSHED = 0.1
"""Least Je of an acceptable trial state."""
ROUND_OFF = 1e-13
"""Relative residual per kappa/mu that rounding of J alone leaves; no tolerance below it is tried for."""
REUSE_BELOW = 1e-5
"""Residual below which the last factor still serves, as long as each step gains a digit."""
SMALL_LAG = 0.02
"""Volume strain up to which the linearisation may miss without the step being shortened."""
SHORTEST = 0.05
"""Shortest part of a Newton step that is tried."""


def uniform(points: Floats, shrinkage: float) -> Floats:
    """Fd = (1 - s) I everywhere (the paper's homogeneous drying)."""
    return np.full((len(points), 3), 1.0 - shrinkage)


@dataclass(frozen=True, eq=False)
class Model:
    """A mesh with materials, supports and the symbolic half of its factorisation.

    free: (nodes off the stone, 3) components that may move; those of a patch's edge stay where a start puts them.
    gauss: (ne, 27, 3) fresh Gauss points.
    """

    mesh: QuadraticMesh
    mu: Floats
    kappa: Floats
    loading: Loading
    pattern: Pattern
    analysis: Analysis
    free: Bools
    gauss: Floats

    def stretch(self, shrinkage: float) -> Floats:
        """Return the diagonal of Fd at the Gauss points, (ne, 27, 3); 1 in the exocarp.

        Raises InvalidInput if the loading is not positive and finite.
        """
        result = np.ones(self.gauss.shape)
        core = ~self.mesh.is_exocarp
        asked = np.asarray(self.loading(self.gauss[core].reshape(-1, 3), shrinkage), dtype=float)
        result[core] = np.broadcast_to(asked, (int(core.sum()) * 27, 3)).reshape(-1, 27, 3)
        if not (np.isfinite(result).all() and (result > 0).all()):
            raise InvalidInput(f"the loading is not positive at s = {shrinkage:g}.", advice="Fd must be > 0.")
        return result

    def sweep(self, deformed: Floats, stretch: Floats, pressure: Floats | None = None) -> Assembled:
        """Assemble; with `pressure` (ne, 8) the tangent as well, unconstrained (see `masked`)."""
        pattern = None if pressure is None else self.pattern
        return assemble(
            self.mesh.positions, self.mesh.connectivity, deformed, stretch, self.mu, self.kappa, pressure, pattern
        )

    def free_part(self, nodal: Floats) -> Floats:
        """Return nodal values (nn, 3) at the nodes off the stone, (nf, 3), 0 in held components."""
        return np.where(self.free, nodal[self.pattern.free >= 0], 0.0)

    def factor(self, data: Floats, free: Bools | None = None, watch: Callable[[], None] | None = None) -> Factor:
        """Factorise a tangent (nnz, 3, 3) on the free components (default: the model's own); `watch` may end it."""
        return factorise(self.analysis, masked(self.pattern, data, self.free if free is None else free), watch)


def masked(pattern: Pattern, data: Floats, free: Bools) -> Floats:
    """Return the matrix with rows and columns of held components replaced by those of the identity."""
    rows = np.repeat(np.arange(len(free)), np.diff(pattern.indptr))
    result = data.copy()
    # few nodes have held components: only their blocks are touched
    held = ~np.all(free, axis=1, keepdims=True)[:, 0]
    there = np.flatnonzero(held[rows] | held[pattern.indices])
    result[there] *= free[rows[there], :, None] & free[pattern.indices[there], None, :]
    diagonal = there[rows[there] == pattern.indices[there]]
    for i in range(3):
        result[diagonal, i, i] += ~free[rows[diagonal], i]
    return result


def build_model(
    params: DehydrationParams, mesh: QuadraticMesh, kappa_ratio: float, loading: Loading | None = None
) -> Model:
    """Return the model of a fruit on `mesh` with kappa = kappa_ratio * mu in both layers, mu = 1 in the core."""
    mu = np.where(mesh.is_exocarp, params.modulus_ratio, 1.0)
    fixed = np.arange(len(mesh.positions)) % mesh.levels == 0
    pattern = build_pattern(mesh.connectivity, fixed)
    centres = mesh.positions[mesh.stacks[:, 4] * mesh.levels + mesh.levels - 1]
    analysis = analyse(mesh.stacks, centres, pattern.indptr, pattern.indices, mesh.levels - 1)
    free = np.ones((int((~fixed).sum()), 3), dtype=bool)
    for axis in mesh.planes:
        free[:, axis] = mesh.positions[~fixed, axis] != 0
    free[np.repeat(mesh.cut, mesh.levels - 1)] = False
    gauss = np.matmul(HEX27.shape(POINTS), mesh.positions[mesh.connectivity])
    return Model(mesh, mu, kappa_ratio * mu, loading or uniform, pattern, analysis, free, gauss)


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium at shrinkage s. deformed: (nn, 3). pressure: (ne, 8). residuals: one list per increment."""

    shrinkage: float
    deformed: Floats
    pressure: Floats
    energy: float = 0.0
    residuals: tuple[tuple[float, tuple[float, ...]], ...] = field(default=())

    @property
    def steps(self) -> int:
        """Newton steps taken."""
        return sum(len(history) - 1 for _, history in self.residuals)


class _Stuck(Exception):
    """An increment that did not converge; holds its last residual."""

    def __init__(self, residual: float) -> None:
        super().__init__()
        self.residual = residual


def _relative(model: Model, force: Floats, scale: Floats) -> float:
    size = float(np.linalg.norm(model.free_part(scale)))
    return float(np.linalg.norm(model.free_part(force))) / size if size > 0 else 0.0


def _lag(model: Model, swept: Assembled, pressure: Floats) -> float:
    """Largest volume strain by which the linearised pressure misses the state's own."""
    return float(np.abs((swept.pressure - pressure) / model.kappa[:, None]).max())


def _solve(model: Model, start: Equilibrium, shrinkage: float, tolerance: float, context: Context) -> Equilibrium:
    """Newton's method at one shrinkage. Raises _Stuck."""
    stretch = model.stretch(shrinkage)
    deformed, pressure = start.deformed, start.pressure
    swept = model.sweep(deformed, stretch, pressure)
    history: list[float] = []
    lag, factor = np.inf, None
    reachable = max(tolerance, ROUND_OFF * float((model.kappa / model.mu).max()))
    for _ in range(MOST_STEPS):
        history.append(_relative(model, swept.force, swept.scale))
        if history[-1] <= reachable:
            result = Equilibrium(shrinkage, deformed, swept.pressure, swept.energy)
            return dataclasses.replace(result, residuals=(*start.residuals, (shrinkage, tuple(history))))
        context.check_cancelled()
        near = history[-1] < REUSE_BELOW and (len(history) < 2 or history[-1] < 0.1 * history[-2])
        if factor is None or not near:
            try:
                factor = model.factor(swept.data, watch=context.check_cancelled)
            except np.linalg.LinAlgError:
                break
        step = np.zeros_like(deformed)
        step[model.pattern.free >= 0] = factor.solve(-model.free_part(swept.force).ravel()).reshape(-1, 3)
        local = step[model.mesh.connectivity].reshape(-1, 81, 1)
        change = swept.pressure - pressure + np.matmul(swept.gain, local)[..., 0]
        length = 1.0
        while length >= SHORTEST:
            moved, linear = deformed + length * step, pressure + length * change
            trial = model.sweep(moved, stretch, linear)
            after = _lag(model, trial, linear)
            if trial.least_ratio > CRUSHED and after < max(lag, SMALL_LAG):
                break
            length /= 2
        else:
            break
        deformed, pressure, swept, lag = moved, linear, trial, after
    raise _Stuck(history[-1])


def equilibrium(
    model: Model,
    shrinkage: float,
    *,
    tolerance: float = 1e-9,
    start: Equilibrium | None = None,
    guess: Equilibrium | None = None,
    alone: bool = False,
    context: Context | None = None,
) -> Equilibrium:
    """Return the equilibrium at `shrinkage`, from `start` (default: fresh) in one increment or as many as it takes.

    guess: a state near the wanted one, tried first; alone: and nothing after it, as no other has a patch's edge where
    it belongs. tolerance: of |R| / |sum of absolute element forces|. An increment that does not converge is halved; one
    that does makes the next half as long again.

    Raises:
        NotConverged: an increment below 1e-4 did not converge; last_stage and residual say how far it came.
            With `alone`: the guess did not.
        Cancelled: by the context.

    """
    context = context or Context()
    if guess is not None:
        try:
            return _solve(model, guess, shrinkage, tolerance, context)
        except _Stuck as stuck:
            if alone:
                raise NotConverged(
                    f"no equilibrium was found near a guess at s = {shrinkage:.4f}.",
                    advice="Ask for a finer quality.", residual=stuck.residual,
                ) from None  # fmt: skip
    at = start or Equilibrium(0.0, model.mesh.positions, np.zeros((len(model.mesh.connectivity), PRESSURE.shape[1])))
    increment = shrinkage - at.shrinkage
    while at.shrinkage != shrinkage:
        left = shrinkage - at.shrinkage
        target = shrinkage if abs(increment) >= 0.999 * abs(left) else at.shrinkage + increment
        try:
            at = _solve(model, at, target, tolerance, context)
        except _Stuck as stuck:
            increment = (target - at.shrinkage) / 2
            if abs(increment) < LEAST_INCREMENT:
                raise NotConverged(
                    f"no equilibrium was found beyond s = {at.shrinkage:.4f}.",
                    advice="Past the onset the smooth state is unstable: use the march, or ask for less shrinkage.",
                    last_stage=at.shrinkage,
                    residual=stuck.residual,
                ) from None
        else:
            increment *= 1.5
            context.report(abs(at.shrinkage / shrinkage) if shrinkage else 1.0, f"s = {at.shrinkage:.4f}")
    return at
