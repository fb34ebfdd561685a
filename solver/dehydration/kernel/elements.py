"""Forces and energies of the three element types, over the abstract numbers of `algebra`.

- ``core_forces``: sarcocarp, 2x2x2 points, mean dilatation (Q1/P0).
- ``exocarp_forces``: exocarp, 10 % 2x2x2 plus 90 % two points through the thickness at the in-plane centre.
- ``one_point_forces``: sarcocarp, one point with physical hourglass control: shear from the mean deformation gradient
  (so that the patch test holds on any hex and rest is free of stress) plus the hourglass gradients integrated with
  the centre metric (exact on a parallelepiped); the volume is exact. About a third of the arithmetic, half of the
  memory. A speed option to be checked against ``core_forces`` (fold patterns may differ).

All take ``positions`` (8 vectors), ``plane`` (stored planes, see `algebra`), and ``theta`` (1 in the exocarp), and
return the derivative of the element's energy by the 8 nodal positions; the force on a node is its negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from solver.dehydration.kernel.algebra import (
    BARRIER_BELOW,
    BARRIER_STIFFNESS,
    CORE_WEIGHTS,
    ETA,
    EXOCARP_WEIGHTS,
    GEOMETRY,
    HOURGLASS,
    INVERSE_VOLUME,
    KAPPA,
    LINEAR_PLANES,
    MEAN_PLANES,
    MU,
    POINT,
    TANGENT_BELOW,
    XI,
    ZETA,
    Arithmetic,
    Number,
    Planes,
    Vector,
    apply_metric,
    centre_line_derivatives,
    combine,
    cross,
    dot,
    gauss_derivatives,
    hexahedron_volume,
    modal_from_points,
    modes_of,
    nodal_from_modal,
    plus_cross,
    to_points,
    triangles_of,
    upright,
    upright_adjoint,
)


class Shrinkage(NamedTuple):
    """Jd = det(Fd) = theta^3 and what is derived from it once per element."""

    volume: Number
    inverse: Number
    mu: Number
    """mu * Jd"""
    shear: Number
    """mu * theta: what (J/Jd)^(-2/3) I1(F) / 2 is multiplied with, as Jd J^(-2/3) = theta (J/Jd)^(-2/3)"""


def shrinkage_of(plane: Planes, theta: Number) -> Shrinkage:
    """Jd and its companions for Fd = theta I."""
    volume = theta * theta * theta
    return Shrinkage(volume, 1.0 / volume, plane(MU) * volume, plane(MU) * theta)


class Isochoric(NamedTuple):
    """(J/Jd)^(-2/3) with its linear continuation below TANGENT_BELOW, and its slope."""

    value: Number
    slope: Number
    """-(3/2) d value / d(J/Jd), that is (J/Jd)^(-5/3)"""


def isochoric_factor(ar: Arithmetic, ratio: Number) -> Isochoric:
    """(J/Jd)^(-2/3) of a point or element, safe for any ratio."""
    bounded = ar.maximum(ratio, TANGENT_BELOW)
    root = ar.inverse_cube_root(bounded)
    square = root * root
    cube = square * root
    # root is a little off: to first order in the defect, its square and its cube (1 / bounded) are put right
    defect = 1.0 - bounded * cube
    square = square + (square * defect) * (2 / 3)
    slope = square * (cube + cube * defect)
    return Isochoric(square + (slope * (2 / 3)) * (bounded - ratio), slope)


def barrier_overlap(ar: Arithmetic, ratio: Number) -> Number:
    """min(J/Jd - 0.6, 0)."""
    return ar.minimum(ratio - BARRIER_BELOW, 0.0)


def derivatives_of(modes: Sequence[Vector], exocarp: bool) -> list[list[Vector]]:
    """D = 8 dx/dxi at the points of an element type: [point][direction] -> vector."""
    scaled = to_points(modes)
    return gauss_derivatives(scaled) + (centre_line_derivatives(scaled) if exocarp else [])


class PointGeometry(NamedTuple):
    """Fresh geometry of a point, see `algebra`."""

    triangle: list[Number]
    """a, b, c"""
    stretches: list[Number]
    """m1, m2, m3"""
    inverse_det: Number
    """det(B) / 512"""


def point_geometry(plane: Planes, point: int) -> PointGeometry:
    """What is stored of a point."""
    stored = [plane(GEOMETRY + POINT * point + k) for k in range(POINT)]
    return PointGeometry(stored[:3], stored[3:6], stored[6])


def fresh_point(fresh: Sequence[Vector], weight: float) -> list[Number]:
    """What to store of a point with fresh derivatives D.

    weight: quadrature weight / 512. With C the cofactors of D, B = 8 C / det(D), so that
    w B B^T / 64 = weight C C^T / det(D).
    """
    cofactors = [cross(fresh[1], fresh[2]), cross(fresh[2], fresh[0]), cross(fresh[0], fresh[1])]
    inverse_det = 1.0 / dot(fresh[0], cofactors[0])
    factor = inverse_det * weight
    metric = [factor * dot(cofactors[k], cofactors[m]) for k in range(3) for m in range(k, 3)]
    return [*triangles_of(metric), inverse_det]


def mean_volume(modes: Sequence[Vector], derivatives: Sequence[Sequence[Vector]], exocarp: bool) -> Number:
    """Deformed element volume by the element's own rule (2x2x2 integrates a trilinear hex exactly)."""
    total = hexahedron_volume(modes)[0] * (EXOCARP_WEIGHTS[0] / 64 if exocarp else 1 / 64)
    for weight, d in zip(EXOCARP_WEIGHTS[8:], derivatives[8:], strict=exocarp):
        total = dot(d[0], cross(d[1], d[2])) * (weight / 512) + total
    return total


