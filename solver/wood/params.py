"""Parameters of a wood run: the bundle of rods, its material and grain, what holds, loads and hits it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from ..contract import Params
from .bodies import Body, Newtons, Rate, Vector, Waypoint
from .parts import Corner, Cut, Fork, Grain, Grip, GripPoint, Knot, Notch
from .shape.checks import check_shape, length_of
from .shape.outlines import check_outline, polygon_area

__all__ = ["Body", "Cut", "Fork", "Grain", "Grip", "GripPoint", "Knot", "Notch", "Waypoint", "WoodParams"]

#: The steepest slope of spiral grain: 27 degrees; rods stand for fibres along the bundle.
_STEEPEST = 0.5


class WoodParams(Params):
    """Sutherland 2012: discrete elastic rods along x, bonded into a round bundle about the x axis. SI units."""

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {
        "length": ("length", None),
        "radius": ("radius", None),
        "stiffness": ("stiffness", None),
        "strength": ("strain_limit", None),
        "toughness": ("toughness", None),
        "gravity": ("gravity", None),
    }

    length: float = Field(0.15, ge=1e-3, le=10, description="Length of the rods", json_schema_extra={"units": "m"})
    radius: float = Field(0.01, ge=1e-5, le=1, description="Radius of the bundle", json_schema_extra={"units": "m"})
    outline: tuple[Corner, ...] = Field(
        (),
        max_length=200,
        description="Corners y, z of the section, in order, instead of the round one of `radius`; its centroid becomes "
        "the axis",
        json_schema_extra={"units": "m"},
    )
    rods: int = Field(
        200,
        ge=1,
        le=5000,
        description="Rods wanted; the sampling comes within some percent",
        json_schema_extra={"units": "1"},
    )
    vertices: int = Field(
        30,
        ge=3,
        le=2000,
        description="Vertices of a rod at quality default; preview has half the edges, fine twice as many; slender "
        "bundles of many uneven rods get no fewer than they need to bend as a beam does",
        json_schema_extra={"units": "1"},
    )
    unevenness: float = Field(
        0.3,
        ge=0,
        le=0.9,
        description="Random part of the vertices' places; edges are within 1 +- this of their mean length, "
        "but for those that saw cuts move",
        json_schema_extra={"units": "1"},
    )
    reach: float = Field(
        1.7,
        ge=0,
        le=4,
        description="Rods closer than this are bonded, over the mean distance of rods; 0 bonds none",
        json_schema_extra={"units": "1"},
    )
    curvature: float = Field(
        0.0,
        ge=-100,
        le=100,
        description="Curvature of the unloaded axis, in the x-z plane",
        json_schema_extra={"units": "1/m"},
    )
    spine: tuple[Vector, ...] = Field(
        (),
        max_length=64,
        description="Points in space through which the unloaded axis passes, the start first; `length` is then its "
        "own, and sections have y and z as near to those of space as the start allows",
        json_schema_extra={"units": "m"},
    )
    taper: float = Field(
        1.0,
        ge=0.05,
        le=2,
        description="Radius (or size of the outline) at the end over that at the start; fibres run along the surface",
        json_schema_extra={"units": "1"},
    )
    fork: Fork | None = Field(
        None, description="Where it forks into a branch and the stem", json_schema_extra={"units": "1"}
    )
    stiffness: float = Field(
        10e9, ge=1e3, le=1e12, description="Young's modulus along the rods", json_schema_extra={"units": "Pa"}
    )
    density: float = Field(600.0, ge=1, le=2e4, description="Density", json_schema_extra={"units": "kg m-3"})
    transverse: float = Field(
        0.5e9, ge=0, le=1e12, description="Young's modulus across the rods", json_schema_extra={"units": "Pa"}
    )
    shear: float = Field(
        0.7e9, ge=0, le=1e12, description="Shear modulus along the rods", json_schema_extra={"units": "Pa"}
    )
    twist: bool = Field(
        False,
        description="Whether single rods resist twist (explicit only); a bonded bundle does so by its bonds",
        json_schema_extra={"units": "1"},
    )
    grain: Grain = Field(Grain(), description="Variation of the material", json_schema_extra={"units": "1"})
    notches: tuple[Notch, ...] = Field(
        (), max_length=64, description="Places of lower strength", json_schema_extra={"units": "1"}
    )
    fracture: Literal["none", "vertex", "stress"] = Field(
        "stress",
        description="Where rods break: nowhere, at vertices by Eq. 3.24, or anywhere by the strain of the outer fibre",
        json_schema_extra={"units": "1"},
    )
    strain_limit: float = Field(
        0.01, gt=0, le=10, description="Tensile strain at which a rod breaks", json_schema_extra={"units": "1"}
    )
    compressive_strength: float | None = Field(
        None,
        gt=0,
        le=1e12,
        description="Compressive stress along the rods at which they crush: they bear no more, and stay as short as "
        "they were pressed; by default they bear any",
        json_schema_extra={"units": "Pa"},
    )
    toughness: float = Field(
        250.0,
        gt=0,
        le=1e9,
        description="Energy of a crack along the grain that opens, G_Ic, per crack area",
        json_schema_extra={"units": "J m-2"},
    )
    toughness_sliding: float = Field(
        700.0,
        gt=0,
        le=1e9,
        description="Energy of a crack along the grain that slides, G_IIc, per crack area; at least the toughness",
        json_schema_extra={"units": "J m-2"},
    )
    mixing: float = Field(
        2.0,
        ge=0.5,
        le=10,
        description="Exponent between both (Benzeggagh and Kenane)",
        json_schema_extra={"units": "1"},
    )
    cleavage: float = Field(
        4e6,
        gt=0,
        le=1e12,
        description="Tensile stress across the grain at which wood begins to split",
        json_schema_extra={"units": "Pa"},
    )
    shear_strength: float = Field(
        8e6,
        gt=0,
        le=1e12,
        description="Shear stress along the grain at which it does",
        json_schema_extra={"units": "Pa"},
    )
    cascade: float = Field(
        0.02,
        gt=0,
        le=1,
        description="Most elastic energy that one pass of breaking may release, over what there is",
        json_schema_extra={"units": "1"},
    )
    clamp: Literal["none", "start", "both"] = Field(
        "start", description="Ends held in place and direction", json_schema_extra={"units": "1"}
    )
    pull: Rate = Field(
        (0.0, 0.0, 0.0),
        description="Velocity of the far clamp (clamp both); the rods between start with their even share of it",
        json_schema_extra={"units": "m/s"},
    )
    tip_load: tuple[Newtons, Newtons, Newtons] = Field(
        (0.0, 0.0, 0.0),
        description="Dead load on the far end, shared by the rods by their area",
        json_schema_extra={"units": "N"},
    )
    bend: float = Field(
        0.0,
        ge=-0.3,
        le=0.3,
        description="Deflection at the start over the length: half a sine if free, a loaded beam if clamped",
        json_schema_extra={"units": "1"},
    )
    gravity: float = Field(0.0, ge=-100, le=100, description="Gravity along -z", json_schema_extra={"units": "m s-2"})
    damping: float = Field(
        0.0, ge=0, le=1e5, description="Rate at which velocities of the wood decay", json_schema_extra={"units": "1/s"}
    )
    bodies: tuple[Body, ...] = Field(
        (), max_length=32, description="Rigid bodies, on given paths or free", json_schema_extra={"units": "1"}
    )
    cuts: tuple[Cut, ...] = Field(
        (), max_length=64, description="Saw cuts through rods and bonds", json_schema_extra={"units": "1"}
    )
    grips: tuple[Grip, ...] = Field(
        (),
        max_length=32,
        description="Jaws that move and turn parts of it (explicit only)",
        json_schema_extra={"units": "1"},
    )
    contact_stiffness: float | None = Field(
        None,
        gt=0,
        le=1e12,
        description="Stiffness of the contact of a mean edge, or of as much of a rod as a narrower body covers; "
        "by default a tenth of an edge's in tension",
        json_schema_extra={"units": "N/m"},
    )
    rod_contact: bool | None = Field(
        None,
        description="Whether rods touch each other where no bond holds them apart; by default where they may break, in "
        "explicit runs",
        json_schema_extra={"units": "1"},
    )
    rod_friction: float = Field(
        0.3, ge=0, le=2, description="Coulomb friction between rods", json_schema_extra={"units": "1"}
    )
    mass_scaling: float = Field(
        1.0,
        ge=1,
        le=1e6,
        description="Mass that resists bending and stretching over the real one, for slow loads: explicit steps are "
        "sqrt of it longer; fragments as a whole keep their real mass",
        json_schema_extra={"units": "1"},
    )
    mode: Literal["explicit", "static", "auto"] = Field(
        "explicit",
        description="Explicit in time, equilibrium at every stage, or auto: equilibria, scaled or real masses as the "
        "loads' rate allows; the result says which, why, and at which expected error",
        json_schema_extra={"units": "1"},
    )
    step: float | None = Field(
        None,
        gt=0,
        le=10,
        description="Step; one that is not stable is shortened. By default it follows from the quality",
        json_schema_extra={"units": "s"},
    )

    @property
    def wide(self) -> float:
        """Radius of the disk of the section's area [m]."""
        return (abs(polygon_area(self.outline)) / math.pi) ** 0.5 if self.outline else self.radius

    @property
    def crush_strain(self) -> float:
        """Compressive strain at which rods crush; inf: at none."""
        return math.inf if self.compressive_strength is None else self.compressive_strength / self.stiffness

    @property
    def bent(self) -> bool:
        """Whether it is curved where nothing loads it."""
        return self.curvature != 0 or bool(self.spine) or self.fork is not None

    @property
    def turning(self) -> bool:
        """Whether rods resist twist: where they are curved unloaded, their frames know in which plane."""
        return self.twist or self.bent or self.grain.deviates

    @property
    def touching(self) -> bool:
        """Whether rods touch each other."""
        chosen = self.rod_contact
        return chosen if chosen is not None else self.mode != "static" and self.fracture != "none" and self.rods > 1

    @model_validator(mode="before")
    @classmethod
    def _measured(cls, values: object) -> object:
        """Take the axis' own length where none is given."""
        if isinstance(values, dict) and values.get("spine") and "length" not in values:
            return {**values, "length": length_of(values["spine"])}
        return values

    @field_validator("mode", mode="before")
    @classmethod
    def _known(cls, value: object) -> object:
        if value == "implicit":
            raise ValueError("implicit steps are gone: set mode explicit, for slow loads with a mass_scaling of 1e4")
        return value

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.outline:
            check_outline(self.outline)
        if self.wide > self.length:
            raise ValueError("the bundle is wider than long: take a smaller radius or outline, or a longer length")
        check_shape(self)
        if abs(self.curvature) * self.wide > 0.5:
            raise ValueError("the axis is curved more sharply than the bundle is thick: take a smaller curvature")
        if abs(self.curvature) * self.length > 6.28:
            raise ValueError("the axis is curved into more than a full circle: take a smaller curvature or length")
        if self.mode == "static" and self.turning:
            raise ValueError(
                "twist, curved axes, forks, spiral grain and knots need the explicit mode: set mode explicit"
            )
        if any(not 0 <= k.at[0] <= self.length for k in self.grain.knots):
            raise ValueError("a knot lies beyond an end: its x is between 0 and the length")
        away = math.hypot(*self.grain.pith) + self.wide
        if abs(self.grain.spiral) * away > _STEEPEST:
            raise ValueError(
                f"the grain is steeper than {_STEEPEST:g} at the rim: take a smaller spiral, or a pith that is nearer"
            )
        if self.mode == "auto" and self.mass_scaling > 1:
            raise ValueError("auto chooses the masses itself: leave mass_scaling out, or set mode explicit")
        if self.mode == "static" and self.mass_scaling > 1:
            raise ValueError("mass scaling is for the explicit mode: set mode explicit, or mass_scaling 1")
        if self.mode == "static" and self.rod_contact:
            raise ValueError("equilibria know no contact of rods: set rod_contact false, or another mode")
        if self.mode == "static" and (self.clamp == "none" or self.bodies or self.grips or any(self.pull)):
            raise ValueError(
                "equilibria need a clamped end, no bodies, no grips and no pull: set clamp start, or another mode"
            )
        if any(self.pull) and self.clamp != "both":
            raise ValueError("a pull needs both ends clamped: set clamp both")
        if any(self.tip_load) and self.clamp == "both":
            raise ValueError("the far end is clamped and carries no load: set clamp start, or pull")
        if self.toughness_sliding < self.toughness:
            raise ValueError(
                "cracks that slide cost less than those that open: give toughness_sliding at least toughness"
            )
        if self.bend and self.bent:
            raise ValueError("a bent start of a curved bundle is not defined: set bend to 0, or leave the curve out")
        if any(n.position > self.length for n in self.notches):
            raise ValueError("a notch lies beyond the end: its position is at most the length")
        return self
