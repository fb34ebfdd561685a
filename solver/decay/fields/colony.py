"""What grows: the kinetics of one organism, mould or rot, the climate it needs, and the named species.

Kider et al. 2011, Eq. 2-9 and Table 3. Their unit of length is the girth of the fruit (the width of their map), their
unit of time is a step of the automaton. Both are the same for every constant, so Table 3's numbers stand here as
printed. In the paper's climate `pace` says how many units of time pass in a day; in the cardinal one `speed` does: they
pass as fast as makes a front of the organism that quick at its best.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

__all__ = ["MOULDS", "PAPER_MOULDS", "PAPER_ROT", "ROTS", "Colony"]


class Colony(BaseModel):
    """Constants of Eq. 2-9 for one organism (the defaults are Table 3, Ito and Mizuno), and of its climate."""

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
    speed: float = Field(
        4.6, ge=0, le=200, description="How fast a colony's radius grows at its best, at growth_rate 50 [mm/day]"
    )
    coldest: float = Field(-5.0, ge=-20, le=60, description="Temperature below which it does not grow [degC]")
    best: float = Field(24.0, ge=-20, le=80, description="Temperature at which it grows fastest [degC]")
    hottest: float = Field(33.0, ge=-20, le=100, description="Temperature above which it does not grow [degC]")
    driest: float = Field(0.83, ge=0, lt=1, description="Water activity below which it does not grow [1]")
    wettest: float = Field(0.98, gt=0, le=1, description="Water activity from which on it grows fastest [1]")
    lag: float = Field(1.0, ge=0, le=60, description="Days at its best before a spore or a wound starts to grow [day]")
    exposed: float = Field(0.0, ge=0, le=1, description="Share of it that lives in the air and not in the flesh [1]")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.coldest < self.best < self.hottest:
            raise ValueError("temperatures must rise: coldest, best, hottest")
        if 2 * self.best <= self.coldest + self.hottest:
            raise ValueError("the best temperature lies nearer to the hottest than to the coldest (Rosso et al. 1993)")
        if not self.driest < self.wettest:
            raise ValueError("water activities must rise: driest, wettest")
        return self


#: Where each figure comes from, and which ones are choices, stands in docs/decay.md ("Climate"). Of a mould the rot is
#: the lesion in the flesh; the felt on it, `MOULDS`, has the same climate, comes later, and partly lives in the air.
_CLIMATES: Mapping[str, Mapping[str, float]] = {
    "penicillium-expansum": {"speed": 4.6, "coldest": -5, "best": 24, "hottest": 33, "driest": 0.83},
    "penicillium-digitatum": {"speed": 7.0, "coldest": 3, "best": 24, "hottest": 32, "driest": 0.90},
    "neofabraea": {"speed": 2.2, "coldest": -4, "best": 20, "hottest": 30, "driest": 0.90},
    "rhizopus": {"speed": 40.0, "coldest": 5, "best": 26.7, "hottest": 35, "driest": 0.93},
    "erwinia": {"speed": 10.0, "coldest": 5, "best": 28, "hottest": 37, "driest": 0.94},
}
#: Days at the best temperature before the lesion grows, and before the felt on it does.
_LAGS: Mapping[str, tuple[float, float]] = {
    "penicillium-expansum": (0.3, 1.8),
    "penicillium-digitatum": (1.5, 2.5),
    "neofabraea": (0.5, 4.0),
    "rhizopus": (0.4, 0.8),
    "erwinia": (0.4, 0.4),
}
#: Of Rhizopus less is in the air: it lives in what leaks.
_EXPOSED = {"rhizopus": 0.05}

#: Motility of Table 3 over 2: a lesion's edge is sharp, and a front so narrow forms within a day of the lag.
_SHARP = 0.005
#: Rots by species.
ROTS: Mapping[str, Colony] = {
    name: Colony(sigma1=_SHARP, lag=_LAGS[name][0], **climate) for name, climate in _CLIMATES.items()
}
#: Moulds by species.
MOULDS: Mapping[str, Colony] = {
    name: Colony(sigma1=_SHARP, lag=_LAGS[name][1], exposed=_EXPOSED.get(name, 0.1), **climate)
    for name, climate in _CLIMATES.items()
    if name != "erwinia"
}
#: The paper's moulds, for its climate. Only Table 3 is published; the paces are guessed and not fitted to any data.
PAPER_MOULDS: Mapping[str, Colony] = {
    name: Colony(pace=pace)
    for name, pace in {
        "penicillium-expansum": 7.0,
        "penicillium-digitatum": 6.0,
        "neofabraea": 2.5,
        "rhizopus": 8.0,
    }.items()
}
#: The paper gives no numbers for bacteria: Table 3 with twice the motility, so that rot runs ahead of the mould.
PAPER_ROT = Colony(sigma1=0.02)