def point_stress(
    ar: Arithmetic,
    derivatives: Sequence[Vector],
    geometry: PointGeometry,
    weight: float,
    pressure: Number,
    mu: Number,
    shrink: Shrinkage,
) -> list[Vector]:
    """Derivative of the element's energy by the three D_k of one point.

    weight: quadrature weight / 512. pressure: kappa (Jbar/Jd - 1), the derivative of the volumetric energy by the
    element's volume.
    """
    d = upright(geometry.triangle, derivatives)
    first = cross(d[1], d[2])
    scale = geometry.inverse_det * shrink.inverse
    ratio = dot(d[0], first) * scale
    isochoric = isochoric_factor(ar, ratio)
    stretch = dot(geometry.stretches, [dot(each, each) for each in d])
    spherical = pressure * weight + barrier_overlap(ar, ratio) * (mu * (BARRIER_STIFFNESS * weight))
    spherical = spherical - (shrink.shear * (1 / 3) * stretch) * (isochoric.slope * scale)
    shear = shrink.shear * isochoric.value
    sheared = [[shear * m * p for p in each] for m, each in zip(geometry.stretches, d, strict=True)]
    # the other two cofactors are not needed but times the spherical stress
    pressed = [spherical * p for p in d[0]]
    by_upright = [
        [p + spherical * q for p, q in zip(sheared[0], first, strict=True)],
        plus_cross(sheared[1], d[2], pressed),
        plus_cross(sheared[2], pressed, d[1]),
    ]
    return upright_adjoint(geometry.triangle, by_upright)


def _forces(ar: Arithmetic, positions: Sequence[Vector], plane: Planes, theta: Number, exocarp: bool) -> list[Vector]:
    modes = modes_of(positions)
    shrink = shrinkage_of(plane, theta)
    derivatives = derivatives_of(modes, exocarp)
    weights = EXOCARP_WEIGHTS if exocarp else CORE_WEIGHTS
    ratio = mean_volume(modes, derivatives, exocarp) * plane(INVERSE_VOLUME) * shrink.inverse
    pressure = plane(KAPPA) * (ratio - 1.0)
    stress = [
        point_stress(ar, d, point_geometry(plane, k), weight / 512, pressure, plane(MU), shrink)
        for k, (d, weight) in enumerate(zip(derivatives, weights, strict=True))
    ]
    return nodal_from_modal(modal_from_points(stress))


