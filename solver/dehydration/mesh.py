"""Structured hexahedra of a fruit: an equiangular cubed sphere times radial layers, and sampling of its surface.

The cubed sphere lives on the parametric unit sphere of `solver.fruit` (y carries the poles), so that every fruit of
a table shares one topology. Columns of elements run along rays from the centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

from ..fruit import Fruit, directions, lattice

if TYPE_CHECKING:
    import skfem

__all__ = ["CubedSphere", "FruitMesh", "Sampler", "build_mesh", "cubed_sphere", "layer_fractions"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: The six faces: outward axis, first and second tangent, each triple right-handed.
_FACES = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    ],
    dtype=float,
)


@dataclass(frozen=True, eq=False)
class CubedSphere:
    """Equiangular cubed sphere with `n` elements along each of the 12 edges.

    directions: (nd, 3) nodes on the unit sphere. faces: (6, n+1, n+1) node numbers of each face, by first and second
    tangent. quads: (6 n^2, 4) corners, counter-clockwise seen from outside.
    """

    n: int
    directions: Array
    faces: Indices
    quads: Indices


@lru_cache(maxsize=4)
def cubed_sphere(n: int) -> CubedSphere:
    """Return the cubed sphere with `n` elements per edge; shared and read-only."""
    t = np.tan(np.linspace(-np.pi / 4, np.pi / 4, n + 1))
    a, b = np.meshgrid(t, t, indexing="ij")
    points = np.stack([axis + a[..., None] * u + b[..., None] * v for axis, u, v in _FACES]).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    # nodes on shared edges coincide up to round-off; 1e-7 is far below any spacing in use
    _, first, inverse = np.unique(
        np.round(points * 1e7).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = inverse.reshape(6, n + 1, n + 1)
    quads = np.stack([faces[:, :-1, :-1], faces[:, 1:, :-1], faces[:, 1:, 1:], faces[:, :-1, 1:]], axis=-1)
    sphere = CubedSphere(n, points[first], faces, quads.reshape(-1, 4))
    for array in (sphere.directions, sphere.faces, sphere.quads):
        array.flags.writeable = False
    return sphere


@dataclass(frozen=True, eq=False)
class FruitMesh:
    """Hexahedra between stone and outer surface.

    positions: (nn, 3) perfect fresh positions; node = column * levels + level, level 0 on the stone.
    connectivity: (ne, 8) corners with local bits xi = 4, eta = 2, zeta = 1, zeta outwards, right-handed.
    is_exocarp: (ne,). rays: (nc, 3) unit ray of each column. parametric: (nc, 3) its direction on the parametric
    sphere. depth: (levels,) fraction of the flesh from stone (0) to interface (1), 1 in the exocarp.
    """

    sphere: CubedSphere
    positions: Array
    connectivity: Indices
    is_exocarp: NDArray[np.bool_]
    rays: Array
    depth: Array

    @property
    def levels(self) -> int:
        """Nodes along a column."""
        return len(self.depth)

    @property
    def surface_nodes(self) -> Indices:
        """(nc,) nodes of the outer surface, in column order."""
        return np.arange(len(self.rays)) * self.levels + self.levels - 1

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """(nn,) nodes that sit on the rigid stone."""
        return np.tile(np.arange(self.levels) == 0, len(self.rays))

    def to_skfem(self) -> skfem.MeshHex:
        """Return the same mesh as a scikit-fem object, for bases, mappings, integration and independent checks."""
        import skfem

        # scikit-fem counts corners of the unit cube in its own order; match them by place instead of by memory
        ours = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)], dtype=float)
        theirs = skfem.MeshHex.init_refdom().p.T
        order = [int(np.flatnonzero((ours == corner).all(axis=1))[0]) for corner in theirs]
        return skfem.MeshHex(
            np.ascontiguousarray(self.positions.T), np.ascontiguousarray(self.connectivity[:, order].T), sort_t=False
        )


def layer_fractions(flesh: float, first: float, growth: float) -> Array:
    """Return breakpoints 0..1 from stone to interface of layers that grow inwards by at most `growth`.

    `first` is the thickness wanted at the interface, `flesh` the distance to the stone, both in units of r1.
    """
    count = 1
    while first * sum(growth**i for i in range(count)) < flesh and count < 40:
        count += 1
    thickness = first * growth ** np.arange(count)
    outside_in = np.concatenate([[0.0], np.cumsum(thickness / thickness.sum())])
    return 1 - outside_in[::-1]


def build_mesh(fruit: Fruit, n: int, core: Array, exocarp_layers: int = 2) -> FruitMesh:
    """Return the mesh of `fruit` with `n` elements per cube edge and core layers at the fractions `core` (0..1)."""
    sphere = cubed_sphere(n)
    d = sphere.directions
    colatitude = np.arccos(np.clip(d[:, 1], -1, 1))
    interface = fruit.sarcocarp(colatitude, np.arctan2(d[:, 2], d[:, 0]))
    outer = np.linalg.norm(interface, axis=1)
    rays = interface / outer[:, None]
    stone = fruit.stone_distance(rays)
    skin = fruit.exocarp_thickness * np.arange(1, exocarp_layers + 1) / exocarp_layers
    distance = np.concatenate(
        [stone[:, None] + (outer - stone)[:, None] * core, outer[:, None] + skin[None, :]], axis=1
    )
    levels = distance.shape[1]
    positions = (rays[:, None, :] * distance[..., None]).reshape(-1, 3)

    # corner bits (xi, eta, zeta): quads run (0,0) (1,0) (1,1) (0,1)
    base = sphere.quads[:, [0, 3, 1, 2]] * levels
    layer = np.arange(levels - 1)
    corners = base[:, None, :, None] + layer[None, :, None, None] + np.array([0, 1])
    connectivity = corners.reshape(-1, 8)
    is_exocarp = np.tile(layer >= len(core) - 1, len(sphere.quads))
    depth = np.concatenate([core, np.ones(exocarp_layers)])
    return FruitMesh(sphere, positions, connectivity, is_exocarp, rays, depth)


class Sampler:
    """Reads a nodal field of the outer surface at the lattice of colatitudes and azimuths.

    Cubic splines on each of the six faces: the two faces of an edge share its nodes and hence its spline, so the
    result is continuous; between nodes it is fourth-order where trilinear elements are second.
    """

    def __init__(self, sphere: CubedSphere, resolution: int) -> None:
        self._sphere = sphere
        theta, phi = lattice(resolution)
        self._shape = theta.shape
        points = directions(theta, phi).reshape(-1, 3)
        heights = points @ _FACES[:, 0].T
        self._face = np.argmax(heights, axis=1)
        axes = _FACES[self._face]
        height = heights[np.arange(len(points)), self._face]
        self._alpha = np.arctan2(np.einsum("pi,pi->p", points, axes[:, 1]), height)
        self._beta = np.arctan2(np.einsum("pi,pi->p", points, axes[:, 2]), height)
        self._knots = np.linspace(-np.pi / 4, np.pi / 4, sphere.n + 1)

    def __call__(self, nodal: Array) -> Array:
        """Return the field (nd, c) or (nd,) at the lattice: (resolution, 2 * resolution, c) or without c."""
        values = nodal.reshape(len(nodal), -1)
        out = np.empty((len(self._face), values.shape[1]))
        for face in range(6):
            here = np.flatnonzero(self._face == face)
            grid = values[self._sphere.faces[face]]
            for c in range(values.shape[1]):
                spline = RectBivariateSpline(self._knots, self._knots, grid[..., c])
                out[here, c] = spline.ev(self._alpha[here], self._beta[here])
        return out.reshape(*self._shape, *nodal.shape[1:])
