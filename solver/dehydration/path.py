"""The march along shrinkage: from a smooth start, past the onset, to stages that are settled on the side.

The march depends on the parameters and the quality alone. A stage is settled on a copy of the marching state, so what
else was asked for never changes a stage's shape.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contract import Context, Unstable
from .drive import Drive
from .imperfection import heights
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
)
from .mesh import FruitMesh, build_mesh
from .params import DehydrationParams
from .pattern import pattern_heights
from .sector import cut, evened
from .settings import Settings

__all__ = ["Path", "State"]

Array = NDArray[np.float64]
Fixed = NDArray[np.int32]
Single = NDArray[np.float32]

#: Factor on the scaled masses, and the shrinkage after which they are taken anew.
_SAFETY = 2.0
_REWEIGH = 0.01

#: Looks at the kinetic energy per swing, and those between two weighings: what moves that fast folds meanwhile, and
#: with masses of 800 steps before it was seen to blow up.
_LOOKS, _WEIGH_EVERY = 30, 6

#: How fast rest volumes follow the pressure, as a share of what damping takes from a ringing volume.
_FOLLOW = 0.125

#: Updates of the rest volumes before a stage settles, and calm steps between two: what rings is gone by the next.
_PRESSINGS, _PRESSING_STEPS = 6, 150

#: Strain below which forces count as round-off.
_LEAST_STRAIN = 1e-4

#: Steps over which the surface's drift is measured.
_REST_STEPS = 200

#: Element-steps between two looks at the observer: about a quarter of a second on one core. The march goes on in whole
#: slices, whatever stages were asked for; what is left to a stage is done on its copy.
_SLICE = 8_000_000


@dataclass(frozen=True, eq=False)
class State:
    """A settled stage: nodes of the outer surface (nc, 3), how settled it is, and the steps spent so far.

    residual: out-of-balance force over internal force. drift: rms motion of the surface in the last 200 steps, in
    exocarp thicknesses. least_ratio: least J/Jd of all integration points. energy: strain energy in mu r1^3, and
    released: by how much settling lowered it, where that was asked for.
    """

    surface: Array
    shrinkage: float
    residual: float
    drift: float
    steps: int
    least_ratio: float
    energy: float
    released: float | None = None


class Path:
    """One fruit's way from fresh to dry."""

    def __init__(
        self, params: DehydrationParams, settings: Settings, context: Context, *, with_release: bool = False
    ) -> None:
        self._with_release = with_release
        self._params, self._settings, self._context = params, settings, context
        self.mesh: FruitMesh = build_mesh(params, settings.n, settings.core)
        self._sector = cut(self.mesh, params.mirrors)
        directions = self.mesh.sphere.directions
        # waves that the mesh cannot carry (fewer than four nodes) would be noise that depends on it
        bumps = params.imperfection * heights(params, directions, context, highest=settings.n)
        if params.pattern is not None:
            bumps = bumps + pattern_heights(params, directions, context)
        mesh = self._sector.mesh
        bumps = evened(bumps, self._sector)[self._sector.own]
        fade = (bumps[:, None] * mesh.depth[None, :] ** 2).reshape(-1, 1)
        bumpy = mesh.positions + fade * np.repeat(mesh.rays, mesh.levels, axis=0)
        mu = np.where(mesh.is_exocarp, params.modulus_ratio, 1.0)
        self._moduli = mu, settings.march_kappa_ratio * mu
        self._rest = np.ones(len(mu))
        self._made: tuple[Array, Layout] | None = None
        self._layout = build_layout(
            bumpy,
            mesh.connectivity,
            mesh.is_exocarp,
            *self._moduli,
            mesh.fixed,
            safety=_SAFETY,
            full_levels=settings.full_levels,
            mirrored=self._sector.planes,
        )
        self._drive = Drive(params, mesh, self._layout)
        self._fresh_bound = stiffness_bounds(
            self._layout, self._layout.fresh, mesh.is_exocarp, *self._moduli, even_crushed=True
        )
        self._least_force = _LEAST_STRAIN * _unit_force(self._layout, mu)
        te = params.exocarp_thickness
        sector = self._sector
        self._skin = make_skin(
            self._layout,
            mesh.surface_nodes[sector.image],
            mesh.sphere.quads,
            settings.clearance * te,
            te,
            sign=sector.sign,
            own=sector.own,
            share=sector.share,
        )
        self._state, self._velocity = new_state(self._layout)
        self._steps = 0
        self._place = 0
        self._begun = False

    @property
    def elements(self) -> int:
        """Number of hexahedra."""
        return self._layout.elements

    def _surface(self, state: Fixed) -> Array:
        """Return the nodes of the sector's outer surface, in column order."""
        return positions(state[self._sector.mesh.surface_nodes])

    def stage(self, shrinkage: float, last: float) -> State:
        """Return the settled state at `shrinkage`; stages are asked for in ascending order, up to `last`.

        Raises:
            Cancelled: the observer asked to stop.
            Unstable: the state left the finite, or elements turned inside out.

        """
        settings = self._settings
        if shrinkage <= settings.start:
            return self._settle(*self._pressed(*self._smooth(shrinkage), self._rest, shrinkage), shrinkage)
        target = int((shrinkage - settings.start) / settings.pace)
        self._march(target, last)
        state, velocity, rest = self._state.copy(), self._velocity.copy(), self._rest
        if target > self._place:
            a, b = self._at(self._place), self._at(target)
            rest = self._advance(state, velocity, rest, target - self._place, a, b, settings.damping)
        return self._settle(*self._pressed(state, velocity, rest, shrinkage), shrinkage)

    def _at(self, place: int) -> float:
        """Return the shrinkage after `place` steps of the march."""
        return self._settings.start + place * self._settings.pace

    def _smooth(self, shrinkage: float) -> tuple[Fixed, Single]:
        """Return the smooth start at `shrinkage`, at rest."""
        return new_state(self._layout, self._drive.smooth(shrinkage))

    def _pressed(self, state: Fixed, velocity: Single, rest: Array, shrinkage: float) -> tuple[Fixed, Single, Array]:
        """Let rest volumes catch up with the pressure: a march's lag by 0.03 of shrinkage, a smooth start's know none.

        Returns state, velocity (both changed in place) and rest volumes.
        """
        for _ in range(_PRESSINGS):
            rest = self._advance(
                state, velocity, rest, _PRESSING_STEPS, shrinkage, shrinkage, self._settings.calm_damping
            )
        return state, velocity, rest

    def _march(self, target: int, last: float) -> None:
        """March in whole slices to at most `target` steps."""
        settings = self._settings
        if not self._begun:
            self._state, self._velocity = self._smooth(settings.start)
            self._begun = True
        chunk = max(20, min(_SLICE // self.elements, round(_REWEIGH / settings.pace)))
        every = max(1, round(_REWEIGH / (chunk * settings.pace)))
        while self._place + chunk <= target:
            if self._place // chunk % every == 0:
                self._layout = self._weighed(self._state)
            a, b = self._at(self._place), self._at(self._place + chunk)
            self._push(chunk, a, b, settings.damping)
            self._place += chunk
            self._context.report(b / last if last else 1.0, f"shrinkage s = {b:.3f}")

    def _push(self, count: int, a: float, b: float, damping: float) -> None:
        self._rest = self._advance(self._state, self._velocity, self._rest, count, a, b, damping)

    def _weighed(self, state: Fixed) -> Layout:
        return reweigh(
            self._layout, state, self._sector.mesh.is_exocarp, *self._moduli, self._fresh_bound, safety=_SAFETY
        )

    def _advance(
        self,
        state: Fixed,
        velocity: Single,
        rest: Array,
        count: int,
        a: float,
        b: float,
        damping: float,
    ) -> Array:
        """March from shrinkage a to b under rest volumes `rest`, and return those that go with the new pressures."""
        self._run(state, velocity, rest, count, a, b, damping)
        settings = self._settings
        if settings.kappa_ratio == settings.march_kappa_ratio:
            return rest
        loaded = self._ready(self._layout, b, rest)
        goal = rests(dilatations(loaded, state, 1 - b), settings.march_kappa_ratio, settings.kappa_ratio)
        # volumes ring for 2 / damping steps; following faster than that feeds what rings
        share = 1 - np.exp(-_FOLLOW * damping * count)
        following: Array = rest * (goal / rest) ** share
        return following

    def _run(
        self,
        state: Fixed,
        velocity: Single,
        rest: Array,
        count: int,
        a: float,
        b: float,
        damping: float,
        layout: Layout | None = None,
    ) -> None:
        """March from shrinkage a to b under rest volumes `rest`; state and velocity change in place."""
        self._context.check_cancelled()
        layout = layout or self._layout
        forget(self._skin, layout)
        for begin, end, steps in self._drive.pieces(a, b, count):
            middle = (begin + end) / 2
            self._drive.lead(state, middle)
            loaded = self._ready(layout, middle, rest)
            skin = march(
                loaded,
                state,
                velocity,
                steps,
                theta=(1 - begin, 1 - end),
                damping=damping,
                one_point=True,
                skin=self._skin,
            )
            assert skin is not None
            self._skin = skin
        self._steps += count
        if out_of_reach(state):
            raise Unstable(
                f"the run blew up at shrinkage s = {b:.3f}.",
                advice="Ask for stages below that, a finer quality, or a thicker exocarp.",
            )

    def _ready(self, layout: Layout, shrinkage: float, rest: Array) -> Layout:
        """Return `layout` with the targets at `shrinkage` and the rest volumes; the last one made is kept."""
        if self._made is None or self._made[0] is not rest or not self._drive.loading.uniform:
            self._made = rest, rested(self._drive.loaded(self._layout, shrinkage), rest)
        planes = self._made[1]
        return dataclasses.replace(planes, mass=layout.mass, inverse_mass=layout.inverse_mass)

    def _settle(self, state: Fixed, velocity: Single, rest: Array, shrinkage: float) -> State:
        """Hold the shrinkage until forces balance *and* the surface has come to rest.

        Just past the onset the forces nearly balance while buckles still grow, so the residual alone would stop there.
        It swings to where the energy leads: after the onset buckles go on merging for thousands of steps, along ways
        so soft that damping would only delay them. Kinetic damping knows no rate (Day 1965, Cundall 1976): all stands
        still whenever the kinetic energy begins to fall, for there the potential was about least. Then it is calmed,
        and swings again if it was not there yet.
        """
        settings = self._settings
        surface = self._surface(state)
        if shrinkage == 0:
            whole = self._sector.whole(surface)
            return State(whole, shrinkage, 0.0, 0.0, self._steps, 1.0, 0.0, 0.0)  # free of stress: nothing to settle
        copies = self._sector.copies
        before = float(self._report(state, rest, shrinkage).energy.sum()) if self._with_release else None
        spent, residual, drift = 0, np.inf, np.inf
        while (residual > settings.residual or drift > settings.drift) and spent < settings.settle_steps:
            if spent or shrinkage > settings.start:
                self._swing(state, velocity, rest, shrinkage)
                spent += settings.swing_steps
            layout, rested = self._weighed(state), 0
            while (residual > settings.residual or drift > settings.drift) and rested < settings.calm_steps:
                surface = self._surface(state)
                # rest volumes stay: under some that go on following, forces have no potential and hardly balance
                count = min(_REST_STEPS, max(20, _SLICE // self.elements))
                self._run(state, velocity, rest, count, shrinkage, shrinkage, settings.calm_damping, layout)
                rested += count
                residual = self._residual(state, rest, shrinkage, layout, settings.calm_damping)
                moved = np.square(self._surface(state) - surface).sum(axis=1).mean()
                drift = float(np.sqrt(moved) / count * _REST_STEPS / self._params.exocarp_thickness)
            spent += rested
        report = self._report(state, rest, shrinkage)
        least = float(report.least_ratio.min())
        if least <= 0:
            raise Unstable(
                f"elements turned inside out at shrinkage s = {shrinkage:.3f} (least J {least:.2f}).",
                advice="Ask for stages below that, a finer quality, or a thicker exocarp.",
                residual=residual,
            )
        energy = float(report.energy.sum())
        released = copies * (before - energy) if before is not None else None
        whole = self._sector.whole(self._surface(state))
        return State(whole, shrinkage, residual, drift, self._steps, least, copies * energy, released)

    def _swing(self, state: Fixed, velocity: Single, rest: Array, shrinkage: float) -> None:
        """Let the state fall for `swing_steps`, standing still at each peak of the kinetic energy."""
        settings = self._settings
        count = settings.swing_steps // _LOOKS
        last, layout = 0.0, self._layout
        for look in range(_LOOKS):
            if look % _WEIGH_EVERY == 0:
                layout = self._weighed(state)
            self._run(state, velocity, rest, count, shrinkage, shrinkage, settings.swing_damping, layout)
            energy = float((layout.mass * np.square(velocity[:, :3]).sum(axis=1, dtype=np.float64))[layout.free].sum())
            if energy < last:
                velocity[:] = energy = 0.0
            last = energy

    def _report(self, state: Fixed, rest: Array, shrinkage: float) -> ElementReport:
        layout = self._ready(self._layout, shrinkage, rest)
        return element_report(layout, state, 1 - shrinkage, one_point=True)

    def _residual(self, state: Fixed, rest: Array, shrinkage: float, layout: Layout, damping: float) -> float:
        """Out-of-balance force, contact included: what one step from rest does to the momentum.

        Relative to the root of the sum of squares of all elements' nodal forces. A step moves the nodes before contact
        answers, and damping shortens that move: the balance is struck, and measured, with the damping it settles with.
        """
        theta = 1 - shrinkage
        layout = self._ready(layout, shrinkage, rest)
        scale = internal_force(layout, state, theta, one_point=True).scale
        moved, kick = state.copy(), np.zeros((layout.nodes, 4), np.float32)
        forget(self._skin, layout)
        march(layout, moved, kick, 1, theta=(theta, theta), damping=damping, one_point=True, skin=self._skin)
        momentum = (1 + damping / 2) * (kick[:, :3] * layout.mass[:, None])[layout.free]
        # a fruit without stress has nothing but round-off; that is no lack of balance
        # not `norm`: it is a BLAS dot product, whose rounding depends on the number of threads
        return float(np.sqrt(np.square(momentum).sum())) / max(scale, self._least_force)


def _unit_force(layout: Layout, mu: Array) -> float:
    """Root of the sum of squares of the elements' nodal forces at about unit strain: mu times the mean face."""
    corners = positions(layout.fresh)[layout.connectivity]
    size = np.linalg.norm(corners[:, 7] - corners[:, 0], axis=1) / np.sqrt(3)
    return float(np.sqrt(np.square(mu * size**2).sum()))