def core_forces(ar: Arithmetic, positions: Sequence[Vector], plane: Planes, theta: Number) -> list[Vector]:
    """Derivative of the energy of a fully integrated core element by its 8 nodal positions."""
    return _forces(ar, positions, plane, theta, exocarp=False)


def exocarp_forces(ar: Arithmetic, positions: Sequence[Vector], plane: Planes, theta: Number) -> list[Vector]:
    """Derivative of the energy of an exocarp element by its 8 nodal positions."""
    return _forces(ar, positions, plane, theta, exocarp=True)


def _ratio_of(
    plane: Planes, point: int, derivatives: Sequence[Vector], shrink: Shrinkage
) -> tuple[Number, list[Vector]]:
    """J/Jd of a point, and its derivatives `upright`."""
    geometry = point_geometry(plane, point)
    d = upright(geometry.triangle, derivatives)
    return dot(d[0], cross(d[1], d[2])) * geometry.inverse_det * shrink.inverse, d


def least_ratio(ar: Arithmetic, positions: Sequence[Vector], plane: Planes, theta: Number, exocarp: bool) -> Number:
    """Least J/Jd over the points of a core or exocarp element."""
    shrink = shrinkage_of(plane, theta)
    least: Number = None
    for k, derivative in enumerate(derivatives_of(modes_of(positions), exocarp)):
        ratio, _ = _ratio_of(plane, k, derivative, shrink)
        least = ratio if least is None else ar.minimum(least, ratio)
    return least


def energy(
    ar: Arithmetic, positions: Sequence[Vector], plane: Planes, theta: Number, exocarp: bool
) -> tuple[Number, Number]:
    """(energy, least J/Jd over the points) of a core or exocarp element: what `core_forces` is the gradient of."""
    modes = modes_of(positions)
    shrink = shrinkage_of(plane, theta)
    derivatives = derivatives_of(modes, exocarp)
    weights = EXOCARP_WEIGHTS if exocarp else CORE_WEIGHTS
    volume = 1.0 / plane(INVERSE_VOLUME)
    dilatation = mean_volume(modes, derivatives, exocarp) * plane(INVERSE_VOLUME) * shrink.inverse - 1.0
    total = volume * (0.5 * plane(KAPPA) * shrink.volume * (dilatation * dilatation) - 1.5 * shrink.mu)
    least: Number = None
    for k, (derivative, weight) in enumerate(zip(derivatives, weights, strict=True)):
        geometry = point_geometry(plane, k)
        ratio, d = _ratio_of(plane, k, derivative, shrink)
        overlap = barrier_overlap(ar, ratio)
        stretch = dot(geometry.stretches, [dot(each, each) for each in d])
        total = total + 0.5 * shrink.shear * isochoric_factor(ar, ratio).value * stretch
        fresh = (weight / 512) / geometry.inverse_det
        total = total + 0.5 * BARRIER_STIFFNESS * shrink.mu * (overlap * overlap) * fresh
        least = ratio if least is None else ar.minimum(least, ratio)
    return total, least


class MeanShear(NamedTuple):
    """Shear part of the one-point element."""

    stretch: Number
    """V0 I1, mean and hourglass part"""
    by_affine: list[Vector]
    """half its derivative by the affine modes, at fixed hourglass displacement"""
    by_hourglass: list[Vector]
    """half its derivative by the four hourglass displacements"""
    linear: list[list[Number]]
    """4 hourglass modes x 3: what an affine motion puts into them; the rest is hourglass displacement"""


