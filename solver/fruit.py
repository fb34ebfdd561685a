"""The fruit at rest: a spline generatrix turned about an elliptic equator, an ellipsoid stone and an exocarp.

Liu et al. 2014, section 4.1, Eq. 8-9, with the knots at their right spacing of pi/6. The generatrix lies in the
(x, y) plane; y carries the poles. The surface is described by colatitude (pi/2 minus the spline parameter) and
azimuth about y, from x towards z. Lengths are in units of the reference radius r1 = 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from .arrays import Floats
from .contract import Params
from .lattice import azimuths, colatitudes, directions, lattice, window
from .rounding import towards_zero

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

__all__ = ["PRESETS", "SIZES", "Fruit", "azimuths", "colatitudes", "directions", "lattice", "window"]


#: Deepest dent of the outline that is accepted, in units of r1. Jujube 1 of Table 1 has 0.037; the columns of the
#: mesh run along rays from the centre, and flesh folded deeper than this is no longer the paper's kind of fruit.
MAX_DENT = 0.08
#: Thinnest flesh between stone and exocarp, in units of r1.
MIN_FLESH = 0.02
#: Smallest half-axis of a stone, in units of r1; a fruit without a stone has (0, 0).
MIN_STONE = 0.05

Radius = Annotated[float, Field(ge=0.2, le=2.0)]
StoneRadius = Annotated[float, Field(ge=0.0, le=1.5)]


class Fruit(Params):
    """Ten shape parameters of a core/shell fruit (Liu et al. 2014, Eq. 9), in units of r1."""

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {
        **{f"r{i + 1}": ("radii", i) for i in range(1, 8)},
        "rs1": ("stone", 0),
        "rs2": ("stone", 1),
        "te": ("exocarp_thickness", None),
    }
    no_axes: ClassVar[Mapping[str, str]] = {
        "r1": "It is the unit of length, always 1: divide every other length by it."
    }

    radii: tuple[Radius, Radius, Radius, Radius, Radius, Radius, Radius, Radius] = Field(
        (1.0,) * 8,
        description="Sarcocarp radii: r1..r7 from pole to pole every 30 degrees, r8 the equator's other half-axis",
        json_schema_extra={"units": "r1", "axes": [f"r{i}" for i in range(2, 9)]},
    )
    stone: tuple[StoneRadius, StoneRadius] = Field(
        (0.4, 0.4),
        description="Half-axes of the rigid stone: along the pole axis, and across it (the third follows from r8/r4); "
        "0, 0 for a fruit without a stone",
        json_schema_extra={"units": "r1", "axes": ["rs1", "rs2"]},
    )
    exocarp_thickness: float = Field(
        0.04,
        ge=0.002,
        le=0.2,
        description="Thickness of the exocarp (skin), along the ray from the centre",
        json_schema_extra={"units": "r1", "axes": ["te"]},
    )

    @field_validator("radii")
    @classmethod
    def _unit(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if value[0] != 1.0:
            raise ValueError("r1 is the unit of length and must be 1: divide every length by r1")
        return value

    @field_validator("stone")
    @classmethod
    def _whole(cls, value: tuple[float, float]) -> tuple[float, float]:
        if min(value) < MIN_STONE and max(value) > 0:
            raise ValueError(
                f"a stone needs both half-axes of at least {MIN_STONE}, and a fruit without one has both 0: "
                "change rs1 and rs2 together"
            )
        return value

    @model_validator(mode="after")
    def _possible(self) -> Self:
        outline = self._outline()
        angle = np.unwrap(np.arctan2(outline[:, 1], outline[:, 0]))
        if outline[:, 0].min() < -1e-9 or np.diff(angle).min() <= 0:
            raise ValueError("the outline folds over itself as seen from the centre: bring neighbouring radii closer")
        # a circle has none, and the convex hull takes long to import
        dent = _dent(outline) if len(set(self.radii[:7])) > 1 else 0.0
        if dent > MAX_DENT:
            raise ValueError(
                f"the outline is concave, dented by {dent:.3f} r1 (at most {MAX_DENT}): bring r2..r7 closer to "
                "their neighbours"
            )
        theta, phi = np.meshgrid(np.linspace(0, np.pi, 91), np.linspace(0, 2 * np.pi, 72), indexing="ij")
        rays = self.sarcocarp(theta, phi)
        distance = np.linalg.norm(rays, axis=-1)
        flesh = float((distance - self.stone_distance(rays / distance[..., None])).min())
        # what is exactly enough may be less by a rounding
        if flesh < MIN_FLESH * (1 - 1e-9):
            s1, s2 = self.stone
            where = "pokes through the fruit" if flesh < 0 else "leaves too little flesh"
            raise ValueError(
                f"the stone {where} (thinnest flesh {towards_zero(flesh)} r1, at least {MIN_FLESH}): make the stone "
                f"radii rs1 = {s1:g}, rs2 = {s2:g} smaller, or the fruit radii larger"
            )
        return self

    @property
    def has_stone(self) -> bool:
        """Whether there is a stone at all."""
        return self.stone[0] > 0

    @property
    def is_sphere(self) -> bool:
        """Whether fruit and stone (if any) are concentric spheres, for which closed forms exist."""
        return len(set(self.radii)) == 1 and self.stone[0] == self.stone[1]

    @property
    def is_axisymmetric(self) -> bool:
        """Whether the equator is a circle."""
        return self.radii[3] == self.radii[7]

    def generatrix(self, colatitude: Floats) -> tuple[Floats, Floats]:
        """Return (x, y) of the sarcocarp's generatrix (Eq. 8) at colatitudes [radian], shapes as given.

        Equal radii are the paper's spherical fruit and give an exact circle, which the cubic spline through its
        seven points would miss by 2e-4.
        """
        phi = np.pi / 2 - np.asarray(colatitude, dtype=float)
        if len(set(self.radii[:7])) == 1:
            return self.radii[0] * np.cos(phi), self.radii[0] * np.sin(phi)
        spline = _spline(self.radii[:7])
        x, y = np.moveaxis(spline(phi), -1, 0)
        return x, y

    def sarcocarp(self, colatitude: Floats, azimuth: Floats) -> Floats:
        """Return points of the sarcocarp's surface, shape (..., 3), at colatitude and azimuth [radian]."""
        x, y = self.generatrix(colatitude)
        squash = self.radii[7] / self.radii[3]
        return np.stack(np.broadcast_arrays(x * np.cos(azimuth), y, squash * x * np.sin(azimuth)), axis=-1)

    def surface(self, colatitude: Floats, azimuth: Floats) -> Floats:
        """Return points of the fruit's fresh outer surface X, shape (..., 3): r_e = r_f + te along each ray."""
        inner = self.sarcocarp(colatitude, azimuth)
        distance = np.linalg.norm(inner, axis=-1, keepdims=True)
        found: Floats = inner * (1 + self.exocarp_thickness / distance)
        return found

    def stone_distance(self, rays: Floats) -> Floats:
        """Return the distance (...) from the centre to the stone's surface along unit rays (..., 3), 0 without one."""
        if not self.has_stone:
            return np.zeros(rays.shape[:-1])
        along, across = self.stone
        axes = np.array([across, along, across * self.radii[7] / self.radii[3]])
        found: Floats = 1 / np.linalg.norm(rays / axes, axis=-1)
        return found

    def _outline(self) -> Floats:
        x, y = self.generatrix(np.linspace(np.pi, 0, 361))
        return np.stack([x, y], axis=-1)


