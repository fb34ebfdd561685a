"""Parameters of a dehydration run: the fruit, the moduli's ratio, how it dries and what starts the buckles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..arrays import Floats
from ..fruit import Fruit
from ..painted import Painted, PaintedMap, painted
from ..rounding import towards_zero

__all__ = ["DehydrationParams", "LightMap", "Pattern"]

Gradient = Annotated[float, Field(ge=-0.8, le=0.8)]
Factor = Annotated[float, Field(ge=0.0, le=2.0)]
Brightness = Annotated[float, Field(ge=-4.0, le=4.0)]

#: Longest gradient of wetness, in 1/r1.
STEEPEST = 0.8
#: Brightest illumination that a run may have, in units of that at which flesh dries as the stage says.
BRIGHTEST = 5.0


class Pattern(BaseModel):
    """A stage of a stored run whose wrinkles another run starts from."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    key: str = Field(pattern="^[0-9a-f]{64}$", description="Key of the stored run")
    stage: float = Field(description="Stage of it [1]")
    amplitude: float = Field(0.2, gt=0, le=0.5, description="Largest height, in exocarp thicknesses")


class LightMap(PaintedMap):
    """How brightly a fruit is lit from place to place, painted; without one, 1 all around."""

    values: Painted = Field(min_length=1, description="n rows of 2 n values from 0 to 1, from the pole y > 0 down")
    dark: float = Field(0.0, ge=0, le=BRIGHTEST, description="Illumination where the map is 0 [1]")
    bright: float = Field(2.0, ge=0, le=BRIGHTEST, description="Illumination where the map is 1 [1]")


