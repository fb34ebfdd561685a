"""Meshes of a fruit of any shape, whole or in patches, and its smooth states on them."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...contract import Context
from ..fresh.closed_form import flat_film_wavelength
from ..fresh.mesh import flesh_span, layer_fractions
from ..implicit import (
    Band,
    BaseState,
    Equilibrium,
    Model,
    Patch,
    build_band_mesh,
    build_model,
    build_quadratic_mesh,
    carried,
    equilibrium,
    natural_symmetry,
)
from ..implicit.buckling import (
    Path,
    Velocity,
    along,
    fresh_metric,
    moved_on,
    stress_stiffness,
    tangent_at,
    velocity,
)
from ..implicit.location import interpolate
from ..params import DehydrationParams

__all__ = ["States"]


#: Core layer at the interface in wavelengths, how fast layers grow inwards, and layers of the skin: with one, no mesh
#: gets nearer than .5 %.
FIRST_LAYER, LAYER_GROWTH, SKIN_LAYERS = 0.25, 2.0, 2
#: Layers of the core, from the interface, whose columns stand upright: three quarters of a wavelength.
UPRIGHT = 2
#: Elements per edge of the mesh that knows the smooth shape of the whole, and of that under a skin of long waves.
SMOOTH, SMOOTH_LONG, LONG = 8, 4, 0.5
#: Way from a smooth state up to which another is that one moved on, relative.
NEARBY = 0.05
#: Residual of a smooth state; the line to the onset errs by more.
SETTLED = 1e-5
#: Shrinkage of the small state whose stress the linear method scales.
SMALL = 1e-4


class States:
    """The smooth states of one fruit: coarse ones of the whole, from which those of other meshes start."""

    def __init__(self, params: DehydrationParams, kappa_ratio: float, context: Context) -> None:
        self.params, self.kappa_ratio, self.watch = params, kappa_ratio, context.check_cancelled
        # increments of a state would have progress run to its end again and again
        self._quiet = Context(cancelled=self._stopped)
        self._known: tuple[Equilibrium, Velocity] | None = None
        wavelength = flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio)
        self.whole = self.model(SMOOTH if wavelength < LONG else SMOOTH_LONG, None)

    def _stopped(self) -> bool:
        self.watch()
        return False

    def model(self, n: int, patch: Patch | None) -> Model:
        """Return the model on `n` elements an edge of the cubed sphere."""
        core, foot = self._layers()
        mesh = build_quadratic_mesh(self.params, n, core, natural_symmetry(self.params), SKIN_LAYERS, patch, foot)
        return build_model(self.params, mesh, self.kappa_ratio)

    def in_band(self, band: Band, deep: int | None = None) -> Model:
        """Return the model of a band. deep: how many layers of the flesh there are below the skin, None: all."""
        core, foot = self._layers()
        core = core if deep is None else core[-deep - 1 :]
        mesh = build_band_mesh(self.params, band, core, natural_symmetry(self.params), SKIN_LAYERS, foot)
        return build_model(self.params, mesh, self.kappa_ratio)

    def _layers(self) -> tuple[Floats, float | None]:
        """Return the breaks of the flesh's layers, and from which on columns stand upright."""
        params = self.params
        wavelength = flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio)
        # layers are shares of the flesh below each place: where it is thick they must not be too thick for waves
        core = layer_fractions(flesh_span(params)[1], FIRST_LAYER * min(wavelength, 0.4), LAYER_GROWTH)
        return core, float(core[-UPRIGHT - 1]) if len(core) > UPRIGHT + 1 else None

    def path(
        self, model: Model, shrinkage: float, coarser: tuple[BaseState, Velocity] | None
    ) -> tuple[Path, BaseState]:
        """Return a mesh's smooth state, its tangent and where both go. coarser: a state of the same part near by.

        Raises:
            NotConverged: there is none, or none that is stable.

        """
        settled, lead = self._near(model, shrinkage, coarser)
        path = along(model, settled, fresh_metric(model), lead, self.watch)
        return path, BaseState(self.params, model, settled)

    def moving(
        self, model: Model, shrinkage: float, coarser: tuple[BaseState, Velocity] | None
    ) -> tuple[BaseState, Velocity]:
        """Return a mesh's smooth state and where it goes. Raises what `path` raises."""
        settled, lead = self._near(model, shrinkage, coarser)
        return BaseState(self.params, model, settled), velocity(model, settled, lead, self.watch)

    def _near(
        self, model: Model, shrinkage: float, coarser: tuple[BaseState, Velocity] | None
    ) -> tuple[Equilibrium, Floats]:
        """Return a mesh's smooth state and the way of the whole's coarse one at its nodes."""
        base, rate = self.smooth(shrinkage)
        start = carried(base, model)
        if coarser is not None and abs(shrinkage / coarser[0].state.shrinkage - 1) < NEARBY:
            state, moving = coarser
            start = carried(BaseState(self.params, state.model, moved_on(state.state, moving, shrinkage)), model, start)
        settled = self._settled(model, start)
        return settled, interpolate(self.params, base.mesh, rate, model.mesh.positions)

    def fresh_path(self, model: Model) -> tuple[Path, BaseState]:
        """Return the fresh tangent and the change that the stress of a small state makes, for the linear method."""
        fresh = equilibrium(model, 0.0)
        small = self._settled(model, carried(self.smooth(SMALL)[0], model))
        change, tangent = stress_stiffness(model, small) / SMALL, tangent_at(model, fresh)
        nothing = Velocity(tangent, np.zeros_like(fresh.deformed), np.zeros_like(fresh.pressure), model.factor(tangent))
        return Path(0.0, change, -change, nothing), BaseState(self.params, model, small)

    def _settled(self, model: Model, start: Equilibrium) -> Equilibrium:
        s = start.shrinkage
        patch = bool(model.mesh.cut.any())
        return equilibrium(model, s, tolerance=self._tolerance(s), guess=start, alone=patch, context=self._quiet)

    def smooth(self, shrinkage: float) -> tuple[BaseState, Floats]:
        """Return the whole's coarse smooth state and its nodes' displacement by s (nn, 3).

        Near a state that is known it is that one moved on: a patch's edge does not see the square of the way.
        """
        model, known = self.whole, self._known
        if known is None or abs(shrinkage - known[0].shrinkage) > NEARBY * known[0].shrinkage:
            start = None if known is None or known[0].shrinkage > shrinkage else known[0]
            state = equilibrium(
                model, shrinkage, tolerance=self._tolerance(shrinkage), start=start, context=self._quiet
            )
            known = state, velocity(model, state, np.zeros_like(state.deformed), self.watch)
            self._known = known
        state, rate = known
        return BaseState(self.params, model, moved_on(state, rate, shrinkage)), rate.moved

    def forget(self) -> None:
        """Take the next smooth state anew: one past the onset turns too fast to be moved on or to lead other meshes."""
        self._known = None

    @staticmethod
    def _tolerance(shrinkage: float) -> float:
        return SETTLED * min(1.0, shrinkage / 0.01)