def _spline(radii: tuple[float, ...]) -> CubicSpline:
    """Return the clamped cubic spline (x(phi), y(phi)) through the seven control points."""
    from scipy.interpolate import CubicSpline  # spheres need none, and it takes half of a service's start to import

    knots = np.linspace(-np.pi / 2, np.pi / 2, 7)
    r = np.asarray(radii)
    points = np.stack([r * np.cos(knots), r * np.sin(knots)], axis=-1)
    ends: Any = ((1, [r[0], 0.0]), (1, [-r[-1], 0.0]))  # (dx, dy) at the two poles
    return CubicSpline(knots, points, bc_type=ends)


def _dent(outline: Floats) -> float:
    """Return how far the closed outline (n, 2) stays behind its convex hull at the worst place."""
    from scipy.spatial import ConvexHull

    closed = np.concatenate([outline, outline * [-1, 1]])
    facets = ConvexHull(closed).equations
    return float(-(closed @ facets[:, :2].T + facets[:, 2]).max(axis=1).min())


# --- Table 1 ----------------------------------------------------------------------------------------------------


def _preset(radii: tuple[float, ...], stone: tuple[float, float], te: float, gamma: float = 10.0) -> dict[str, Any]:
    return {"radii": radii, "stone": stone, "exocarp_thickness": te, "modulus_ratio": gamma}


