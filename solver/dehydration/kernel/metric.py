"""Fresh geometry of the elements: the stored planes that `elements` reads, in float64, one column per element."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from solver.dehydration.kernel.algebra import (
    CORE_WEIGHTS,
    ETA,
    EXOCARP_WEIGHTS,
    GAUSS,
    GAUSS_SIGNS,
    HOURGLASS,
    LINE,
    SIGNS,
    XI,
    ZETA,
    hexahedron_volume,
    modes_of,
)
from solver.dehydration.kernel.elements import derivatives_of, fresh_point
from solver.fem import HEX8

from ...arrays import Floats

CORNERS = HEX8.nodes
"""Local coordinates of the eight nodes, (8, 3): bits of the node's number."""
GAUSS_POINTS = GAUSS * np.array(GAUSS_SIGNS, dtype=np.float64)
EXOCARP_POINTS = np.concatenate([GAUSS_POINTS, [(0.0, 0.0, s * LINE) for s in SIGNS]])
SLOPES = {False: HEX8.gradients(GAUSS_POINTS), True: HEX8.gradients(EXOCARP_POINTS)}
"""dN_a/dxi_k (q, 8, 3) at the points of the core's (False) and of the exocarp's rule."""
_AT_CENTRE = HEX8.gradients(np.zeros((1, 3)))


def quadrature(exocarp: bool) -> tuple[Floats, Floats]:
    """Local points (q, 3) and weights (q,) of an element type, in the order in which `elements` visits them."""
    if exocarp:
        return EXOCARP_POINTS, np.array(EXOCARP_WEIGHTS)
    return GAUSS_POINTS, np.array(CORE_WEIGHTS)


def inverse_jacobians(corners: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """B = dxi/dX (ne, q, 3, 3), row k = local direction, and det(dX/dxi) (ne, q), for corners (ne, 8, 3) and shape
    derivatives (q, 8, 3).
    """
    jacobians = corners.transpose(0, 2, 1)[:, None] @ slopes
    columns = np.moveaxis(jacobians, -1, 0)
    # Row k of the inverse is the cross product of the other two columns over the determinant.
    rows = [np.cross(columns[(k + 1) % 3], columns[(k + 2) % 3]) for k in range(3)]
    determinants: Floats = np.sum(columns[0] * rows[0], axis=-1)
    return np.stack(rows, axis=-2) / determinants[..., None, None], determinants


def refuse_inverted(corners: Floats, chunk: int = 4096) -> None:
    """ValueError if an element (corners (ne, 8, 3)) is inverted or flat at an integration point or its centre."""
    slopes = np.concatenate([SLOPES[True], _AT_CENTRE])
    least = np.empty(len(corners))
    for first in range(0, len(corners), chunk):
        a, b, c = np.moveaxis(corners[first : first + chunk].transpose(0, 2, 1)[:, None] @ slopes, -1, 0)
        # not `det`, which factors one small matrix after the other: a run begins with this
        bx, by, bz, cx, cy, cz = (side[..., i] for side in (b, c) for i in range(3))
        volumes = a[..., 0] * (by * cz - bz * cy) + a[..., 1] * (bz * cx - bx * cz) + a[..., 2] * (bx * cy - by * cx)
        least[first : first + chunk] = volumes.min(axis=1)
    if not np.all(least > 0):
        raise ValueError(
            f"{int(np.sum(~(least > 0)))} fresh elements are inverted or flat, element {int(np.argmin(least))} worst; "
            "check the mesh and the order of its nodes (bits xi = 4, eta = 2, zeta = 1, right-handed)"
        )


def _modes(corners: Floats) -> Any:
    """Modes of `algebra` of corners (ne, 8, 3): [mode][component] -> (ne,)."""
    return modes_of([[corners[:, a, i] for i in range(3)] for a in range(8)])


def element_planes(corners: Floats, mu: Floats, kappa: Floats, exocarp: bool) -> Floats:
    """Planes of the full core or the exocarp element, (planes, ne) float64."""
    weights = quadrature(exocarp)[1] / 512
    derivatives = derivatives_of(_modes(corners), exocarp)
    points = [fresh_point(d, weight) for d, weight in zip(derivatives, weights, strict=True)]
    volume = sum(weight / point[-1] for point, weight in zip(points, weights, strict=True))
    return np.stack([mu, kappa, 1.0 / volume, *(number for point in points for number in point)])


class OnePoint(NamedTuple):
    """Fresh geometry of the one-point element."""

    volume: Floats
    """(ne,)"""
    metric: Floats
    """(ne, 3, 3): volume/64 * B B^T at the centre"""
    linear: Floats
    """(ne, 4, 3): an affine motion with derivatives D_k puts sum_k linear_hk D_k into hourglass mode h"""
    mean: Floats
    """(ne, 3, 3): hourglass displacement q_h adds mean_hk q_h to the D_k of the mean deformation gradient"""


def one_point_geometry(corners: Floats) -> OnePoint:
    """The mean gradient is that of the exact volume: b_a = dV/dX_a, mean F = sum_a x_a b_a^T / V."""
    modes = _modes(corners)
    inverse = inverse_jacobians(corners, _AT_CENTRE)[0][:, 0]
    scaled_volume, by_mode = hexahedron_volume(modes)
    affine = np.stack([np.stack(modes[m], axis=-1) for m in (XI, ETA, ZETA)], axis=1)
    hourglass = np.stack([np.stack(modes[m], axis=-1) for m in HOURGLASS], axis=1)
    gradient = np.stack([np.stack(by_mode[m], axis=-1) for m in HOURGLASS[:3]], axis=1)
    return OnePoint(
        scaled_volume / 64,
        inverse @ inverse.transpose(0, 2, 1) * (scaled_volume / 64**2)[:, None, None],
        hourglass @ inverse.transpose(0, 2, 1) / 8,
        gradient @ affine.transpose(0, 2, 1) / scaled_volume[:, None, None],
    )


def one_point_planes(corners: Floats, mu: Floats, kappa: Floats) -> Floats:
    """Planes of the one-point core element, (planes, ne) float64."""
    geometry = one_point_geometry(corners)
    upper = [geometry.metric[:, k, m] for k in range(3) for m in range(k, 3)]
    coefficients = [*geometry.linear.reshape(-1, 12).T, *geometry.mean.reshape(-1, 9).T]
    return np.stack([mu, kappa, 1.0 / geometry.volume, *upper, *coefficients])
