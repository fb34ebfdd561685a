"""Triquadratic mesh of a fruit: quads of the cubed sphere times radial layers, whole or the part between its planes.

Every fruit is symmetric about x = 0 and z = 0; about y = 0 as well where r1 to r7 read the same backwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ...arrays import Bools, Floats, Ints
from ...contract import InvalidInput
from ...fruit import directions
from ..fresh.corners import corner_ratios, right_side_out
from ..fresh.mesh import along_rays, cubed_sphere, meeting
from ..params import DehydrationParams
from .upright import upright

__all__ = [
    "Band",
    "Patch",
    "QuadraticMesh",
    "Symmetry",
    "build_band_mesh",
    "build_quadratic_mesh",
    "graded_layers",
    "natural_symmetry",
]

Symmetry = Literal["octant", "quarter", "whole"]

#: Planes (as normal axes) that bound each part.
PLANES: dict[Symmetry, tuple[int, ...]] = {"octant": (0, 1, 2), "quarter": (0, 2), "whole": ()}
#: Share of the least corner ratio along rays that upright columns must keep.
FLATTEST = 0.5


class Patch(NamedTuple):
    """Part of a fruit: all below the outer surface within `radius` of `centre` (3,), both fresh [r1]."""

    centre: Floats
    radius: float


class Band(NamedTuple):
    """Part of a fruit between two colatitudes and two azimuths [radian, parametric], these within a quarter turn.

    rows, cells: elements from `high` to `low` and from `first` to `last`. A cubed sphere's quads are as long as they
    are wide, and lie across meridians near the poles; where waves run round the axis, crests are several times as long.
    """

    high: float
    low: float
    first: float
    last: float
    rows: int
    cells: int


@dataclass(frozen=True, eq=False)
class QuadraticMesh:
    """hex27 elements between stone and outer surface.

    positions: (nn, 3) fresh; node = column * levels + level, level 0 on the stone, odd levels mid-layer.
    connectivity: (ne, 27) in the order of `hexahedron`; element = stack * layers + layer. is_exocarp: (ne,).
    stacks: (ns, 9) columns under each quad of the surface. planes: normal axes of the symmetry planes that bound the
    mesh. quad_of: (6, n, n) stack of each quad of the cubed sphere, -1 where the part leaves it out; of a band's
    (1, cells, rows). breaks: (layers + 1,) radial breakpoints: fraction of the flesh up to 1, then 1 + fraction of the
    exocarp; the first is not 0 where the mesh ends above the stone. cut: (columns,) those on the edge of a patch, which
    no symmetry holds. foot: share of the flesh's depth above which columns stand upright (see `upright`), None where
    they follow rays. band: None for parts of a cubed sphere.
    """

    positions: Floats
    connectivity: Ints
    is_exocarp: Bools
    stacks: Ints
    planes: tuple[int, ...]
    quad_of: Ints
    levels: int
    breaks: Floats
    cut: Bools
    foot: float | None = None
    band: Band | None = None

    @property
    def columns(self) -> int:
        """Number of radial lines of nodes."""
        return len(self.positions) // self.levels

    @property
    def layers(self) -> int:
        """Number of elements along a column."""
        return (self.levels - 1) // 2


def natural_symmetry(params: DehydrationParams) -> Symmetry:
    """Return the smallest part that stands for the whole fruit under a uniform load."""
    profile = params.radii[:7]
    return "octant" if profile == profile[::-1] else "quarter"


def graded_layers(count: int, growth: float) -> Floats:
    """Return breakpoints 0..1 (count + 1,) of layers that grow inwards from the interface by the factor `growth`."""
    thickness = growth ** np.arange(count, dtype=float)
    return 1 - np.concatenate([[0.0], np.cumsum(thickness / thickness.sum())])[::-1]


def _with_middles(breaks: Floats) -> Floats:
    result = np.empty(2 * len(breaks) - 1)
    result[::2], result[1::2] = breaks, (breaks[1:] + breaks[:-1]) / 2
    return result


def build_quadratic_mesh(
    params: DehydrationParams, n: int, core: Floats, symmetry: Symmetry = "whole", exocarp_layers: int = 1,
    patch: Patch | None = None, foot: float | None = None,
) -> QuadraticMesh:  # fmt: skip
    """Return the mesh with `n` quadratic elements per edge of the cubed sphere and core layers at fractions `core`.

    patch: the stacks that are kept, by the middle of their outer faces along rays; None keeps all. foot: one of `core`,
    above which columns stand upright; None has them follow rays, as they do where upright ones would cross.

    Raises InvalidInput if a symmetric part is asked for with an odd `n`: its planes would cut elements in two;
    InvalidGeometry where elements turn inside out.
    """
    planes = PLANES[symmetry]
    if n < 1 or (planes and n % 2):
        raise InvalidInput(
            f"n = {n} elements per edge cannot be cut along the symmetry planes.", advice="Use an even n of 2 or more."
        )
    sphere = cubed_sphere(2 * n)
    rays, outer = meeting(params, sphere.directions)
    grid = sphere.faces
    quads = np.stack([grid[:, i : i + 2 * n : 2, j : j + 2 * n : 2] for i in range(3) for j in range(3)], axis=-1)
    inside = np.ones(len(rays), dtype=bool)
    for axis in planes:
        inside &= rays[:, axis] > -1e-9
    there = inside[quads].all(axis=-1)
    kept = there
    if patch is not None:
        middles = rays[quads[..., 4]] * (outer[quads[..., 4]] + params.exocarp_thickness)[..., None]
        kept = there & (np.linalg.norm(middles - patch.centre, axis=-1) <= patch.radius)
    edge = np.zeros(len(rays), dtype=bool)
    edge[quads[there & ~kept]] = True
    quad_of = np.where(kept, np.cumsum(kept.ravel()).reshape(kept.shape) - 1, -1)
    columns = np.unique(quads[kept])
    number = np.full(len(rays), -1)
    number[columns] = np.arange(len(columns))
    stacks = number[quads[kept]]
    ground = _Ground(rays[columns], outer[columns], stacks, quad_of, edge[columns], planes)
    return _raised(params, ground, core, exocarp_layers, foot)


def build_band_mesh(
    params: DehydrationParams, band: Band, core: Floats, symmetry: Symmetry, exocarp_layers: int, foot: float | None
) -> QuadraticMesh:
    """Return the mesh of a band. core, exocarp_layers, foot: as of `build_quadratic_mesh`.

    The lowest of `core` may lie above the stone: the mesh is cut there. Sides off the symmetry planes are, too.
    Raises InvalidGeometry where elements turn inside out.
    """
    colatitude = np.linspace(band.high, band.low, 2 * band.rows + 1)
    azimuth = np.linspace(band.first, band.last, 2 * band.cells + 1)
    towards = directions(colatitude[None, :], azimuth[:, None])
    wide, long = towards.shape[:2]
    grid = np.arange(wide * long).reshape(wide, long)
    # azimuth, colatitude and outwards are right-handed
    stacks = np.stack([grid[i : wide - 2 + i : 2, j : long - 2 + j : 2] for i in range(3) for j in range(3)], axis=-1)
    planes = PLANES[symmetry]
    edge = np.zeros(grid.shape, dtype=bool)
    edge[:, 0] = True
    edge[:, -1] = 1 not in planes or band.low < np.pi / 2
    edge[0] |= band.first > 0
    edge[-1] |= band.last < np.pi / 2
    rays, outer = meeting(params, towards.reshape(-1, 3))
    quad_of = np.arange(band.cells * band.rows).reshape(1, band.cells, band.rows)
    ground = _Ground(rays, outer, stacks.reshape(-1, 9), quad_of, edge.ravel(), planes, band)
    return _raised(params, ground, core, exocarp_layers, foot)


class _Ground(NamedTuple):
    """Where columns stand: along `rays` (columns, 3), which meet the interface at `outer`; else as of the mesh."""

    rays: Floats
    outer: Floats
    stacks: Ints
    quad_of: Ints
    cut: Bools
    planes: tuple[int, ...]
    band: Band | None = None


def _raised(
    params: DehydrationParams, ground: _Ground, core: Floats, exocarp_layers: int, foot: float | None
) -> QuadraticMesh:
    """Return the mesh of columns."""
    rays, outer, stacks, quad_of, cut, planes, band = ground
    positions = along_rays(params, rays, outer, _with_middles(core), 2 * exocarp_layers)
    levels = positions.shape[1]
    layers = (levels - 1) // 2
    corners = stacks[:, None, [0, 2, 6, 8], None] * levels + 2 * np.arange(layers)[:, None, None] + np.array([0, 2])
    worst = right_side_out(positions.reshape(-1, 3), corners.reshape(-1, 8))
    if foot is not None:
        raised = upright(params, positions.reshape(-1, 3), foot)
        if float(corner_ratios(raised, corners.reshape(-1, 8)).min()) > FLATTEST * worst:
            positions = raised.reshape(positions.shape)
        else:
            foot = None
    for axis in planes:
        positions[np.abs(rays[:, axis]) < 1e-9, :, axis] = 0.0
    level = 2 * np.arange(layers)[:, None] + np.arange(3)
    connectivity = (stacks[:, None, :, None] * levels + level[None, :, None, :]).reshape(-1, 27)
    is_exocarp = np.tile(np.arange(layers) >= len(core) - 1, len(stacks))
    breaks = np.concatenate([core, 1 + np.arange(1, exocarp_layers + 1) / exocarp_layers])
    return QuadraticMesh(
        positions.reshape(-1, 3), connectivity, is_exocarp, stacks, planes, quad_of, levels, breaks, cut, foot, band,
    )  # fmt: skip
