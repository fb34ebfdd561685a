"""What a quality means: mesh and error of a step; and what a run is expected to cost."""

from __future__ import annotations

from dataclasses import dataclass

from ..contract import Cost, Need, Quality
from .params import DecayParams

__all__ = ["Settings", "choose", "expected_cost"]

#: What has a layer to be stepped for.
ROT = frozenset({"rot", "substrate", "rotten_share", "mean_rot"})
MOULD = frozenset({"mould", "mould_active", "nutrient", "mouldy_share", "mean_mould", "mean_nutrient"})
FIELDS = ("position", "rot", "substrate", "mould", "mould_active", "nutrient")


@dataclass(frozen=True)
class Settings:
    """level: of the geodesic sphere. tolerance: relative L2 error of a step. longest: step [day]."""

    level: int
    tolerance: float
    longest: float

    @property
    def vertices(self) -> int:
        """Number of points on the surface."""
        return 10 * 4**self.level + 2


_LEVELS: dict[Quality, tuple[int, float]] = {"preview": (5, 1e-4), "default": (6, 3e-5), "fine": (7, 1e-5)}
#: Longest step, in units of the quicker organism's own time.
_LONGEST = 4.0
#: Measured on one busy core: seconds per step and vertex with both organisms, and a typical step in model time.
_SECONDS, _STEP = 4e-7, 0.2
#: Working memory per vertex, mesh and states of both organisms.
_BYTES = 1000


def choose(params: DecayParams, quality: Quality) -> Settings:
    """Return the settings of a quality; they follow from parameters and quality alone."""
    level, tolerance = _LEVELS[quality]
    return Settings(level, tolerance, _LONGEST / max(_clock(params), 0.1))


def expected_cost(params: DecayParams, need: Need) -> Cost:
    """Return what a run is expected to take."""
    settings = choose(params, need.quality)
    organisms = 2 if MOULD & set(need.fields) else 1 if ({*ROT, "budget_error"} & set(need.fields)) else 0
    steps = need.stages[-1] * _clock(params) / _STEP + len(need.stages)
    assert need.resolution is not None  # settled
    width = 8 if need.dtype == "float64" else 4
    values = sum((3 if f == "position" else 1) for f in FIELDS if f in need.fields) * 2 * need.resolution**2
    seconds = 1e-5 * settings.vertices + steps * settings.vertices * _SECONDS * organisms / 2
    return Cost(seconds, len(need.stages) * (values * width + 200) + settings.vertices * _BYTES)


def _clock(params: DecayParams) -> float:
    return max(params.rot.pace, params.mould.pace) * params.growth_rate / 50
