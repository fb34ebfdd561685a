"""Element algebra of the explicit kernel, written once over an abstract number.

Every function here is ordinary arithmetic on values that overload ``+ - * /``. What a "value" is decides the
back end: 16 lanes of LLVM vector IR (`vector_ir`), a name in generated source text (`source`), or a numpy array of
float64, one entry per element (`diagnostics`). So the force that marches, the energy that is reported and the volume
that is checked cannot drift apart.

Physics (Liu et al. 2014, Eq. 1-4; page ``physics/dehydration.md``): F = Fe Fd with Fd = theta I in the sarcocarp
("core") and Fd = I in the exocarp, Jd = theta^3, and the energy per fresh volume

    Jd [ mu/2 (J^(-2/3) I1(F) - 3) + kappa/2 (Jbar/Jd - 1)^2 ],        Jbar = deformed / fresh element volume,

(isochoric(Fe) = isochoric(F), so theta enters the shear part through Jd alone: `solver.material`) plus a barrier
against inversion, ``4 mu Jd (J/Jd - 0.6)^2`` where J/Jd < 0.6. Below J/Jd = 0.25 the factor J^(-2/3) continues along
its tangent, so that energy and force stay finite, and the force the exact gradient, even in an inverted element.

Conventions. Local node ``a`` of a hex8 sits at xi = +1 if ``a & 4``, eta = +1 if ``a & 2``, zeta = +1 if ``a & 1``
(else -1); zeta is radial. "Modes" are the eight unscaled butterfly sums of the nodal positions,

    x(xi, eta, zeta) = 1/8 sum_m mode[m] * (xi if m & 4) * (eta if m & 2) * (zeta if m & 1),

so that D_k = 8 dx/dxi_k is linear in them and F is never formed: with B = dxi/dX and w the fresh volume of a point,

    w I1 = sum_kl metric_kl D_k . D_l,   metric = w B B^T / 64,        J = det(D) * det(B) / 512.

The points of core and exocarp hold their metric as m1, m2, m3 on the diagonal between two unit triangles:

    w I1 = sum_k m_k |D'_k|^2,   D'_1 = D_1 + a D_2 + b D_3,   D'_2 = D_2 + c D_3,   D'_3 = D_3,   det(D') = det(D).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeAlias

Number: TypeAlias = Any
"""A value of one back end; supports ``+ - * /`` with its like and with floats."""
Vector: TypeAlias = list[Number]
"""Three components."""

GAUSS = 3.0**-0.5
XI, ETA, ZETA = 4, 2, 1
DIRECTIONS = ((XI, ETA, ZETA), (ETA, XI, ZETA), (ZETA, XI, ETA))
"""For each derivative direction: its own bit, then the bits of the two coordinates it depends on."""
SIGNS = (-1, 1)
GAUSS_SIGNS = tuple((a, b, c) for a in SIGNS for b in SIGNS for c in SIGNS)
"""Signs of (xi, eta, zeta) at the eight points of the 2x2x2 rule, in stored order."""
HOURGLASS = (XI | ETA, ETA | ZETA, XI | ZETA, XI | ETA | ZETA)

FULL_SHARE = 0.1
"""Share of the exocarp integrated 2x2x2; the rest uses two points through the thickness at the in-plane centre
(full integration locks in shear, none at all leaves hourglass modes)."""
LINE = (29 / 27) ** 0.5
"""Places of these two points, zeta = -LINE and +LINE. An element has one pressure, so that what bends within a layer is
borne by the deviatoric stress alone, which is a third of what a plate that keeps its volume has (2/3 mu e^2 of 2 mu e^2
where it bends along one direction). The mean of zeta^2 over all points is therefore 1 in place of 1/3: FULL_SHARE / 3 +
(1 - FULL_SHARE) LINE^2 = 1. Then a skin of two layers bends with its full stiffness, at Gauss points with 5/6 of it.
Every plane wave bends a plate along one direction, and the rest of a bending energy, its Gaussian curvature, integrates
to nothing."""
BARRIER_BELOW, BARRIER_STIFFNESS, TANGENT_BELOW = 0.6, 8.0, 0.25

MU, KAPPA, INVERSE_VOLUME, GEOMETRY = 0, 1, 2, 3
"""Stored planes of every element type: shear modulus, bulk modulus, 1 / fresh volume; then its fresh geometry."""
POINT = 7
"""Planes of a point of the core and the exocarp: a, b, c, m1, m2, m3 of its metric, see `upright`, and det(B) / 512.
Deriving them from the fresh positions in every step would be a third of an element's arithmetic."""
CORE_PLANES, EXOCARP_PLANES = GEOMETRY + 8 * POINT, GEOMETRY + 10 * POINT
LINEAR_PLANES = GEOMETRY + 6
MEAN_PLANES = LINEAR_PLANES + 12
ONE_POINT_PLANES = MEAN_PLANES + 9
"""One-point core: centre metric times the element's volume; what an affine motion puts into the 4 hourglass modes
(4 x 3); what the first 3 hourglass modes put into the mean deformation gradient (3 x 3)."""

