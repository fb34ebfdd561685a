"""What a run is given of the flesh that its fields go into."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Within"]


class Within(BaseModel):
    """Rot, nutrient and water as fields in the flesh; sources of the figures stand in docs/decay.md."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    skin: float = Field(
        0.01, ge=0.002, le=0.05, description="Thickness of the outermost flesh, which the maps of the skin are of [r1]"
    )
    water: float = Field(
        4.36e-11, ge=0, le=1e-7, description="Diffusivity of water in the flesh at 20 degC (pear's inner cortex) [m2/s]"
    )
    water_energy: float = Field(
        44.0, ge=0, le=200, description="Its activation energy (from the same at 1 and 20 degC) [kJ/mol]"
    )
