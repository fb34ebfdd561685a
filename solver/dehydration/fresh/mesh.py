"""Structured hexahedra of a fruit: an equiangular cubed sphere times radial layers, and sampling of its surface.

The cubed sphere lives on the parametric unit sphere of `solver.fruit` (y carries the poles), so that every fruit of
a table shares one topology. Columns of elements run along rays from the centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import RectBivariateSpline

from ...arrays import Bools, Floats, Ints
from ...fruit import Fruit, directions, lattice

__all__ = [
    "CubedSphere",
    "FruitMesh",
    "Sampler",
    "along_rays",
    "build_mesh",
    "cubed_sphere",
    "flesh_span",
    "inner_distance",
    "layer_fractions",
    "meeting",
]


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


#: Radius of the ball cut out of a fruit without a stone, in units of r1, and its largest share of the thinnest ray.
CENTRE_BALL, CENTRE_SHARE = 0.1, 0.4


@dataclass(frozen=True, eq=False)
class CubedSphere:
    """Equiangular cubed sphere with `n` elements along each of the 12 edges.

    directions: (nd, 3) nodes on the unit sphere. faces: (6, n+1, n+1) node numbers of each face, by first and second
    tangent. quads: (6 n^2, 4) corners, counter-clockwise seen from outside, the first where a diagonal begins.
    """

    n: int
    directions: Floats
    faces: Ints
    quads: Ints


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
    # each is seen as two triangles, cut from its first corner: mirror images are to be cut in mirror images
    half = np.arange(n) - (n - 1) / 2
    turned = (half[:, None] * half < 0)[None, ..., None]
    quads = np.where(turned, np.roll(quads, -1, axis=-1), quads)
    sphere = CubedSphere(n, points[first], faces, quads.reshape(-1, 4))
    for array in (sphere.directions, sphere.faces, sphere.quads):
        array.flags.writeable = False
    return sphere


@dataclass(frozen=True, eq=False)
class FruitMesh:
    """Hexahedra between stone (or central ball) and outer surface.

    positions: (nn, 3) perfect fresh positions; node = column * levels + level, level 0 on the stone or ball.
    connectivity: (ne, 8) corners with local bits xi = 4, eta = 2, zeta = 1, zeta outwards, right-handed.
    is_exocarp: (ne,). rays: (nc, 3) unit ray of each column. parametric: (nc, 3) its direction on the parametric
    sphere. depth: (levels,) fraction of the flesh from stone (0) to interface (1), 1 in the exocarp.
    """

    sphere: CubedSphere
    positions: Floats
    connectivity: Ints
    is_exocarp: Bools
    rays: Floats
    depth: Floats

    @property
    def levels(self) -> int:
        """Nodes along a column."""
        return len(self.depth)

    @property
    def surface_nodes(self) -> Ints:
        """(nc,) nodes of the outer surface, in column order."""
        return np.arange(len(self.rays)) * self.levels + self.levels - 1

    @property
    def fixed(self) -> Bools:
        """(nn,) nodes that sit on the rigid stone, or on the ball that follows the loading (`loading.Loading.held`)."""
        return np.tile(np.arange(self.levels) == 0, len(self.rays))


def layer_fractions(flesh: float, first: float, growth: float) -> Floats:
    """Return breakpoints 0..1 from stone to interface of layers that grow inwards by at most `growth`.

    `first` is the thickness wanted at the interface, `flesh` the distance to the stone, both in units of r1.
    """
    count = 1
    while first * sum(growth**i for i in range(count)) < flesh and count < 40:
        count += 1
    thickness = first * growth ** np.arange(count)
    outside_in = np.concatenate([[0.0], np.cumsum(thickness / thickness.sum())])
    return 1 - outside_in[::-1]


def inner_distance(fruit: Fruit, rays: Floats) -> Floats:
    """Return the distance (...) along unit rays (..., 3) at which the mesh begins: the stone, or the central ball."""
    if fruit.has_stone:
        return fruit.stone_distance(rays)
    thinnest = np.linalg.norm(fruit.sarcocarp(*lattice(32)), axis=-1).min()
    return np.full(rays.shape[:-1], min(CENTRE_BALL, CENTRE_SHARE * thinnest))


def flesh_span(fruit: Fruit) -> tuple[float, float]:
    """Return the thinnest and the thickest flesh along rays, from stone or central ball to exocarp, in units of r1."""
    interface = fruit.sarcocarp(*lattice(32))
    distance = np.linalg.norm(interface, axis=-1)
    flesh = distance - inner_distance(fruit, interface / distance[..., None])
    return float(flesh.min()), float(flesh.max())


def build_mesh(fruit: Fruit, n: int, core: Floats, exocarp_layers: int = 2) -> FruitMesh:
    """Return the mesh of `fruit` with `n` elements per cube edge and core layers at the fractions `core` (0..1).

    A fruit without a stone loses a ball of 0.1 r1 at the centre, whose surface is led along with the flesh. Balls of
    0.05 and 0.2 move the smooth outer radius by 1e-6 and 1e-5 (te = 0.04, gamma = 10, s = -0.3 to 0.05), and the
    buckled surface at s = 0.10 by an rms of 2e-4 and 1e-3 under a roughness of 0.025 (preview).

    Raises:
        InvalidGeometry: an element is inverted or flat at a corner.

    """
    # the compiler: what only estimates the cost of a run does without
    from .corners import right_side_out

    sphere = cubed_sphere(n)
    rays, outer = meeting(fruit, sphere.directions)
    columns = along_rays(fruit, rays, outer, core, exocarp_layers)
    levels = columns.shape[1]
    positions = columns.reshape(-1, 3)

    # corner bits (xi, eta, zeta): quads run (0,0) (1,0) (1,1) (0,1)
    base = sphere.quads[:, [0, 3, 1, 2]] * levels
    layer = np.arange(levels - 1)
    corners = base[:, None, :, None] + layer[None, :, None, None] + np.array([0, 1])
    connectivity = corners.reshape(-1, 8)
    is_exocarp = np.tile(layer >= len(core) - 1, len(sphere.quads))
    right_side_out(positions, connectivity)
    depth = np.concatenate([core, np.ones(exocarp_layers)])
    return FruitMesh(sphere, positions, connectivity, is_exocarp, rays, depth)


def meeting(fruit: Fruit, towards: Floats) -> tuple[Floats, Floats]:
    """Return unit rays (nc, 3) and where they meet the interface, from the centre, at parametric directions (nc, 3)."""
    colatitude = np.arccos(np.clip(towards[:, 1], -1, 1))
    interface = fruit.sarcocarp(colatitude, np.arctan2(towards[:, 2], towards[:, 0]))
    outer = np.linalg.norm(interface, axis=1)
    return interface / outer[:, None], outer


def along_rays(fruit: Fruit, rays: Floats, outer: Floats, core: Floats, exocarp_layers: int) -> Floats:
    """Return the nodes (nc, levels, 3) of columns along rays that meet the interface at distances `outer` (nc,)."""
    stone = inner_distance(fruit, rays)
    skin = fruit.exocarp_thickness * np.arange(1, exocarp_layers + 1) / exocarp_layers
    distance = np.concatenate(
        [stone[:, None] + (outer - stone)[:, None] * core, outer[:, None] + skin[None, :]], axis=1
    )
    found: Floats = rays[:, None, :] * distance[..., None]
    return found


class Sampler:
    """Reads a nodal field of the outer surface at the lattice of colatitudes and azimuths.

    Cubic splines on each of the six faces: the two faces of an edge share its nodes and hence its spline, so the
    result is continuous; between nodes it is fourth-order where trilinear elements are second.
    face, alpha, beta: (lattice points,) the face of each and its angles along both tangents.
    """

    def __init__(self, sphere: CubedSphere, resolution: int) -> None:
        self._sphere = sphere
        theta, phi = lattice(resolution)
        self._shape = theta.shape
        points = directions(theta, phi).reshape(-1, 3)
        heights = points @ _FACES[:, 0].T
        self.face = np.argmax(heights, axis=1)
        axes = _FACES[self.face]
        height = heights[np.arange(len(points)), self.face]
        self.alpha = np.arctan2(np.einsum("pi,pi->p", points, axes[:, 1]), height)
        self.beta = np.arctan2(np.einsum("pi,pi->p", points, axes[:, 2]), height)
        self._knots = np.linspace(-np.pi / 4, np.pi / 4, sphere.n + 1)

    def __call__(self, nodal: Floats) -> Floats:
        """Return the field (nd, c) or (nd,) at the lattice: (resolution, 2 * resolution, c) or without c."""
        values = nodal.reshape(len(nodal), -1)
        out = np.empty((len(self.face), values.shape[1]))
        for face in range(6):
            here = np.flatnonzero(self.face == face)
            grid = values[self._sphere.faces[face]]
            for c in range(values.shape[1]):
                spline = RectBivariateSpline(self._knots, self._knots, grid[..., c])
                out[here, c] = spline.ev(self.alpha[here], self.beta[here])
        return out.reshape(*self._shape, *nodal.shape[1:])