CORE_WEIGHTS = (1.0,) * 8
EXOCARP_WEIGHTS = (FULL_SHARE,) * 8 + (4.0 * (1.0 - FULL_SHARE),) * 2
"""Quadrature weights on the cube [-1, 1]^3, in stored order (2x2x2 first, then zeta = -LINE, +LINE)."""


class Arithmetic(Protocol):
    """What a back end supplies besides the operators."""

    def minimum(self, a: Number, b: Number | float) -> Number:
        """The smaller of two; b if a is not a number."""

    def maximum(self, a: Number, b: Number | float) -> Number:
        """The larger of two; b if a is not a number."""

    def inverse_cube_root(self, a: Number) -> Number:
        """a^(-1/3) for a > 0, to 4e-5 at least."""


Planes: TypeAlias = Callable[[int], Number]
"""Stored plane by index; loaded where it is first used."""


def refine_inverse_cube_root(value: Number, guess: Number) -> Number:
    """value^(-1/3) to 4e-5 from the bit-trick guess (3.4 % off), whose error this cubes."""
    defect = 1.0 - value * (guess * guess * guess)
    return guess + guess * defect * (1 / 3 + defect * (2 / 9))


INVERSE_CUBE_ROOT_MAGIC = float(0x54A2FA8C)
"""Bit pattern such that reinterpreting ``MAGIC - bits/3`` as float32 approximates the inverse cube root."""


def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus_cross(total: Vector, a: Vector, b: Vector) -> Vector:
    """Total plus the cross product, in multiply-adds."""
    return [(total[i] + a[j] * b[k]) - a[k] * b[j] for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))]


def dot(a: Vector, b: Vector) -> Number:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def combine(coefficients: Sequence[Number | float], vectors: Sequence[Vector]) -> Vector:
    """Sum of coefficient * vector; a leading coefficient of exactly 1.0 costs nothing."""
    first = coefficients[0]
    result = vectors[0] if isinstance(first, float) and first == 1.0 else [first * c for c in vectors[0]]
    for coefficient, vector in zip(coefficients[1:], vectors[1:], strict=True):
        result = [total + coefficient * component for total, component in zip(result, vector, strict=True)]
    return result


def modes_of(positions: Sequence[Vector]) -> list[Vector]:
    """Eight nodal positions -> eight modes (unscaled butterfly sums)."""
    modes = [list(position) for position in positions]
    for bit in (XI, ETA, ZETA):
        for m in range(8):
            if not m & bit:
                low, high = modes[m], modes[m | bit]
                modes[m] = [p + q for p, q in zip(low, high, strict=True)]
                modes[m | bit] = [q - p for p, q in zip(low, high, strict=True)]
    return modes


def nodal_from_modal(modal: dict[int, Vector]) -> list[Vector]:
    """Adjoint of `modes_of`: derivatives by modes 1..7 -> derivatives by nodal positions (mode 0 is a translation)."""
    nodal: list[list[Number] | None] = [None] + [modal[m] for m in range(1, 8)]
    for bit in (XI, ETA, ZETA):
        for m in range(8):
            if not m & bit:
                low, high = nodal[m], nodal[m | bit]
                assert high is not None
                if low is None:
                    nodal[m], nodal[m | bit] = [0.0 - q for q in high], high
                else:
                    nodal[m] = [p - q for p, q in zip(low, high, strict=True)]
                    nodal[m | bit] = [p + q for p, q in zip(low, high, strict=True)]
    return [vector for vector in nodal if vector is not None]


def to_points(modes: Sequence[Vector]) -> list[Vector]:
    """Modes by what their coordinates are at the 2x2x2 points: there D_k are sums and differences of these."""
    scaled = [list(mode) for mode in modes]
    for m in HOURGLASS:
        scale = GAUSS**2 if m == (XI | ETA | ZETA) else GAUSS
        scaled[m] = [scale * component for component in scaled[m]]
    return scaled


def gauss_derivatives(scaled: Sequence[Vector]) -> list[list[Vector]]:
    """D = 8 dx/dxi at the 2x2x2 points, from `to_points`: [point][direction] -> vector.

    Each direction has only four distinct values.
    """
    by_signs: list[dict[tuple[int, int], Vector]] = []
    for own, u, v in DIRECTIONS:
        values: dict[tuple[int, int], Vector] = {}
        for su in SIGNS:
            even, odd = _signed(su, scaled[own], scaled[own | u]), _signed(su, scaled[own | v], scaled[7])
            for sv in SIGNS:
                values[su, sv] = _signed(sv, even, odd)
        by_signs.append(values)
    return [[by_signs[0][b, c], by_signs[1][a, c], by_signs[2][a, b]] for a, b, c in GAUSS_SIGNS]


def _signed(sign: int, first: Vector, second: Vector) -> Vector:
    """First + sign * second."""
    pairs = zip(first, second, strict=True)
    return [p + q for p, q in pairs] if sign > 0 else [p - q for p, q in pairs]


