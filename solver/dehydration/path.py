"""The march along shrinkage: from a smooth start, past the onset, to stages that are settled on the side.

The march depends on the parameters and the quality alone. A stage is settled on a copy of the marching state, so what
else was asked for never changes a stage's shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contract import Context, Unstable
from .contact import PAIRS
from .imperfection import bumps
from .kernel import build_layout, internal_force, make_skin, march, new_state, out_of_reach, positions
from .mesh import FruitMesh, build_mesh
from .params import DehydrationParams
from .settings import Settings

__all__ = ["Path", "State"]

Array = NDArray[np.float64]
Fixed = NDArray[np.int32]
Single = NDArray[np.float32]

#: Factor on the scaled masses: elements in a crease stiffen as they are squeezed, and below 2 a crease on a coarse
#: mesh blows up at s = 0.22 where 2.5 carries it to 0.3 (te = 0.04, gamma = 10, n = 18).
_SAFETY = 2.5

#: Steps over which the surface's drift is measured.
_REST_STEPS = 200

#: Element-steps between two looks at the observer: about a quarter of a second on one core.
_SLICE = 8_000_000


@dataclass(frozen=True, eq=False)
class State:
    """A settled stage: nodes of the outer surface (nc, 3), how settled it is, and the steps spent so far.

    residual: out-of-balance force over internal force. drift: rms motion of the surface in the last 200 steps, in
    exocarp thicknesses.
    """

    surface: Array
    shrinkage: float
    residual: float
    drift: float
    steps: int


class Path:
    """One fruit's way from fresh to dry."""

    def __init__(self, params: DehydrationParams, settings: Settings, context: Context) -> None:
        self._params, self._settings, self._context = params, settings, context
        self.mesh: FruitMesh = build_mesh(params, settings.n, settings.core)
        mesh = self.mesh
        # waves that the mesh cannot carry (fewer than four nodes) would be noise that depends on it
        heights = bumps(mesh.sphere.directions, context.generator(params.seed), highest=settings.n)
        fade = (heights[:, None] * mesh.depth[None, :] ** 2).reshape(-1, 1)
        bumpy = mesh.positions + params.imperfection * fade * np.repeat(mesh.rays, mesh.levels, axis=0)
        mu = np.where(mesh.is_exocarp, params.modulus_ratio, 1.0)
        self._layout = build_layout(
            bumpy, mesh.connectivity, mesh.is_exocarp, mu, settings.kappa_ratio * mu, mesh.fixed, safety=_SAFETY, one_point=False
        )
        quads = mesh.sphere.quads
        self._skin = make_skin(
            self._layout, mesh.surface_nodes, quads, settings.clearance * params.exocarp_thickness, params.exocarp_thickness
        )
        self._state, self._velocity = new_state(self._layout)
        self._steps = 0
        self._shrinkage = 0.0
        self._place = 0
        self._begun = False

    @property
    def elements(self) -> int:
        """Number of hexahedra."""
        return self._layout.elements

    @property
    def surface_nodes(self) -> NDArray[np.int64]:
        """Nodes of the outer surface, in column order."""
        return self.mesh.surface_nodes

    def stage(self, shrinkage: float, last: float) -> State:
        """Return the settled state at `shrinkage`; stages are asked for in ascending order, up to `last`.

        Raises:
            Cancelled: the observer asked to stop.
            Unstable: the state left the finite.

        """
        if shrinkage > self._settings.start:
            self._march(shrinkage, last)
            state, velocity = self._state.copy(), self._velocity.copy()
        else:
            state, velocity = self._smooth(shrinkage)
        return self._settle(state, velocity, shrinkage)

    def _smooth(self, shrinkage: float) -> tuple[Fixed, Single]:
        """Return the start at `shrinkage`: the closed form along each ray, exact for spheres, at rest."""
        mesh = self.mesh
        fresh = positions(self._layout.fresh)
        distance = np.linalg.norm(fresh, axis=1)
        columns = distance.reshape(-1, mesh.levels)
        stone, interface = columns[:, :1], columns[:, np.argmax(mesh.depth) : np.argmax(mesh.depth) + 1]
        moved = np.where(
            mesh.depth[None, :] < 1,
            np.cbrt(stone**3 + (1 - shrinkage) ** 3 * (columns**3 - stone**3)),
            np.cbrt(stone**3 + (1 - shrinkage) ** 3 * (interface**3 - stone**3) + columns**3 - interface**3),
        )
        return new_state(self._layout, fresh * (moved.reshape(-1) / distance)[:, None])

    def _march(self, shrinkage: float, last: float) -> None:
        settings = self._settings
        if not self._begun:
            self._state, self._velocity = self._smooth(settings.start)
            # the closed form is incompressible, the elements are nearly so: let the difference ring down
            self._advance(self._state, self._velocity, 400, settings.start, settings.start, 0.05)
            self._begun, self._place = True, 0
        target = int((shrinkage - settings.start) / settings.pace)
        chunk = max(20, _SLICE // self.elements)
        while self._place < target:
            count = min(chunk, target - self._place)
            a = settings.start + self._place * settings.pace
            b = settings.start + (self._place + count) * settings.pace
            self._advance(self._state, self._velocity, count, a, b, settings.damping)
            self._place += count
            self._context.report(b / last if last else 1.0, f"shrinkage s = {b:.3f}")

    def _advance(self, state: Fixed, velocity: Single, count: int, a: float, b: float, damping: float) -> None:
        self._context.check_cancelled()
        skin = march(self._layout, state, velocity, count, theta=(1 - a, 1 - b), damping=damping, skin=self._skin)
        assert skin is not None
        self._skin = skin
        self._steps += count
        if out_of_reach(state):
            raise Unstable(
                f"the run blew up at shrinkage s = {b:.3f}.",
                advice="Ask for stages below that, a finer quality, or a thicker exocarp.",
            )

    def _settle(self, state: Fixed, velocity: Single, shrinkage: float) -> State:
        """Hold the shrinkage until forces balance *and* the surface has come to rest.

        Just past the onset the forces nearly balance while buckles still grow, so the residual alone would stop there.
        """
        settings = self._settings
        surface = positions(state[self.surface_nodes])
        if shrinkage == 0:
            return State(surface, shrinkage, 0.0, 0.0, self._steps)  # free of stress: nothing to settle
        chunk = max(20, min(_REST_STEPS, _SLICE // self.elements))
        spent, residual, drift = 0, np.inf, np.inf
        while (residual > settings.residual or drift > settings.drift) and spent < settings.settle_steps:
            touching = self._skin.contact.counts[PAIRS] > 0
            damping = settings.touching_damping if touching else settings.settle_damping
            self._advance(state, velocity, chunk, shrinkage, shrinkage, damping)
            spent += chunk
            residual = self._residual(state, shrinkage)
            moved = positions(state[self.surface_nodes])
            speed = np.sqrt(np.square(moved - surface).sum(axis=1).mean()) / chunk
            drift = float(speed * _REST_STEPS / self._params.exocarp_thickness)
            surface = moved
        return State(surface, shrinkage, residual, drift, self._steps)

    def _residual(self, state: Fixed, shrinkage: float) -> float:
        """Out-of-balance force, contact included: what one step from rest would do to the momentum.

        Relative to the root of the sum of squares of all elements' nodal forces.
        """
        layout, theta = self._layout, 1 - shrinkage
        scale = internal_force(layout, state, theta).scale
        moved, kick = state.copy(), np.zeros((layout.nodes, 4), np.float32)
        march(layout, moved, kick, 1, theta=(theta, theta), damping=0.0, skin=self._skin)
        momentum = (kick[:, :3] * layout.mass[:, None])[layout.free]
        return float(np.linalg.norm(momentum)) / scale if scale > 0 else 0.0
