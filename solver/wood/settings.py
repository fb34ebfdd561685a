"""What a quality means: vertices and steps; and what a run is expected to cost."""

from __future__ import annotations

from dataclasses import dataclass

from ..contract import Cost, Need, Quality
from .params import WoodParams

__all__ = ["Settings", "choose", "expected_cost"]


@dataclass(frozen=True)
class Settings:
    """vertices: of a rod. courant: explicit step over the longest stable one."""

    vertices: int
    courant: float


_QUALITIES: dict[Quality, tuple[float, float]] = {"preview": (0.5, 0.8), "default": (1.0, 0.4), "fine": (2.0, 0.2)}
#: Measured on one busy core: seconds per vertex and explicit step, and per vertex and stage at rest.
_EXPLICIT, _STATIC = 8e-8, 8e-4
#: Bytes of all arrays per vertex, bonds included; explicit, and with an equilibrium's factor.
_BYTES, _FACTORS = 3000, 30_000
_FEWEST = 3


def choose(params: WoodParams, quality: Quality) -> Settings:
    """Return the settings of a quality; they follow from parameters and quality alone."""
    share, courant = _QUALITIES[quality]
    edges = max(round(share * (params.vertices - 1)), _FEWEST - 1)
    return Settings(edges + 1, courant)


def expected_cost(params: WoodParams, need: Need) -> Cost:
    """Return what a run is expected to take."""
    settings = choose(params, need.quality)
    count = params.rods * settings.vertices
    width = 8 if need.dtype == "float64" else 4
    fixed = 6 * width * count * len(need.stages) if "rod_position" in need.fields else 0
    if params.mode == "static":
        return Cost(1.0 + len(need.stages) * count * _STATIC, count * _FACTORS + fixed)
    # the stretch waves of the mean edge bound the step within a factor of two
    speed = (params.stiffness / params.density) ** 0.5
    step = settings.courant * 0.3 * params.length / settings.vertices / speed * params.mass_scaling**0.5
    return Cost(1.0 + need.stages[-1] / step * count * _EXPLICIT, count * _BYTES + fixed)
