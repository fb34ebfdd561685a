"""The smooth shrunk state of a fruit (before buckling), implicit and quadratic: the truth other solvers are held to."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...arrays import Floats
from ...contract import Context, NotConverged
from ...fem import HEX27
from ..params import DehydrationParams
from .hexahedron import POINTS, PRESSURE, pressure_functions
from .location import fold, interpolate, locate, nominal
from .mesh import QuadraticMesh, Symmetry, build_quadratic_mesh, graded_layers, natural_symmetry
from .newton import Equilibrium, Loading, Model, build_model, equilibrium

__all__ = ["BaseState", "base_state", "carried"]

logger = logging.getLogger("wizen.dehydration.implicit")

GROWTH = 0.8
"""Thickness of a core layer over its outer neighbour's: the smooth state is steepest at the stone."""
COARSE_TOLERANCE = 1e-4
"""Residual of the coarser state that a fine one starts from; its discretisation error is larger than that."""
COARSEST = 4


@dataclass(frozen=True, eq=False)
class BaseState:
    """An equilibrium and the mesh it lives on.

    nodes, displaced: (nn, 3) fresh and deformed, of the part that was solved. pressure: (ne, 8) coefficients of
    `hexahedron.pressure_functions` per element, in units of the core's shear modulus, positive in tension. energy: of
    that part. residuals: per increment (s, relative residual before each Newton step). unknowns: displacement
    components solved.
    """

    params: DehydrationParams
    model: Model
    state: Equilibrium

    @property
    def mesh(self) -> QuadraticMesh:
        """The mesh of the part that was solved."""
        return self.model.mesh

    @property
    def nodes(self) -> Floats:
        """Fresh nodes."""
        return self.mesh.positions

    @property
    def displaced(self) -> Floats:
        """Deformed nodes."""
        return self.state.deformed

    @property
    def pressure(self) -> Floats:
        """Pressure coefficients."""
        return self.state.pressure

    @property
    def energy(self) -> float:
        """Strain energy of the part that was solved."""
        return self.state.energy

    @property
    def residuals(self) -> tuple[tuple[float, tuple[float, ...]], ...]:
        """Residual history."""
        return self.state.residuals

    @property
    def unknowns(self) -> int:
        """Free displacement components."""
        return int(self.model.free.sum())

    def __call__(self, points: Floats) -> Floats:
        """Return the deformed positions (k, 3) of fresh points (k, 3) anywhere in the fruit."""
        at = np.asarray(points, dtype=float).reshape(-1, 3)
        folded, signs = fold(self.mesh, at)
        element, local = locate(self.params, self.mesh, folded)
        moved = (self.displaced - self.nodes)[self.mesh.connectivity[element]]
        found: Floats = at + signs * np.einsum("pa,pai->pi", HEX27.shape(local), moved)
        return found

    def surface(self, colatitude: Floats, azimuth: Floats) -> Floats:
        """Return the deformed outer surface, shape (..., 3), at colatitude and azimuth [radian]."""
        fresh = self.params.surface(colatitude, azimuth)
        return self(fresh.reshape(-1, 3)).reshape(fresh.shape)


def carried(coarse: BaseState, model: Model, elsewhere: Equilibrium | None = None) -> Equilibrium:
    """Return the coarse state on another mesh of the same fruit, or of a patch of it: a start, no equilibrium yet.

    elsewhere: on `model`, what holds where the coarse state is of a patch and does not reach.
    """
    fresh, gauss = model.mesh.positions, model.gauss.reshape(-1, 3)
    folded, signs = fold(coarse.mesh, fresh)
    moved = fresh + signs * interpolate(coarse.params, coarse.mesh, coarse.displaced - coarse.nodes, folded)
    held = np.zeros_like(moved, dtype=bool)
    held[:: model.mesh.levels] = model.mesh.breaks[0] == 0
    for axis in model.mesh.planes:
        held[:, axis] |= fresh[:, axis] == 0
    moved = np.where(held, fresh, moved)
    element, local = nominal(coarse.params, coarse.mesh, fold(coarse.mesh, gauss)[0])
    at_points = np.einsum("pr,pr->p", pressure_functions(local), coarse.pressure[element]).reshape(-1, len(POINTS))
    pressure = at_points @ np.linalg.pinv(PRESSURE).T
    if elsewhere is not None:
        beyond = (element < 0).reshape(-1, len(POINTS)).any(axis=1)
        pressure[beyond] = elsewhere.pressure[beyond]
        outside = np.repeat(model.mesh.cut, model.mesh.levels)
        outside[model.mesh.connectivity[beyond]] = True
        moved[outside] = elsewhere.deformed[outside]
    return Equilibrium(coarse.state.shrinkage, moved, pressure)


def base_state(
    params: DehydrationParams,
    s: float,
    *,
    n: int = 6,
    layers: int | Floats = 4,
    exocarp_layers: int = 1,
    kappa_ratio: float = 1000.0,
    tolerance: float = 1e-9,
    loading: Loading | None = None,
    symmetry: Symmetry | Literal["auto"] = "auto",
    context: Context | None = None,
) -> BaseState:
    """Return the equilibrium of the perfect fruit at shrinkage `s` (negative: swelling).

    n: quadratic elements per edge of the cubed sphere (even where symmetry is used). layers: quadratic core layers,
    or their breakpoints 0..1 from stone to interface. kappa_ratio: bulk over shear modulus. tolerance: relative
    residual. loading: callable of fresh points (k, 3) and s, giving the diagonal of Fd in the core (k, 3) - a field,
    anisotropic or swelling; default (1 - s) everywhere. symmetry: the part that is solved; "auto" is the fruit's
    smallest, or the whole where a loading is given (whose symmetry only the caller knows).

    Meshes whose n has an even half start from the state of that half.

    Raises:
        NotConverged: with last_stage and residual; usual beyond the onset.
        InvalidInput: an odd n with symmetry, or a loading that is not positive.
        Cancelled: by the context.

    """
    part: Symmetry = symmetry if symmetry != "auto" else ("whole" if loading else natural_symmetry(params))
    core = graded_layers(layers, GROWTH) if isinstance(layers, int) else np.asarray(layers, dtype=float)
    model = build_model(params, build_quadratic_mesh(params, n, core, part, exocarp_layers), kappa_ratio, loading)
    guess = None
    if n % 4 == 0 and n // 2 >= COARSEST:
        try:
            coarse = base_state(
                params, s, n=n // 2, layers=core, exocarp_layers=exocarp_layers, kappa_ratio=kappa_ratio,
                tolerance=max(tolerance, COARSE_TOLERANCE), loading=loading, symmetry=part, context=context,
            )  # fmt: skip
            guess = carried(coarse, model)
        except NotConverged as failure:
            logger.info("the coarser mesh found no start: %s", failure)
    return BaseState(params, model, equilibrium(model, s, tolerance=tolerance, guess=guess, context=context))
