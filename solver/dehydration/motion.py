"""A fruit that steps can move: its mesh and part, its layout, skin and drive, and what a state's forces amount to."""

from __future__ import annotations

import dataclasses
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Singles
from ..contract import Context, Unstable
from .drive import Drive
from .fresh.imperfection import heights
from .fresh.mesh import FruitMesh, build_mesh
from .fresh.pattern import pattern_heights
from .fresh.sector import cut, evened, mirrored
from .kernel import (
    Layout,
    Weights,
    build_layout,
    dilatations,
    element_report,
    forget,
    held_outside,
    internal_force,
    least_ratios,
    make_skin,
    march,
    momentum,
    new_state,
    out_of_reach,
    positions,
    pressure_energy,
    rested,
    rests,
    reweigh,
    stiffness_bounds,
    weigh,
    without_bulk,
)
from .kernel.fixed_point import QUANTUM
from .kernel.march import SEARCH_EVERY
from .params import DehydrationParams
from .settings import Settings

__all__ = ["Masses", "Motion"]

Fixed = NDArray[np.int32]
#: The layout that holds them, the state that they were taken in, and whether they follow closely.
Masses: TypeAlias = tuple[Layout, Fixed, bool]

#: Factor on the scaled masses.
_SAFETY = 2.0

#: Element-steps between two looks at the observer: about a quarter of a second on one core.
_SLICE = 8_000_000

#: Most steps between two looks at how far all has come, and whether the run is cancelled; no more element-steps than
#: half a second on one busy core, contact included.
_STRIDE, _WATCHED = 100, 2_000_000

#: Way of a node, in edges of the skin, after which the masses are taken anew. Thick skins that fall from a late onset
#: (te = 0.1, gamma = 30) need 1.6 times their masses after an edge and a half and blow up after three.
_WAY = 0.5
#: Likewise of what has left the finite once.
_CLOSE = 0.1

#: How fast rest volumes follow the pressure, as a share of what damping takes from a ringing volume.
_FOLLOW = 0.125

