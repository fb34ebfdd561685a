"""A fruit that steps can move: its mesh and part, its layout, skin and drive, and what a state's forces amount to."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Singles
from ..contract import Context, Unstable
from .drive import Drive
from .fresh.imperfection import heights
from .fresh.mesh import FruitMesh, build_mesh
from .fresh.pattern import pattern_heights
from .fresh.sector import cut, evened
from .kernel import (
    ElementReport,
    Layout,
    build_layout,
    dilatations,
    element_report,
    forget,
    internal_force,
    make_skin,
    march,
    new_state,
    out_of_reach,
    positions,
    rested,
    rests,
    reweigh,
    stiffness_bounds,
    weigh,
)
from .kernel.march import SEARCH_EVERY
from .params import DehydrationParams
from .settings import Settings

__all__ = ["Motion"]

Fixed = NDArray[np.int32]

#: Factor on the scaled masses.
_SAFETY = 2.0

#: Element-steps between two looks at the observer: about a quarter of a second on one core.
_SLICE = 8_000_000

#: Element-steps between two looks whether the run is cancelled: half a second on one busy core, contact included.
_WATCHED = 2_000_000

#: How fast rest volumes follow the pressure, as a share of what damping takes from a ringing volume.
_FOLLOW = 0.125

#: Strain below which forces count as round-off.
_LEAST_STRAIN = 1e-4


class Motion:
    """The fruit, or the part of it between mirrors, with all that a step needs; `steps` counts those taken.

    State, velocity and rest volumes are the caller's arrays; `rest`: rest volumes (elements,) of the fresh fruit.
    """

    def __init__(self, params: DehydrationParams, settings: Settings, context: Context) -> None:
        self.params, self.settings, self._context = params, settings, context
        self.mesh: FruitMesh = build_mesh(params, settings.n, settings.core)
        self.sector = cut(self.mesh, params.mirrors)
        directions = self.mesh.sphere.directions
        # waves that the mesh cannot carry (fewer than four nodes) would be noise that depends on it
        bumps = params.imperfection * heights(params, directions, context, highest=settings.n)
        if params.pattern is not None:
            bumps = bumps + pattern_heights(params, directions, context)
        mesh = self.sector.mesh
        bumps = evened(bumps, self.sector)[self.sector.own]
        fade = (bumps[:, None] * mesh.depth[None, :] ** 2).reshape(-1, 1)
        bumpy = mesh.positions + fade * np.repeat(mesh.rays, mesh.levels, axis=0)
        mu = np.where(mesh.is_exocarp, params.modulus_ratio, 1.0)
        self._moduli = mu, settings.march_kappa_ratio * mu
        self.rest = np.ones(len(mu))
        self._made: tuple[Floats, Layout] | None = None
        self.layout = build_layout(
            bumpy,
            mesh.connectivity,
            mesh.is_exocarp,
            *self._moduli,
            mesh.fixed,
            safety=_SAFETY,
            full_levels=settings.full_levels,
            mirrored=self.sector.planes,
        )
        self.drive = Drive(params, mesh, self.layout)
        self._fresh_bound = stiffness_bounds(
            self.layout, self.layout.fresh, mesh.is_exocarp, *self._moduli, even_crushed=True
        )
        self._least_force = _LEAST_STRAIN * _unit_force(self.layout, mu)
        te = params.exocarp_thickness
        sector = self.sector
        self._skin = make_skin(
            self.layout,
            mesh.surface_nodes[sector.image],
            mesh.sphere.quads,
            settings.clearance * te,
            sign=sector.sign,
            own=sector.own,
            share=sector.share,
        )
        self.steps = 0
        # whole searches for contact: cut there, a march takes the same steps as in one piece
        self._watched = SEARCH_EVERY * max(1, _WATCHED // (SEARCH_EVERY * self.elements))

    @property
    def elements(self) -> int:
        """Number of hexahedra."""
        return self.layout.elements

    @property
    def slice(self) -> int:
        """Number of steps between two looks at the observer."""
        return _SLICE // self.elements

    def surface(self, state: Fixed) -> Floats:
        """Return the nodes of the sector's outer surface, in column order."""
        return positions(state[self.sector.mesh.surface_nodes])

    def smooth(self, shrinkage: float) -> tuple[Fixed, Singles]:
        """Return the smooth start at `shrinkage`, at rest."""
        return new_state(self.layout, self.drive.smooth(shrinkage))

    def weighed(self, state: Fixed) -> Layout:
        """Return the layout with masses for the stiffness in this state."""
        return reweigh(
            self.layout, state, self.sector.mesh.is_exocarp, *self._moduli, self._fresh_bound, safety=_SAFETY
        )

    def advance(
        self,
        state: Fixed,
        velocity: Singles,
        rest: Floats,
        count: int,
        a: float,
        b: float,
        damping: float,
    ) -> Floats:
        """March from shrinkage a to b under rest volumes `rest`, and return those that go with the new pressures."""
        self.run(state, velocity, rest, count, a, b, damping)
        settings = self.settings
        if settings.kappa_ratio == settings.march_kappa_ratio:
            return rest
        loaded = self._ready(self.layout, b, rest)
        goal = rests(dilatations(loaded, state, 1 - b), settings.march_kappa_ratio, settings.kappa_ratio)
        # volumes ring for 2 / damping steps; following faster than that feeds what rings
        share = 1 - np.exp(-_FOLLOW * damping * count)
        following: Floats = rest * (goal / rest) ** share
        return following

    def run(
        self,
        state: Fixed,
        velocity: Singles,
        rest: Floats,
        count: int,
        a: float,
        b: float,
        damping: float,
        layout: Layout | None = None,
    ) -> None:
        """March from shrinkage a to b under rest volumes `rest`; state and velocity change in place."""
        layout = layout or self.layout
        forget(self._skin, layout)
        for begin, end, steps in self.drive.pieces(a, b, count):
            middle = (begin + end) / 2
            self.drive.lead(state, middle)
            loaded = self._ready(layout, middle, rest)
            for first in range(0, steps, self._watched):
                self._context.check_cancelled()
                last = min(first + self._watched, steps)
                per_step = (end - begin) / steps
                skin = march(
                    loaded,
                    state,
                    velocity,
                    last - first,
                    theta=(1 - begin - per_step * first, 1 - begin - per_step * last),
                    damping=damping,
                    one_point=True,
                    skin=self._skin,
                )
                assert skin is not None
                self._skin = skin
        self.steps += count
        if out_of_reach(state):
            raise Unstable(
                f"the run blew up at shrinkage s = {b:.3f}.",
                advice="Ask for stages below that, a finer quality, or a thicker exocarp.",
            )

    def _ready(self, layout: Layout, shrinkage: float, rest: Floats) -> Layout:
        """Return `layout` with the targets at `shrinkage` and the rest volumes; the last one made is kept."""
        if self._made is None or self._made[0] is not rest or not self.drive.loading.uniform:
            self._made = rest, rested(self.drive.loaded(self.layout, shrinkage), rest)
        planes = self._made[1]
        return dataclasses.replace(planes, mass=layout.mass, inverse_mass=layout.inverse_mass)

    def report(self, state: Fixed, rest: Floats, shrinkage: float) -> ElementReport:
        """Return energies and volume ratios of the elements."""
        layout = self._ready(self.layout, shrinkage, rest)
        return element_report(layout, state, 1 - shrinkage, one_point=True)

    def residual(self, state: Fixed, rest: Floats, shrinkage: float, layout: Layout, damping: float) -> float:
        """Return the out-of-balance force, contact included: what one step from rest does to the momentum.

        Relative to the root of the sum of squares of all elements' nodal forces. A step moves the nodes before contact
        answers, and damping shortens that move: the balance is struck, and measured, with the damping it settles with.
        """
        theta = 1 - shrinkage
        layout = self._ready(layout, shrinkage, rest)
        scale = internal_force(layout, state, theta, one_point=True).scale
        moved, kick = state.copy(), np.zeros((layout.nodes, 4), np.float32)
        weigh(self._skin, layout)  # pairs are still those of the steps before, or are looked for anew
        march(layout, moved, kick, 1, theta=(theta, theta), damping=damping, one_point=True, skin=self._skin)
        momentum = (1 + damping / 2) * (kick[:, :3] * layout.mass[:, None])[layout.free]
        # a fruit without stress has nothing but round-off; that is no lack of balance
        # not `norm`: it is a BLAS dot product, whose rounding depends on the number of threads
        return float(np.sqrt(np.square(momentum).sum())) / max(scale, self._least_force)


def _unit_force(layout: Layout, mu: Floats) -> float:
    """Root of the sum of squares of the elements' nodal forces at about unit strain: mu times the mean face."""
    corners = positions(layout.fresh)[layout.connectivity]
    size = np.linalg.norm(corners[:, 7] - corners[:, 0], axis=1) / np.sqrt(3)
    return float(np.sqrt(np.square(mu * size**2).sum()))