class DehydrationParams(Fruit):
    """Liu et al. 2014: F = Fe Fd, Fd = I in the exocarp, rigid stone.

    In the sarcocarp Fd = diag(1 - a_i s (1 - g . X)): (1 - s) I unless wetness g or anisotropy a say otherwise.
    Under an illumination E theta is inversely proportional to it: s E / (1 - s + s E) stands in place of s.
    """

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {
        **Fruit.axes,
        "gamma": ("modulus_ratio", None),
        **{f"w{x}": ("wetness", i) for i, x in enumerate("xyz")},
        **{f"a{x}": ("anisotropy", i) for i, x in enumerate("xyz")},
    }

    modulus_ratio: float = Field(
        10.0,
        ge=1.0,
        le=1000.0,
        description="Shear modulus of the exocarp over that of the sarcocarp",
        json_schema_extra={"units": "1", "axes": ["gamma"]},
    )
    imperfection: float = Field(
        1e-3,
        ge=0.0,
        le=0.01,
        description="Largest amplitude of the smooth bumps on the fresh shape that start the buckles",
        json_schema_extra={"units": "r1"},
    )
    imperfection_kind: Literal["waves", "mode"] = Field(
        "waves",
        description="What the bumps are: seeded random waves, or the first buckling mode of this fruit",
        json_schema_extra={"units": "1"},
    )
    pattern: Pattern | None = Field(
        None,
        description="A stored run whose wrinkles are added to the bumps, so that a table's samples buckle alike",
        json_schema_extra={"units": "1"},
    )
    wetness: tuple[Gradient, Gradient, Gradient] = Field(
        (0.0, 0.0, 0.0),
        description="Gradient g of wetness across the fresh fruit (light, humidity, pressure): the local shrinkage is "
        "s (1 - g . X), so that the side g points to dries less; at most 0.8 long",
        json_schema_extra={"units": "1/r1", "axes": ["wx", "wy", "wz"]},
    )
    anisotropy: tuple[Factor, Factor, Factor] = Field(
        (1.0, 1.0, 1.0),
        description="Factors on the local shrinkage along x, y (the poles) and z; 1, 1, 1 is isotropic",
        json_schema_extra={"units": "1", "axes": ["ax", "ay", "az"]},
    )

    light: tuple[Brightness, Brightness, Brightness] = Field(
        (0.0, 0.0, 0.0),
        # keys of runs that knew no light stay what they were
        exclude_if=lambda value: not any(value),
        description="Light l from the direction it points to: flesh whose ray from the centre is at angle a to it "
        "is lit by 1 + |l| cos a, by 1 where a is past 90 degrees, whichever way the skin above faces, and theta there "
        "is inversely proportional to it; at most 4 long",
        json_schema_extra={"units": "1"},
    )
    light_map: LightMap | None = Field(
        None,
        exclude_if=lambda value: value is None,
        description="A painted map of illumination in place of the 1 all around",
        json_schema_extra={"units": "1"},
    )

    mirrors: Literal["", "x", "y", "z", "xy", "xz", "yz", "xyz"] = Field(
        "",
        # keys of runs that knew no mirrors stay what they were
        exclude_if=lambda value: value == "",
        description="Mirror planes through the centre, by the axis across them: a half, a quarter or an eighth of the "
        "fruit is solved and stands for the whole. y, across the poles' axis, wants equal halves, and shows as bands "
        "alike on both sides of the equator of a long fruit",
        json_schema_extra={"units": "1"},
    )

    @model_validator(mode="after")
    def _mirrored(self) -> Self:
        if "y" in self.mirrors and self.radii[:7] != self.radii[6::-1]:
            raise ValueError("the two ends of the fruit differ (r1..r7): leave y out of mirrors")
        for field in ("wetness", "light"):
            parts = zip("xyz", getattr(self, field), strict=True)
            across = [name for name, part in parts if part and name in self.mirrors]
            if across:
                raise ValueError(f"{field} differs across a mirror plane: leave {', '.join(across)} out of mirrors")
        if self.mirrors and self.light_map is not None:
            raise ValueError("a light map may differ across a mirror plane: leave out mirrors")
        return self

    @model_validator(mode="after")
    def _dries(self) -> Self:
        steep = float(np.linalg.norm(self.wetness))
        if steep > STEEPEST * (1 + 1e-9):
            raise ValueError(
                f"wetness is {steep:.3g} long (at most {STEEPEST}): multiply wx, wy, wz by "
                f"{towards_zero(STEEPEST / steep)}"
            )
        strength = float(np.linalg.norm(self.light))
        if strength > (BRIGHTEST - 1) * (1 + 1e-9):
            most = BRIGHTEST - 1
            raise ValueError(
                f"light is {strength:.3g} long (at most {most:g}): multiply it by {towards_zero(most / strength)}"
            )
        wettest, _ = self.local_share
        if wettest < 0:
            raise ValueError(
                f"the flesh would swell where it is wettest (local shrinkage {wettest:.3g} s): "
                f"multiply wx, wy, wz by {towards_zero((1 - 1e-9) / (1 - wettest))}"
            )
        return self

    @property
    def local_share(self) -> tuple[float, float]:
        """Least and largest 1 - g . X over the sarcocarp: local shrinkage over s, before anisotropy."""
        if not any(self.wetness):
            return 1.0, 1.0
        # a linear function takes its extremes on the surface, and there on opposite sides of the centre
        theta, phi = np.meshgrid(np.linspace(0, np.pi, 91), np.linspace(0, 2 * np.pi, 73), indexing="ij")
        along = np.einsum("tpi,i->tp", self.sarcocarp(theta, phi), self.wetness)
        return float(1 - along.max()), float(1 - along.min())

    @property
    def is_lit(self) -> bool:
        """Whether some flesh is lit otherwise than the rest."""
        return any(self.light) or self.light_map is not None

    @property
    def dries_evenly(self) -> bool:
        """Whether Fd = (1 - s) I everywhere."""
        return not (self.is_lit or any(self.wetness)) and all(factor == 1.0 for factor in self.anisotropy)

    @property
    def stays_spherical(self) -> bool:
        """Whether the smooth fruit is a sphere at every shrinkage."""
        return self.is_sphere and self.dries_evenly

    def illumination(self, points: Floats) -> Floats:
        """Return how brightly flesh at fresh points (n, 3) is lit, shape (n,): by its ray from the centre.

        All flesh along a ray is lit alike; the skin's normal, which is another way on long fruits, does not enter.
        """
        rays = points / np.maximum(np.sqrt(np.einsum("ni,ni->n", points, points)), 1e-9)[:, None]
        found = np.ones(len(points))
        if self.light_map is not None:
            chosen = self.light_map
            found = chosen.dark + (chosen.bright - chosen.dark) * painted(chosen.values, rays)
        along: Floats = np.einsum("ni,i->n", rays, np.array(self.light))
        return found + np.maximum(along, 0.0)
