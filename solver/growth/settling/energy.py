"""The energy of one growth step: membrane, bending, pressure, solids as penalties, a bed, held vertices.

Pressure, and what compression pushes, are dead loads, laid anew along the normals from time to time. What pressure does
to a closed surface is the work on the volume inside, -p V(x), so there it may follow every move (`following`): then its
second derivative is at hand too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import bsr_array

from ... import shell
from ...arrays import Floats, Ints
from ...linalg.multifrontal import Analysis
from ...shell.inverse import fronts_of, inverse_of
from ...shell.normals import normals
from ..matter import softer
from ..params import Bending
from ..solids import Solid
from ..state import State
from ..tooling.holding import free_shares
from .bed import Bed
from .loads import area_vectors, balanced, compressed, half_way
from .minimise import longest
from .tangent import LEAF, Tangent
from .touching import Touching

__all__ = ["StepEnergy", "ahead", "elastic", "vertex_areas"]

#: Added to the tangent's diagonal [mu]: it takes out the rigid motions and steadies what is about to buckle.
_SHIFT = 1e-5
#: Stiffness of a membrane's vertex [mu]: about the diagonal of six equilateral triangles.
_STIFFEST = 10.0
#: Penalty of solids per area and depth [mu / l^2].
_HARDNESS = 30.0


def elastic(state: State, material: shell.Material, bending: Bending) -> float:
    """Return the energy of stretching and bending of a state, in mu l^2."""
    return StepEnergy(state, material, 0.0, (), Tangent(state.mesh), bending=bending)(state.x)[0]


def vertex_areas(state: State) -> Floats:
    """Return the rest areas (n,) of vertices."""
    thirds = np.repeat(shell.areas(state.g) / 3, 3)
    return np.bincount(state.mesh.triangles.ravel(), thirds, len(state.x)).astype(np.float64)


def ahead(energy: StepEnergy, state: State, dt: float) -> Floats:
    """Return where the shape comes to if it moves on as in the last step, or where it is if that costs less."""
    if state.drift is None:
        return state.x
    x = state.x + energy.allowed(state.x, state.drift, dt) * state.drift
    least = energy(state.x)[0]
    return x if energy(x)[0] < least else state.x


class StepEnergy:
    """Energy of positions (n, 3) against a state's rest metrics and angles, in mu l^2."""

    def __init__(
        self,
        state: State,
        material: shell.Material,
        pressure: float,
        solids: Sequence[Solid],
        tangent: Tangent,
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        distance: float = 0.0,
        bending: Bending = "hinges",
        following: bool = False,
        pushing: float = 0.0,
    ) -> None:
        #: Whether the pressure does its work on the volume: it cannot where the surface has a border.
        self.following = following and bool(pressure) and not len(state.mesh.border)
        self.state, self.material, self.solids, self.tangent = state, material, solids, tangent
        self._pressure, self._gravity, self._bending, self._pushing = pressure, gravity, bending, pushing
        self._sheet = shell.Halves(state.mesh)
        self.stiffness = shell.hinge_stiffness(state.g, state.mesh, material.flexural)
        self._mean = shell.mean_stiffness(state.g, state.mesh, material.flexural) if bending != "hinges" else None
        thick = state.matter.get("thick")
        #: Thickness over the sheet's of triangles (f,), None where it is 1 everywhere.
        self.thick = None if thick is None else thick[state.mesh.triangles].mean(axis=1)
        if thick is not None:
            self.stiffness *= thick[state.mesh.hinges[:, :2]].mean(axis=1) ** 3
            self._mean = None if self._mean is None else (self._mean[0], self._mean[1] * thick**3)
        if "stiff" in state.matter:
            stiff = state.matter["stiff"]
            self.stiffness *= np.exp(stiff[state.mesh.hinges[:, :2]].mean(axis=1))
            self._mean = None if self._mean is None else (self._mean[0], self._mean[1] * np.exp(stiff))
        if state.loose is not None:
            hinges, corners = free_shares(state)
            self.stiffness /= hinges
            self._mean = None if self._mean is None else (self._mean[0], self._mean[1] / corners)
        self._fixed: Floats | None = None
        #: What compression pushes (n, 3), None where it does not.
        self.pushed: Floats | None = None
        self.free = ~state.held
        #: Which blocks of the last `hessian` are on the diagonal (n,).
        self.diagonal: Ints = np.empty(0, np.int64)
        self._last: tuple[Floats, float, Floats] | None = None
        #: How far a vertex may move in a step.
        self._room = min((half_way(solid) for solid in solids), default=np.inf)
        #: Whether the last step asked for was not allowed whole.
        self.cut = False
        self.areas = vertex_areas(state)
        self.bed = Bed.under(state, self.areas)
        unit = state.length * softer(state, material.flexural)
        self.touching = Touching(state, distance, unit, self.areas) if distance else None
        self.follow(state.x)

    def follow(self, x: Floats) -> None:
        """Lay pressure, and what compression pushes, along the normals at x (n, 3): dead loads until the next time."""
        self._last, self._fixed = None, None
        if self._pressure and not self.following:
            self._fixed = self._pressure * area_vectors(x, self.state.mesh.triangles)
        if any(self._gravity):
            weight = self.areas[:, None] * np.array(self._gravity)
            if "thick" in self.state.matter:
                weight *= self.state.matter["thick"][:, None]
            self._fixed = weight if self._fixed is None else self._fixed + weight
        if self._pushing:
            mesh, g = self.state.mesh, self.state.g
            pushed = self._pushing * compressed(x, mesh.triangles, g, self.material.lame, self.thick)
            self.pushed = balanced(pushed, self.areas, self.rigid(x))

    def lay(self, before: Floats | None, share: float) -> None:
        """Go only a share of the way from what compression pushed before (n, 3) to what it pushes now."""
        if before is not None and self.pushed is not None:
            self._last, self.pushed = None, before + share * (self.pushed - before)

    @property
    def load(self) -> Floats | None:
        """All dead loads (n, 3), None where there are none."""
        if self.pushed is None:
            return self._fixed
        return self.pushed if self._fixed is None else self._fixed + self.pushed

    def __call__(self, x: Floats) -> tuple[float, Floats]:
        """Return energy and gradient; the gradient of held directions is 0. What was asked last is remembered."""
        if self._last is None or self._last[0] is not x:
            self._last = x, *self._at(x)
        return self._last[1:]

    def _at(self, x: Floats) -> tuple[float, Floats]:
        state, gradient = self.state, np.zeros_like(x)
        sheet = state.g, self.material.lame
        if self._mean is None:
            energy = self._sheet(x, *sheet, self.thick, state.rest, self.stiffness, gradient)
        else:
            energy = shell.membrane(x, state.mesh.triangles, *sheet, gradient, self.thick)
            energy += shell.mean_bending(x, state.mesh.hinges, state.rest, *self._mean, gradient)
        load = self.load
        if load is not None:
            energy -= float(np.vdot(load, x - state.x))
            gradient -= load
        if self.following:
            outward = area_vectors(x, state.mesh.triangles)
            energy -= self._pressure * float(np.vdot(outward, x)) / 3
            gradient -= self._pressure * outward
        if self.touching:
            energy += self.touching.energy(x, gradient)
        if self.bed:
            energy += self.bed.energy(x, gradient)
        for solid in self.solids:
            depth, normal = solid.depth(x)
            energy += 0.5 * _HARDNESS * float(self.areas @ (depth * depth))
            gradient -= (_HARDNESS * self.areas * depth)[:, None] * normal
        gradient[state.held] = 0.0
        return energy, gradient

    def part(self, state: State, tangent: Tangent) -> StepEnergy:
        """Return the same energy, without contact, of a part of the state."""
        rest = tangent, self._gravity, 0.0, self._bending
        return StepEnergy(state, self.material, self._pressure, self.solids, *rest, pushing=self._pushing)

    def rounding(self, x: Floats) -> float:
        """Return the largest force that is rounding: what it changes by where x moves by last digits.

        And what no step can take away, because the energy changes by less than its own rounding: (2 stiffness x
        rounding of the energy)^(1/2), with the stiffness of a membrane's vertex and the energy's terms in magnitude.
        """
        signs = np.where(np.arange(x.size).reshape(x.shape) * 2654435761 % 2**32 < 2**31, 1.0, -1.0)
        energy, gradient = self(x)
        moved = self(x + signs * np.spacing(np.abs(x).max()))[1]
        terms = abs(energy)
        if self.load is not None:
            terms += float(np.abs(self.load * (x - self.state.x)).sum())
        digits = np.finfo(float).eps
        return float(longest(moved - gradient) + np.sqrt(2 * _STIFFEST * digits * terms))

    def allowed(self, x: Floats, way: Floats, wanted: float) -> float:
        """Return how much of `way` (n, 3), at most `wanted`, may be gone from x in one step."""
        found = self.touching.allowed(x, way, wanted) if self.touching else wanted
        if self._room < np.inf:
            # no vertex jumps over a solid: beyond its middle it would be pushed out on the other side
            speed = float(np.sqrt((way * way).sum(axis=1).max()))
            found = min(found, self._room / max(speed, 1e-300))
        self.cut = found < wanted
        return found

    @property
    def ready(self) -> bool:
        """Whether there is an inverse."""
        return self.tangent.inverse is not None

    @property
    def curved(self) -> bool:
        """Whether `hessian` is that of this energy: bending by mean curvature has none here."""
        return self._mean is None

    def hessian(self, x: Floats) -> bsr_array:
        """Return the second derivative (3n, 3n) of positions (n, 3) in blocks; unit rows and columns where held."""
        state = self.state
        coupled = self.touching.coupled(x, LEAF) if self.touching else None
        pattern = coupled[0] if coupled else self.tangent.pattern
        mesh, lame = state.mesh, self.material.lame
        blocks = np.zeros((pattern.blocks, 3, 3))
        shell.membrane_hessian(x, mesh.triangles, state.g, lame, pattern.of_triangles, blocks, self.thick)
        angles = shell.angles(x, mesh.hinges)
        shell.bending_hessian(x, mesh.hinges, angles, state.rest, self.stiffness, pattern.of_hinges, blocks)
        if self.following:
            shell.volume_hessian(x, mesh.triangles, -self._pressure, pattern.of_triangles, blocks)
        self._add_ground(x, pattern.diagonal, blocks)
        if self.touching and coupled:
            self.touching.add_hessian(x, pattern, blocks)
        free = ~state.held
        rows = np.repeat(np.arange(len(x)), np.diff(pattern.indptr))
        blocks *= free[rows][:, :, None] & free[pattern.indices][:, None, :]
        blocks[pattern.diagonal] += np.eye(3) * state.held[:, None, :]
        self.diagonal = pattern.diagonal
        return bsr_array((blocks, pattern.indices, pattern.indptr))

    def analysis(self, x: Floats) -> Analysis:
        """Return the order in which to eliminate `hessian`."""
        coupled = self.touching.coupled(x, LEAF) if self.touching else None
        return coupled[1] if coupled else self.tangent.analysis(x)

    def rigid(self, x: Floats) -> Floats:
        """Return motions (3n, k), orthonormal, that no force is felt along: turns and shifts that no held vertex stops.

        None where solids or weight tell one place from another; a bed does along its normals.
        """
        if self.solids or any(self._gravity):
            return np.empty((x.size, 0))
        arms = x - x.mean(axis=0)
        turns = [np.cross(axis, arms) for axis in np.eye(3)]
        motions = np.stack([*(np.broadcast_to(axis, x.shape) for axis in np.eye(3)), *turns]).reshape(6, -1)
        motions = (motions / np.linalg.norm(motions, axis=1)[:, None]).T
        stopped = motions[self.state.held.ravel()]
        if self.bed:
            stopped = np.concatenate([stopped, self.bed.felt(motions)])
        if len(stopped):
            # of as many rows as are held the left vectors would fill the memory
            _, sizes, ways = np.linalg.svd(stopped, full_matrices=len(stopped) < len(motions.T))
            size = np.zeros(6)
            size[: len(sizes)] = sizes
            motions = motions @ ways[size < 1e-9].T
        return np.linalg.qr(motions)[0]

    def _add_ground(self, x: Floats, diagonal: Ints, blocks: Floats) -> None:
        """Add the stiffness of bed and solids at each vertex to the diagonal of `blocks` (nnz, 3, 3)."""
        if self.bed:
            self.bed.add_hessian(diagonal, blocks)
        for solid in self.solids:
            depth, normal = solid.depth(x)
            weight = np.where(depth > 0, _HARDNESS * self.areas, 0.0)
            blocks[diagonal] += weight[:, None, None] * normal[:, :, None] * normal[:, None, :]

    def refactor(self, x: Floats) -> Iterator[None]:
        """Take the inverse of the positive semidefinite tangent at x, shifted; yields after pieces of the work."""
        state, tangent = self.state, self.tangent
        if tangent.fronts is None:
            tangent.fronts = fronts_of(state.mesh, x)
            yield
        new, pattern = "pattern" not in tangent.__dict__, tangent.pattern
        if new:
            yield
        blocks = np.zeros((pattern.blocks, 3, 3))
        triangles, lame = state.mesh.triangles, self.material.lame
        shell.membrane_tangent(x, triangles, state.g, lame, pattern.of_triangles, blocks, self.thick)
        shell.bending_tangent(x, state.mesh.hinges, self.stiffness, pattern.of_hinges, blocks)
        blocks[pattern.diagonal] += _SHIFT * np.eye(3)
        self._add_ground(x, pattern.diagonal, blocks)
        if self.touching:
            self.touching.add_diagonal(x, pattern.diagonal, blocks)
        yield
        n = normals(x, state.mesh.triangles)
        tangent.inverse = yield from inverse_of(tangent.fronts, pattern, blocks, n, np.asarray(state.held.all(axis=1)))

    def precondition(self, v: Floats) -> Floats:
        """Return the last inverse applied to v (n, 3)."""
        assert self.tangent.inverse is not None
        found = self.tangent.inverse.apply(v)
        found[self.state.held] = 0.0
        return found