def centre_line_derivatives(scaled: Sequence[Vector]) -> list[list[Vector]]:
    """D at the two points on the in-plane centre line, zeta = -LINE and +LINE, from `to_points`: [point][direction]."""
    return [
        [
            [p + (s * LINE / GAUSS) * q for p, q in zip(scaled[XI], scaled[XI | ZETA], strict=True)],
            [p + (s * LINE / GAUSS) * q for p, q in zip(scaled[ETA], scaled[ETA | ZETA], strict=True)],
            list(scaled[ZETA]),
        ]
        for s in SIGNS
    ]


def modal_from_points(stress: Sequence[Sequence[Vector]]) -> dict[int, Vector]:
    """Adjoint of `to_points`, then `gauss_derivatives` and `centre_line_derivatives` (if ten points are given)."""
    modal: dict[int, Vector] = {}

    def add(mode: int, vector: Vector) -> None:
        modal[mode] = [p + q for p, q in zip(modal[mode], vector, strict=True)] if mode in modal else vector

    for k, (own, u, v) in enumerate(DIRECTIONS):
        sums: dict[tuple[int, int], Vector] = {}
        for signs, point in zip(GAUSS_SIGNS, stress[:8], strict=True):
            key = (signs[1] if k == 0 else signs[0], signs[1] if k == 2 else signs[2])
            sums[key] = [p + q for p, q in zip(sums[key], point[k], strict=True)] if key in sums else point[k]
        plus = {su: _signed(1, sums[su, 1], sums[su, -1]) for su in SIGNS}
        minus = {su: _signed(-1, sums[su, 1], sums[su, -1]) for su in SIGNS}
        add(own, _signed(1, plus[1], plus[-1]))
        add(own | u, _signed(-1, plus[1], plus[-1]))
        add(own | v, _signed(1, minus[1], minus[-1]))
        add(7, _signed(-1, minus[1], minus[-1]))
    if len(stress) > len(GAUSS_SIGNS):
        low, high = stress[8:]
        for k, own in enumerate((XI, ETA)):
            add(own, _signed(1, high[k], low[k]))
            add(own | ZETA, [(LINE / GAUSS) * p for p in _signed(-1, high[k], low[k])])
        add(ZETA, _signed(1, high[2], low[2]))
    scaled = to_points([modal.get(m, []) for m in range(8)])
    return {m: scaled[m] for m in modal}


def hexahedron_volume(modes: Sequence[Vector]) -> tuple[Number, dict[int, Vector]]:
    """Exact volume of the trilinear hex times 64, and its derivatives by the modes (mode 7 does not enter)."""
    x, y, z, xy, yz, xz = (modes[m] for m in (XI, ETA, ZETA, XI | ETA, ETA | ZETA, XI | ZETA))
    third = 1 / 3

    def plus_third(a: Vector, b: Vector) -> Vector:
        return [p + third * q for p, q in zip(a, b, strict=True)]

    def thirds(a: Vector, b: Vector) -> Vector:
        return [third * (p + q) for p, q in zip(a, b, strict=True)]

    gradient = {
        XI: plus_third(cross(y, z), cross(xy, xz)),
        ETA: plus_third(cross(z, x), cross(yz, xy)),
        ZETA: plus_third(cross(x, y), cross(xz, yz)),
        XI | ETA: thirds(cross(y, yz), cross(xz, x)),
        ETA | ZETA: thirds(cross(xy, y), cross(z, xz)),
        XI | ZETA: thirds(cross(yz, z), cross(x, xy)),
    }
    return dot(x, gradient[XI]) + dot(yz, gradient[ETA | ZETA]), gradient


def apply_metric(metric: Sequence[Number], derivatives: Sequence[Vector]) -> tuple[list[Vector], Number]:
    """H_k = sum_l metric_kl D_l (metric stored 11, 12, 13, 22, 23, 33) and sum_k D_k . H_k = w I1."""
    rows = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
    lowered = [combine([metric[j] for j in row], derivatives) for row in rows]
    return lowered, dot(derivatives[0], lowered[0]) + dot(derivatives[1], lowered[1]) + dot(derivatives[2], lowered[2])


def upright(triangle: Sequence[Number], derivatives: Sequence[Vector]) -> list[Vector]:
    """D' of the module's head; triangle: a, b, c."""
    a, b, c = triangle
    first, second, third = derivatives
    return [
        [x + a * y + b * z for x, y, z in zip(first, second, third, strict=True)],
        [y + c * z for y, z in zip(second, third, strict=True)],
        third,
    ]


def upright_adjoint(triangle: Sequence[Number], stress: Sequence[Vector]) -> list[Vector]:
    """Derivatives of an energy by D' -> by D."""
    a, b, c = triangle
    first, second, third = stress
    return [
        first,
        [y + a * x for x, y in zip(first, second, strict=True)],
        [z + b * x + c * y for x, y, z in zip(first, second, third, strict=True)],
    ]


def triangles_of(metric: Sequence[Number]) -> list[Number]:
    """a, b, c, m1, m2, m3 of a metric stored 11, 12, 13, 22, 23, 33."""
    xx, xy, xz, yy, yz, zz = metric
    a, b = xy / xx, xz / xx
    second = yy - a * xy
    c = (yz - a * xz) / second
    return [a, b, c, xx, second, zz - b * xz - c * c * second]