#: Strain below which no forces are compared with; and strain whose forces are round-off, as positions are of whole
#: quanta and forces float32: fruits of te 0.01 to 0.1 at rest are out of balance by 0.5 to 1.6e-5.
_LEAST_STRAIN, _ROUND_OFF = 1e-4, 2e-5


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
        bumps = np.zeros(len(directions))
        if params.imperfection:
            bumps = params.imperfection * heights(params, directions, context, highest=settings.n)
            bumps = evened(bumps, self.sector)
        if params.pattern is not None:
            bumps = bumps + mirrored(pattern_heights(params, directions, context), self.sector)
        mesh = self.sector.mesh
        bumps = bumps[self.sector.own]
        fade = (bumps[:, None] * mesh.depth[None, :] ** 2).reshape(-1, 1)
        bumpy = mesh.positions + fade * np.repeat(mesh.rays, mesh.levels, axis=0)
        mu = np.where(mesh.is_exocarp, params.modulus_ratio, 1.0)
        # by element
        ratios = settings.skin_march_kappa_ratio, settings.march_kappa_ratio
        self._march_kappa_ratio = np.where(mesh.is_exocarp, *ratios)
        self._moduli = mu, self._march_kappa_ratio * mu
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
        self._unit_force = _unit_force(self.layout, mu)
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
        self._weighed = self.layout.fresh.copy()
        self._edge, self._closely = float(self._skin.contact.size), False
        # whole searches for contact
        self._stride = SEARCH_EVERY * max(1, min(_STRIDE, _WATCHED // self.elements) // SEARCH_EVERY)

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

    @property
    def masses(self) -> Masses:
        """The masses and how they follow: what comes next depends on them as on state and velocity.

        Who sets them goes on from another state, and what may touch is looked for anew there.
        """
        return self.layout, self._weighed, self._closely

    @masses.setter
    def masses(self, masses: Masses) -> None:
        self.layout, self._weighed, self._closely = masses
        forget(self._skin, self.layout)

    def _follow(self, state: Fixed, velocity: Singles) -> int:
        """Take the masses anew if nodes have come far since the last time; return how many steps may be made now."""
        way = (_CLOSE if self._closely else _WAY) * self._edge
        if QUANTUM * float(np.abs(state - self._weighed).max()) > way:
            self.layout = reweigh(
                self.layout, state, self.sector.mesh.is_exocarp, *self._moduli, self._fresh_bound, safety=_SAFETY
            )
            self._weighed = state.copy()
            weigh(self._skin, self.layout)
        speed = float(np.abs(velocity).max())
        if speed * self._stride <= way:
            return self._stride
        # what has blown up has no speed
        return SEARCH_EVERY * max(1, int(way / speed) // SEARCH_EVERY) if np.isfinite(speed) else SEARCH_EVERY

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
        """March from shrinkage a to b under rest volumes `rest`, and return those that go with the new pressures.

        What may touch is looked for anew, so that no earlier steps matter.
        """
        forget(self._skin, self.layout)
        self.run(state, velocity, rest, count, a, b, damping)
        return self._followed(state, rest, count, b, damping)

    def settle_inside(
        self, state: Fixed, velocity: Singles, rest: Floats, count: int, shrinkage: float, damping: float
    ) -> None:
        """Let all but the surface nodes move, which stay where they are, touching or not. Velocities of the surface
        nodes are to be 0.
        """
        self._context.check_cancelled()
        self.drive.lead(state, shrinkage)
        self._follow(state, velocity)
        ready = self._ready(shrinkage, rest)
        held = held_outside(ready, self.sector.mesh.surface_nodes)
        theta = 1 - shrinkage
        march(held, state, velocity, count, theta=(theta, theta), damping=damping, one_point=True)
        self._arrive(state, count, shrinkage)

    def _followed(self, state: Fixed, rest: Floats, count: int, shrinkage: float, damping: float) -> Floats:
        """Return the rest volumes that go with the pressures after `count` steps at this damping."""
        goal = self.rests(state, rest, shrinkage)
        # volumes ring for 2 / damping steps; following faster than that feeds what rings
        share = 1 - np.exp(-_FOLLOW * damping * count)
        following: Floats = rest * (goal / rest) ** share
        return following

    def rests(self, state: Fixed, rest: Floats, shrinkage: float) -> Floats:
        """Return the rest volumes (ne,) that go with the pressures that a state has under `rest`."""
        settings = self.settings
        strain = dilatations(self._ready(shrinkage, rest), state, 1 - shrinkage)
        return rests(strain, self._march_kappa_ratio, settings.kappa_ratio)

    def run(
        self,
        state: Fixed,
        velocity: Singles,
        rest: Floats,
        count: int,
        a: float,
        b: float,
        damping: float,
    ) -> None:
        """March from shrinkage a to b under rest volumes `rest`; state and velocity change in place.

        Masses follow the deformation on the way; the list of what may touch goes on from the steps before. What leaves
        the finite is taken again, and masses follow closely from then on: a thick and very stiff skin that snaps
        through outruns them.

        Raises:
            Unstable: it left the finite nevertheless; state and velocity are those of then.
            Cancelled: the observer asked to stop.

        """
        begin = state.copy(), velocity.copy(), self.masses
        try:
            self._run(state, velocity, rest, count, a, b, damping)
        except Unstable:
            if self._closely:
                raise
            state[:], velocity[:], self.masses = begin
            self._closely = True
            self._run(state, velocity, rest, count, a, b, damping)

    def _run(
        self,
        state: Fixed,
        velocity: Singles,
        rest: Floats,
        count: int,
        a: float,
        b: float,
        damping: float,
    ) -> None:
        weigh(self._skin, self.layout)
        for begin, end, steps in self.drive.pieces(a, b, count):
            middle = (begin + end) / 2
            self.drive.lead(state, middle)
            per_step, last = (end - begin) / steps, 0
            while last < steps:
                self._context.check_cancelled()
                first, last = last, min(last + self._follow(state, velocity), steps)
                skin = march(
                    self._ready(middle, rest),
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
        self._arrive(state, count, b)

    def _arrive(self, state: Fixed, count: int, shrinkage: float) -> None:
        """Count the steps that led to a state, and refuse one that has left the finite."""
        self.steps += count
        if out_of_reach(state):
            raise Unstable(
                f"the run blew up at shrinkage s = {shrinkage:.3f}.",
                advice="Ask for stages below that, or for a finer quality.",
            )

    def _ready(self, shrinkage: float, rest: Floats) -> Layout:
        """Return the layout with the targets at `shrinkage` and the rest volumes, until the next is asked for."""
        uniform = self.drive.loading.uniform
        if self._made is None or self._made[0] is not rest or not uniform:
            before = self._made[1] if self._made is not None and uniform else None
            self._made = rest, rested(self.drive.loaded(self.layout, shrinkage), rest, before)
        planes = self._made[1]
        own = {name: getattr(self.layout, name) for name in Weights._fields}
        return dataclasses.replace(planes, **own)

    def marched_energy(self, state: Fixed, rest: Floats, shrinkage: float) -> float:
        """Return the energy of the part [mu r1^3] that steps lower, but for a constant of the rest volumes."""
        layout = self._ready(shrinkage, rest)
        return float(element_report(layout, state, 1 - shrinkage, one_point=True).energy.sum())

    def strained(
        self, state: Fixed, rest: Floats, shrinkage: float, with_energy: bool = True
    ) -> tuple[float | None, float]:
        """Return the strain energy of the whole fruit [mu r1^3], where it is asked for, of flesh whose bulk modulus is
        not the march's, and the least J/Jd of all integration points, which no rest volume changes.
        """
        theta, settings = 1 - shrinkage, self.settings
        loaded = self.drive.loaded(self.layout, shrinkage)
        if not with_energy:
            return None, self.least_ratio(state, shrinkage)
        sheared = element_report(without_bulk(loaded), state, theta, one_point=True)
        dilatation = dilatations(self._ready(shrinkage, rest), state, theta)
        share = self._march_kappa_ratio / settings.kappa_ratio
        energy = float((sheared.energy + pressure_energy(loaded, dilatation, theta, share)).sum())
        return self.sector.copies * energy, float(sheared.least_ratio.min())

    def least_ratio(self, state: Fixed, shrinkage: float) -> float:
        """Return the least J/Jd of all integration points."""
        return float(least_ratios(self.drive.loaded(self.layout, shrinkage), state, 1 - shrinkage).min())

    def residual(self, state: Fixed, rest: Floats, shrinkage: float, damping: float) -> float:
        """Return the out-of-balance force, contact included: what one step from rest does to the momentum.

        Relative to the root of the sum of squares of all elements' nodal forces. A step moves the nodes before contact
        answers, and damping shortens that move: the balance is struck, and measured, with the damping it settles with.
        """
        theta = 1 - shrinkage
        layout = self._ready(shrinkage, rest)
        scale = internal_force(layout, state, theta, one_point=True).scale
        moved, kick = state.copy(), np.zeros((layout.nodes, 4), np.float32)
        weigh(self._skin, layout)  # pairs are still those of the steps before, or are looked for anew
        march(layout, moved, kick, 1, theta=(theta, theta), damping=damping, one_point=True, skin=self._skin)
        pushed = (1 + damping / 2) * momentum(layout, kick)[layout.free]
        # not `norm`: it is a BLAS dot product, whose rounding depends on the number of threads
        force = float(np.sqrt(np.square(pushed).sum()))
        # a fruit with next to no stress has nothing but round-off; that is no lack of balance
        beyond = max(force - _ROUND_OFF * self._unit_force, 0.0)
        return beyond / max(scale, _LEAST_STRAIN * self._unit_force)


def _unit_force(layout: Layout, mu: Floats) -> float:
    """Root of the sum of squares of the elements' nodal forces at about unit strain: mu times the mean face."""
    corners = positions(layout.fresh)[layout.connectivity]
    size = np.linalg.norm(corners[:, 7] - corners[:, 0], axis=1) / np.sqrt(3)
    return float(np.sqrt(np.square(mu * size**2).sum()))
