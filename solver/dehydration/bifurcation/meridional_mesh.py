"""The meridional half-plane of an axisymmetric fruit as Q2 elements with discontinuous linear pressure (Q2/P-1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Bools, Floats, Ints
from ...fem import QUAD9, gauss
from ..fresh.closed_form import flat_film_wavelength
from ..fresh.mesh import layer_fractions
from ..params import DehydrationParams

__all__ = ["PER_WAVELENGTH", "MeridionalMesh", "build"]


#: Elements along the surface per flat-film wavelength.
PER_WAVELENGTH = {"preview": 4.0, "default": 6.0, "fine": 9.0}
#: Core layer at the interface in those elements, and by how much of that layers grow inwards, so that a finer mesh is
#: finer everywhere.
_FIRST, _GROWTH = 0.7, 2.0
#: Thickest core layer, as a fraction of the flesh.
_THICKEST = 0.2
#: Fewest elements from pole to pole, and through the skin: one is off by up to 1 % in s_cr, either way.
_FEWEST, _LAYERS = 20, 2


@dataclass(frozen=True, eq=False)
class MeridionalMesh:
    """Columns along rays from the centre, node = column * levels + level, level 0 on the stone.

    colatitude: (columns,) parametric colatitude of each column [radian], 0 to pi. depth: (levels,) 0 on the stone, 1 at
    the interface, 2 on the outer surface, piecewise linear between. position: (columns * levels, 2) fresh (R, Y) [r1].
    nodes: (ne, 9) with local number 3 * across + outwards. gradient: (ne, 9, 3, 9) shape derivatives (N_R, N_Y, N / R)
    at the quadrature points. weight: (ne, 9) with R. pressure: (9, 3). core: (ne,). shear: (ne,) over the core's.
    """

    colatitude: Floats
    depth: Floats
    position: Floats
    nodes: Ints
    gradient: Floats
    weight: Floats
    pressure: Floats
    core: Bools
    shear: Floats

    @property
    def levels(self) -> int:
        """Nodes along a column."""
        return len(self.depth)

    def shrunk(self, s: float) -> Floats:
        """Return Jd (ne, 1) at shrinkage `s`."""
        return np.where(self.core, (1 - s) ** 3, 1.0)[:, None]


def build(params: DehydrationParams, per_wavelength: float, split: int = 1) -> MeridionalMesh:
    """Return the mesh with `per_wavelength` elements per flat-film wavelength along the surface.

    Each element is then split `split` times both ways, for convergence studies.
    """
    wavelength = min(flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio), 1.0)
    fine = np.linspace(0, np.pi, 4001)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*(np.diff(c) for c in params.generatrix(fine))))])
    count = max(math.ceil(per_wavelength * arc[-1] / wavelength), _FEWEST)
    size = arc[-1] / count
    count *= split
    colatitude = np.interp(np.linspace(0, arc[-1], 2 * count + 1), arc, fine)
    first = min(_FIRST * size, wavelength)
    flesh = float(np.mean(params.radii[:7])) - min(params.stone)
    core = layer_fractions(max(flesh, 0.05), first, 1 + _GROWTH / per_wavelength)
    # the flesh moves most unevenly next to the stone, where layers would be thickest
    core = np.sort(np.concatenate([core, ((core[1:] + core[:-1]) / 2)[np.diff(core) > _THICKEST]]))
    layers = max(_LAYERS, round(2 * params.exocarp_thickness / size))
    breaks = np.concatenate([core, 1 + np.arange(1, layers + 1) / layers])
    breaks = np.interp(np.arange((len(breaks) - 1) * split + 1) / split, np.arange(len(breaks)), breaks)
    depth = np.sort(np.concatenate([breaks, (breaks[1:] + breaks[:-1]) / 2]))

    surface = np.stack(params.generatrix(colatitude), axis=-1)
    surface[[0, -1], 0] = 0.0
    distance = np.linalg.norm(surface, axis=1)
    rays = surface / distance[:, None]
    stone = params.stone_distance(np.stack([rays[:, 0], rays[:, 1], np.zeros(len(rays))], axis=-1))
    inner, outer = np.minimum(depth, 1.0), np.maximum(depth - 1.0, 0.0)
    reach = stone[:, None] + (distance - stone)[:, None] * inner + params.exocarp_thickness * outer
    position = (rays[:, None, :] * reach[..., None]).reshape(-1, 2)

    levels, steps = len(depth), np.arange(3)
    column, layer = np.meshgrid(np.arange(count), np.arange(len(breaks) - 1), indexing="ij")
    base = (2 * column * levels + 2 * layer).ravel()
    nodes = base[:, None] + (steps[:, None] * levels + steps).ravel()
    is_core = layer.ravel() < (len(core) - 1) * split
    points, weights = gauss(3, 2)
    shape, local = QUAD9.shape(points), QUAD9.gradients(points).transpose(2, 0, 1)
    corners = position[nodes]
    jacobian = np.einsum("kqn,enx->eqkx", local, corners)
    gradient = np.empty((len(nodes), 9, 3, 9))
    gradient[:, :, :2] = np.linalg.solve(jacobian, np.broadcast_to(local.transpose(1, 0, 2), (len(nodes), 9, 2, 9)))
    radius = np.einsum("qn,en->eq", shape, corners[..., 0])
    gradient[:, :, 2] = shape / radius[..., None]
    weight = np.abs(np.linalg.det(jacobian)) * weights * radius
    pressure = np.concatenate([np.ones((9, 1)), points], axis=1)
    shear = np.where(is_core, 1.0, params.modulus_ratio)
    return MeridionalMesh(colatitude, depth, position, nodes, gradient, weight, pressure, is_core, shear)
