"""Parameters of a growth run: the start shape, its sheet, what holds it, and the tools that grow it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, JsonValue, model_validator

from ..contract import Params
from .matter import Bed, Colour, Rib, Thickness
from .own.imported import OwnMesh
from .shapes import Shape, start
from .solids import Solid, check_outside, check_pace
from .tooling.places import Place, check_mapped
from .tooling.tools import HotSurface, Tool

__all__ = ["Attachment", "Bending", "GrowthParams"]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Speed = Annotated[float, Field(ge=-100, le=100)]
Weight = Annotated[float, Field(ge=-1, le=1)]


class Attachment(_Model):
    """Vertices that are held where they start, or led on from there, in some directions."""

    where: Place = Field(description="Vertices whose share is at least one half")
    axes: tuple[Literal["x", "y", "z"], ...] = Field(("x", "y", "z"), min_length=1, description="Held directions")
    velocity: tuple[Speed, Speed, Speed] = Field(
        (0.0, 0.0, 0.0), description="How it is led along the held directions [start shape's unit per growth time]"
    )

    @model_validator(mode="after")
    def _led(self) -> Self:
        loose = [axis for axis, speed in zip("xyz", self.velocity, strict=True) if speed and axis not in self.axes]
        if loose:
            raise ValueError(f"what is led along {', '.join(loose)} must be held there; add it to its axes")
        return self


#: Vertices of a start shape by which it is told whether a sheet begins inside a solid.
_LOOKED_AT = 1000

Bending = Literal["hinges", "mean_curvature"]


def _units(units: str) -> dict[str, JsonValue]:
    return {"units": units}


class GrowthParams(Params):
    """Combaz and Neyret 2004: a thin shell whose rest state is grown by tools; quasi-static."""

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {
        "thickness": ("thickness", None),
        "pressure": ("pressure", None),
        "plasticity": ("plasticity", None),
    }

    shape: Shape = Field("sphere", description="Start shape", json_schema_extra=_units("1"))
    mesh: OwnMesh | None = Field(
        None, description="A triangle mesh to start from in place of `shape`", json_schema_extra=_units("1")
    )
    aspect: float = Field(
        4.0,
        ge=0.2,
        le=50,
        description="Length over width of a strip or triangle, height over radius of what is round, without the half "
        "spheres that close a stem or capsule, radii of a torus",
        json_schema_extra=_units("1"),
    )
    tools: tuple[Tool, ...] = Field(
        (HotSurface.model_validate({"where": {"kind": "everywhere"}}),),
        max_length=200,
        description="What grows it, and when",
        json_schema_extra=_units("1"),
    )
    thickness: float = Field(
        0.03,
        ge=0.001,
        le=0.5,
        description="Thickness of the sheet: thicker folds wider",
        json_schema_extra=_units("start shape's unit"),
    )
    thicknesses: tuple[Thickness, ...] = Field(
        (),
        max_length=50,
        description="Where the sheet is thicker, or thinner, than `thickness`; of several the factors multiply",
        json_schema_extra=_units("1"),
        # runs without a map keep their keys
        exclude_if=lambda value: not value,
    )
    poisson: float = Field(0.3, ge=0, le=0.49, description="Poisson's ratio", json_schema_extra=_units("1"))
    bending: Bending = Field(
        "hinges",
        description="What resists bending: angles between triangles, or, as the paper has it, the mean curvature of "
        "vertices: blind to saddles, right only for what is closed or clamped all round",
        json_schema_extra=_units("1"),
    )
    curved: bool = Field(
        True,
        description="Whether the start shape's curvature is its rest curvature (else it wants to be flat)",
        json_schema_extra=_units("1"),
    )
    imperfection: float = Field(
        0.02,
        ge=0,
        le=1,
        description="Rms of the random normal offset that breaks symmetry, over the thickness",
        json_schema_extra=_units("1"),
    )
    pressure: float = Field(
        0.0,
        ge=-10,
        le=10,
        description="Pressure along the normal, frozen in each step, over mu per unit length",
        json_schema_extra=_units("1"),
    )
    normal_force: float = Field(
        0.0,
        ge=-10,
        le=10,
        description="How much of its compression pushes a sheet along its normal (the paper's F_N), frozen in a step",
        json_schema_extra=_units("1/start shape's unit"),
    )
    gravity: tuple[Weight, Weight, Weight] = Field(
        (0.0, 0.0, 0.0),
        description="Weight of the sheet per rest area, a dead load, over mu; up to 1 each way",
        json_schema_extra=_units("1"),
    )
    plasticity: float = Field(
        0.0,
        ge=0,
        le=1,
        description="Share k of the strain beyond the yield that is forgotten in each step",
        json_schema_extra=_units("1"),
    )
    yield_strain: float = Field(
        0.05, ge=0, le=1, description="Strain alpha below which nothing is forgotten", json_schema_extra=_units("1")
    )
    bed: Bed | None = Field(
        None,
        description="What the sheet lies on, which makes its folds as long and as regular as asked for",
        json_schema_extra=_units("1"),
    )
    ribs: tuple[Rib, ...] = Field(
        (),
        max_length=50,
        description="What resists bending more, or less, than the sheet",
        json_schema_extra=_units("1"),
    )
    colours: tuple[Colour, ...] = Field(
        (), max_length=20, description="Coats of colour, the last on top", json_schema_extra=_units("1")
    )
    attached: tuple[Attachment, ...] = Field(
        (), max_length=20, description="What is held", json_schema_extra=_units("1")
    )
    solids: tuple[Solid, ...] = Field(
        (), max_length=20, description="Solids, at rest or moving", json_schema_extra=_units("1")
    )
    contact: Annotated[float, Field(ge=0, le=1)] | None = Field(
        None,
        description="Distance that parts keep from each other; not given: the largest thickness; 0: they pass through",
        json_schema_extra=_units("start shape's unit"),
    )
    step: float = Field(
        0.05, ge=0.001, le=10, description="Growth between two equilibria", json_schema_extra=_units("growth time")
    )
    remesh: float = Field(
        1.6,
        ge=0,
        le=10,
        description="Rest edges longer than this, over those of the start, are split; 0 never",
        json_schema_extra=_units("1"),
    )
    solver: Literal["quasi_newton", "lbfgs", "cg"] = Field(
        "quasi_newton", description="Way to equilibrium; cg is the paper's", json_schema_extra=_units("1")
    )
    active: bool = Field(
        False,
        description="Whether a part that grows settles alone where the rest stays in balance; not where parts touch",
        json_schema_extra=_units("1"),
    )

    @model_validator(mode="after")
    def _in_its_unit(self) -> Self:
        size = max(map(float, np.ptp(self.mesh.shape().x, axis=0))) if self.mesh else np.inf
        if self.thickness > size:
            raise ValueError(
                f"the mesh is {size:.4g} wide, and its sheet, with {self.thickness:g}, thicker than that: is it in "
                "another unit? Thickness and tools are meant for a shape some 2 wide: "
                f"scale it by {float(f'{2 / size:.2g}'):.10g}, or take a smaller `thickness`"
            )
        return self

    @model_validator(mode="after")
    def _slow(self) -> Self:
        for solid in self.solids:
            check_pace(solid, self.step)
        return self

    @model_validator(mode="after")
    def _mapped(self) -> Self:
        if self.mesh is None or not self.mesh.uv:
            for part in (self.tools, self.thicknesses, self.ribs, self.colours, self.attached, self.bed):
                check_mapped(part)
        return self

    @model_validator(mode="after")
    def _outside(self) -> Self:
        first = [(k, solid) for k, solid in enumerate(self.solids) if not solid.start]
        if not first:
            return self
        sheet = self.mesh.shape() if self.mesh else start(self.shape, _LOOKED_AT, self.aspect)
        for number, solid in first:
            check_outside(f"solid {number}", solid, sheet, self.thickness)
        return self

    @model_validator(mode="after")
    def _held(self) -> Self:
        held = {axis for one in self.attached for axis in one.axes}
        loose = [axis for axis, weight in zip("xyz", self.gravity, strict=True) if weight and axis not in held]
        if loose and not self.solids:
            raise ValueError(
                f"nothing holds the sheet along {', '.join(loose)}, where gravity pulls: it would fall without end; "
                "attach a part of it, or put a solid below"
            )
        return self
