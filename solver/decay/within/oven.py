"""What a run is given of an oven (D59); sources of the figures stand in docs/decay.md."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Oven"]


class Oven(BaseModel):
    """The fruit is put into hot air on day 0 and stays there."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    celsius: float = Field(180.0, ge=40, le=300, description="Temperature of its air [degC]")
    film: float = Field(25.0, gt=0, le=500, description="Heat that its air gives to the skin; a choice [W/(m2 K)]")
    conductivity: float = Field(0.427, gt=0, le=10, description="Conductivity of the flesh (apple) [W/(m K)]")
    diffusivity: float = Field(1.37e-7, gt=0, le=1e-5, description="Diffusivity of heat in the flesh (apple) [m2/s]")