#: The sphere of Figs. 6-9 and the six fruits of Table 1 (its wolfberry row lacks r8: a circular equator, r8 = r4), then
#: six more, ovals of published proportions:
#: raisin2: the slimmest fruit of Fig. 10, whose skin of 0.03 folds into few, deep creases, as of raisins one buys.
#: potato: length over width 1.2 to 1.5 (grades of trade; "ellipsoidal", Tabatabaeefar, Int. Agrophysics 16 (2002) 301).
#: banana: 27 mm thick, 140 mm long (the least that Regulation (EU) 1333/2011 lets be sold); straight, as all axes here.
#: passionfruit: a globe of 4 to 7.5 cm. date: 3 to 7 by 2 to 3 cm, its stone 2 to 2.5 cm by 6 to 8 mm.
#: pea: 10.48 by 8.93 by 8.61 mm (Ganjloo et al., Int. Food Research J. 25 (2018) 1246, at 75 % water).
#: Their skins are chosen, not measured: te = 0.02, the thinnest whose preview takes seconds as an eighth (a potato's
#: periderm, a pea's coat are thinner still), with Table 1's gamma; the passion fruit's tough rind thicker and stiffer.
PRESETS: Mapping[str, Mapping[str, Any]] = {
    "sphere": _preset((1.0,) * 8, (0.4, 0.4), 0.04),
    "jujube1": _preset((1, 1.15, 0.95, 0.85, 0.9, 1.15, 1, 0.85), (0.4, 0.3), 0.02),
    "jujube2": _preset((1, 0.95, 0.7, 0.67, 0.8, 1, 1, 0.67), (0.4, 0.2), 0.02),
    "plum1": _preset((1, 0.88, 0.8, 0.8, 0.8, 0.88, 1, 0.48), (0.6, 0.5), 0.01),
    "plum2": _preset((1, 0.98, 0.93, 0.9, 0.93, 0.98, 1, 0.63), (0.3, 0.3), 0.03),
    "raisin": _preset((1, 0.7, 0.5, 0.45, 0.5, 0.7, 1, 0.45), (0.3, 0.2), 0.01),
    "raisin2": _preset((1, 0.8321, 0.6547, 0.6, 0.6547, 0.8321, 1, 0.6), (0.3, 0.3), 0.03),
    "wolfberry": _preset((1, 0.7, 0.48, 0.42, 0.45, 0.62, 1, 0.42), (0.3, 0.2), 0.005),
    "potato": _preset((1, 0.91, 0.786, 0.74, 0.786, 0.91, 1, 0.74), (0.0, 0.0), 0.02),
    "banana": _preset((1, 0.389, 0.231, 0.2, 0.231, 0.389, 1, 0.2), (0.0, 0.0), 0.02),
    "passionfruit": _preset((1.0,) * 8, (0.0, 0.0), 0.05, 30.0),
    "date": _preset((1, 0.756, 0.555, 0.5, 0.555, 0.756, 1, 0.5), (0.45, 0.14), 0.02),
    "pea": _preset((1, 0.956, 0.883, 0.852, 0.883, 0.956, 1, 0.822), (0.0, 0.0), 0.02),
}

#: Length of r1 [m], half the fresh fruit's length; a raisin is then 1.5 cm long at s = 0.3. A sphere is of any size.
SIZES: Mapping[str, float] = {
    "jujube1": 0.014,
    "jujube2": 0.014,
    "plum1": 0.022,
    "plum2": 0.022,
    "raisin": 0.0085,
    "raisin2": 0.0085,
    "wolfberry": 0.009,
    "potato": 0.045,
    "banana": 0.09,
    "passionfruit": 0.03,
    "date": 0.02,
    "pea": 0.004,
}
