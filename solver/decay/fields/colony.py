"""What grows: the kinetics of one organism, mould or soft rot, and the named moulds.

Kider et al. 2011, Eq. 2-9 and Table 3. Their unit of length is the girth of the fruit (the width of their map), their
unit of time is a step of the automaton: `pace` says how many of those pass in a day. Both are the same for every
constant, so Table 3's numbers stand here as printed.
"""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["MOULDS", "SOFT_ROT", "Colony"]


class Colony(BaseModel):
    """Constants of Eq. 2-9 for one organism; the defaults are Table 3 (Ito and Mizuno)."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    pace: float = Field(7.0, gt=0, le=500, description="Units of the model's time in a day at growth_rate 50 [1/day]")
    sigma1: float = Field(0.01, ge=0, le=0.2, description="Scale of motility, Eq. 4 [1]")
    sigma2: float = Field(5.0, ge=0, le=50, description="Scale of consumption, Eq. 7 [1]")
    sigma3: float = Field(5.0, ge=0, le=50, description="Scale of turning inactive, Eq. 8 [1]")
    d1: float = Field(0.01, ge=0, le=1, description="Motility, Eq. 4 [1]")
    d2: float = Field(0.01, gt=0, le=1, description="Density at which motility ends, Eq. 4 [1]")
    f1: float = Field(1.0, ge=0, le=10, description="Consumption, Eq. 7 [1]")
    f2: float = Field(1.0, ge=0, le=100, description="Saturation of consumption by nutrient, Eq. 7 [1]")
    theta: float = Field(0.05, gt=0, le=1, description="Organism grown per nutrient consumed, Eq. 2 [1]")
    a1: float = Field(1 / 2400, gt=0, le=1, description="Density that keeps the organism active, Eq. 8 [1]")
    a2: float = Field(1 / 120, gt=0, le=10, description="Nutrient that keeps the organism active, Eq. 8 [1]")
    nutrient_diffusion: float = Field(1e-6, ge=0, le=1e-3, description="D_n of Eq. 9 [girth^2 per unit of time]")


#: The paper gives no numbers for bacteria: Table 3 with twice the motility, so that rot runs ahead of the mould.
SOFT_ROT = Colony(sigma1=0.02)

#: Only Table 3 is published. The paces are ours, guessed and not fitted to any data; see docs/decay.md.
MOULDS: Mapping[str, Colony] = {
    "penicillium-expansum": Colony(),
    "penicillium-digitatum": Colony(pace=6.0),
    "neofabraea": Colony(pace=2.5),
    "rhizopus": Colony(pace=8.0),
}
