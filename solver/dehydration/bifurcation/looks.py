"""What is seen of the modes on one mesh, and how they go to another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...arrays import Floats
from ...fem import QUAD9, gauss
from ..implicit import BaseState, Model, Patch
from ..implicit.buckling import Crossing, Path, parities
from ..implicit.location import interpolate
from ..params import DehydrationParams

__all__ = ["SAME", "Look", "Pair", "elsewhere", "even", "nodal", "wavenumber"]


#: Onsets this close count as one, and wavenumbers.
SAME, ALIKE = 5e-4, 0.03
#: Power of the wavenumber with which what a mesh adds to onsets grows: 3.9 to 4.7 from degree to degree of spheres.
SHORTER = 4.5
#: A mode goes to the finer mesh if this much over the first limit is expected of it.
NEAR = 1e-3
#: A mode this low on a plane is the same whatever its parity about it.
STILL = 0.1


@dataclass(frozen=True)
class Look:
    """What one mesh of the whole part, or of a patch, showed: crossings sorted, the lowest first."""

    model: Model
    patch: Patch | None
    path: Path
    state: BaseState
    found: list[Crossing]

    @property
    def first(self) -> Crossing:
        """The lowest."""
        return self.found[0]

    def of(self, parity: tuple[int, ...]) -> Crossing:
        """Return the crossing of a parity that was found."""
        return next(each for each in self.found if each.parity == parity)

    def heights(self) -> Floats:
        """Return the first mode's size at all nodes, (nn,)."""
        found: Floats = np.linalg.norm(nodal(self.model, self.first.mode), axis=1)
        return found

    def extent(self) -> tuple[Floats, float]:
        """Return the middle (3,) of the first mode, and its largest size beyond 3/4 of the patch's radius."""
        mesh, patch = self.model.mesh, self.patch
        assert patch is not None
        top, size = mesh.positions[mesh.levels - 1 :: mesh.levels], self.heights()[mesh.levels - 1 :: mesh.levels]
        middle: Floats = (size**2 @ top) / (size @ size)
        outside = size[np.linalg.norm(top - patch.centre, axis=1) > 0.75 * patch.radius]
        return middle, float(outside.max(initial=0.0) / size.max())

    def others(self) -> list[tuple[int, ...]]:
        """Return the parities besides the even one that could tell another onset: about planes that the mode meets."""
        mesh, size = self.model.mesh, self.heights()
        met = [size[mesh.positions[:, axis] == 0].max(initial=0.0) > STILL * size.max() for axis in mesh.planes]
        every = [parity for parity, _ in parities(self.model)][1:]
        return [parity for parity in every if all(one > 0 or there for one, there in zip(parity, met, strict=True))]


class Pair(NamedTuple):
    """Two looks at the same part on a coarse and on a finer mesh, and s_cr's order in the size of elements.

    What was found on the finer one was found on the coarse one. asked: parities that were looked for on the finer one
    beside those.
    """

    coarse: Look
    fine: Look
    order: float
    asked: tuple[tuple[int, ...], ...] = ()

    def limits(self) -> list[Crossing]:
        """Return the modes of the finer mesh with the limits of both, sorted."""
        ratio = len(self.fine.model.mesh.quad_of[0]) / len(self.coarse.model.mesh.quad_of[0])
        found = []
        for each in self.fine.found:
            fallen = self.coarse.of(each.parity).shrinkage - each.shrinkage
            found.append(each._replace(shrinkage=each.shrinkage - fallen / (ratio**self.order - 1)))
        return sorted(found, key=lambda each: each.shrinkage)

    def later(self, within: float) -> list[Crossing]:
        """Return the coarse mesh's other modes with the limits that are expected of them, sorted.

        Only those `within` this of the first, relative, that none of the finer mesh's modes stands for. What the coarse
        mesh adds to an onset is taken from the first's, and grows with the wavenumber.
        """
        first = self.limits()[0]
        known = [(each, wavenumber(self.coarse.model, each.mode)) for each in self.coarse.found]
        seen = [(each, k) for each, k in known if any(each.parity == other.parity for other in self.fine.found)]
        added, short = next((each.shrinkage - first.shrinkage, k) for each, k in seen if each.parity == first.parity)
        found = []
        for each, k in known:
            # fruits that are nearly spheres have the same mode turned by quarters
            if any(abs(each.shrinkage / o.shrinkage - 1) < SAME and abs(k / other - 1) < ALIKE for o, other in seen):
                continue
            expected = each.shrinkage - added * (k / short) ** SHORTER
            if expected < (1 + within) * first.shrinkage:
                found.append(each._replace(shrinkage=max(expected, first.shrinkage)))
        return sorted(found, key=lambda each: each.shrinkage)

    def rival(self) -> Crossing | None:
        """Return the coarse mesh's mode that may come before those of the finer one, if any."""
        return next((each for each in self.later(NEAR) if each.parity not in self.asked), None)


def wavenumber(model: Model, mode: Floats) -> float:
    """Return the root mean square of a mode's slope over that of its size, on the outer surface [1/r1]."""
    mesh = model.mesh
    top = mesh.stacks * mesh.levels + mesh.levels - 1
    places, sizes = mesh.positions[top], nodal(model, mode)[top]
    at, weights = gauss(3, 2)
    tangents = np.einsum("sai,qak->sqik", places, QUAD9.gradients(at))
    metric = tangents.swapaxes(2, 3) @ tangents
    area = weights * np.sqrt(np.linalg.det(metric))
    slopes = np.einsum("sai,qak->sqik", sizes, QUAD9.gradients(at))
    steep = np.einsum("sqik,sqkl,sqil->sq", slopes, np.linalg.inv(metric), slopes)
    high = (np.einsum("sai,qa->sqi", sizes, QUAD9.shape(at)) ** 2).sum(axis=2)
    return float(np.sqrt((area * steep).sum() / (area * high).sum()))


def nodal(model: Model, mode: Floats) -> Floats:
    """Return a mode at all nodes, (nn, 3): 0 on the stone."""
    found: Floats = np.zeros_like(model.mesh.positions)
    found[model.pattern.free >= 0] = mode
    return found


def even(model: Model) -> tuple[int, ...]:
    """Return the parity that is even about all planes."""
    return next(parities(model))[0]


def elsewhere(params: DehydrationParams, model: Model, mode: Floats, to: Model) -> Floats:
    """Return a mode (nf, 3) on another mesh's nodes off the stone."""
    return interpolate(params, model.mesh, nodal(model, mode), to.mesh.positions[to.pattern.free >= 0])