def mean_shear(modes: Sequence[Vector], plane: Planes) -> MeanShear:
    """V0 I1 of the one-point element and its halved derivatives."""
    metric = [plane(GEOMETRY + j) for j in range(6)]
    linear = [[plane(LINEAR_PLANES + 3 * h + k) for k in range(3)] for h in range(4)]
    mean = [[plane(MEAN_PLANES + 3 * h + k) for k in range(3)] for h in range(3)]
    affine = [modes[XI], modes[ETA], modes[ZETA]]
    beyond = [
        [p - q for p, q in zip(modes[m], combine(linear[h], affine), strict=True)] for h, m in enumerate(HOURGLASS)
    ]
    mean_affine = [combine((1.0, *(row[k] for row in mean)), (affine[k], *beyond[:3])) for k in range(3)]
    lowered, stretch = apply_metric(metric, mean_affine)
    # Averages over the cube of products of hourglass gradients: <xi^2> = 1/3, <xi^2 eta^2> = 1/9.
    xx, xy, xz, yy, yz, zz = [entry * (1 / 3) for entry in metric]
    conjugate = [
        combine((xx + yy, xz, yz), (beyond[0], beyond[1], beyond[2])),
        combine((yy + zz, xz, xy), (beyond[1], beyond[0], beyond[2])),
        combine((xx + zz, yz, xy), (beyond[2], beyond[0], beyond[1])),
        [(xx + yy + zz) * (1 / 3) * p for p in beyond[3]],
    ]
    for b, c in zip(beyond, conjugate, strict=True):
        stretch = stretch + dot(b, c)
    by_hourglass = [combine((1.0, *mean[h]), (conjugate[h], *lowered)) for h in range(3)] + [conjugate[3]]
    return MeanShear(stretch, lowered, by_hourglass, linear)


def one_point_forces(ar: Arithmetic, positions: Sequence[Vector], plane: Planes, theta: Number) -> list[Vector]:
    """Derivative of the energy of a one-point core element by its 8 nodal positions."""
    modes = modes_of(positions)
    shrink = shrinkage_of(plane, theta)
    volume, volume_gradient = hexahedron_volume(modes)
    jacobian = volume * (1 / 64) * plane(INVERSE_VOLUME)
    ratio = jacobian * shrink.inverse
    mean = mean_shear(modes, plane)
    isochoric = isochoric_factor(ar, ratio)
    shear = shrink.shear * isochoric.value
    spherical = plane(KAPPA) * (ratio - 1.0) + (BARRIER_STIFFNESS * barrier_overlap(ar, ratio)) * plane(MU)
    by_volume = isochoric.slope * (plane(INVERSE_VOLUME) * shrink.inverse)
    spherical = spherical - (shrink.shear * (1 / 3) * mean.stretch) * by_volume
    spherical = spherical * (1 / 64)
    modal = {m: [shear * p for p in vector] for m, vector in zip(HOURGLASS, mean.by_hourglass, strict=True)}
    for k, own in enumerate((XI, ETA, ZETA)):
        pulled_back = combine([row[k] for row in mean.linear], mean.by_hourglass)
        modal[own] = [shear * (p - q) for p, q in zip(mean.by_affine[k], pulled_back, strict=True)]
    for m, vector in volume_gradient.items():
        modal[m] = [p + spherical * q for p, q in zip(modal[m], vector, strict=True)]
    return nodal_from_modal(modal)


def one_point_energy(ar: Arithmetic, positions: Sequence[Vector], plane: Planes, theta: Number) -> Number:
    """The energy that `one_point_forces` is the gradient of."""
    modes = modes_of(positions)
    shrink = shrinkage_of(plane, theta)
    jacobian = hexahedron_volume(modes)[0] * (1 / 64) * plane(INVERSE_VOLUME)
    ratio = jacobian * shrink.inverse
    stretch = mean_shear(modes, plane).stretch
    overlap = barrier_overlap(ar, ratio)
    volumetric = 0.5 * plane(KAPPA) * ((ratio - 1.0) * (ratio - 1.0))
    barrier = 0.5 * BARRIER_STIFFNESS * plane(MU) * (overlap * overlap)
    fresh = 1.0 / plane(INVERSE_VOLUME)
    shear = 0.5 * (shrink.shear * isochoric_factor(ar, ratio).value * stretch - 3.0 * shrink.mu * fresh)
    return shear + fresh * shrink.volume * (volumetric + barrier)
