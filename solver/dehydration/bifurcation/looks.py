"""What is seen of the modes on one mesh, and how they go to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Floats
from ..implicit import BaseState, Model, Patch
from ..implicit.buckling import Crossing, Path, parities
from ..implicit.location import interpolate
from ..params import DehydrationParams

__all__ = ["Look", "elsewhere", "even", "nodal"]


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
