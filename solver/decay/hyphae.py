"""What stands on a mouldy skin: threads and spore heads by species, for files and pictures. No field depends on it.

Lengths are those of the fruit's radius, larger than life where life is too fine to be drawn: the words of plant
pathologists for what is seen chose them, no measurement did (docs/decay.md).
"""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["FURS", "Hyphae"]


class Hyphae(BaseModel):
    """Threads of a full-grown mould; thin mould has fewer and shorter ones."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    density: float = Field(2500.0, ge=0, le=50_000, description="Threads on an area of r1^2 [1/r1^2]")
    length: float = Field(0.03, ge=0, le=1, description="Length of a thread [r1]")
    width: float = Field(0.004, gt=0, le=0.1, description="Width of a thread at its foot [r1]")
    lean: float = Field(0.35, ge=0, le=3, description="How far threads lean and bend aside, over their length [1]")
    head: float = Field(0.0, ge=0, le=0.1, description="Radius of the spore head on a ripe thread; 0: none [r1]")
    mat: float = Field(0.95, ge=0, le=1, description="Share of the skin that a full-grown mould's felt hides [1]")
    margin: float = Field(
        0.5, ge=0, le=1, description="Share of the mould from whose rim inwards threads are white [1]"
    )


#: By species. Blue mould: tufts, white rim. Green mould: a dense powder, broad white margin. Neofabraea: few cream
#: cushions. Rhizopus: long grey threads with black heads, that lean over and reach beyond.
FURS: Mapping[str, Hyphae] = {
    "penicillium-expansum": Hyphae(density=2500, length=0.03, width=0.006, lean=0.35, margin=0.35),
    "penicillium-digitatum": Hyphae(density=5000, length=0.016, width=0.006, lean=0.2, margin=0.65),
    "neofabraea": Hyphae(density=500, length=0.014, width=0.010, lean=0.5, margin=0.2),
    "rhizopus": Hyphae(density=900, length=0.16, width=0.004, lean=1.1, head=0.008, margin=0.5, mat=0.6),
}
