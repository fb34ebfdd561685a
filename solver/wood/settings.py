"""What a quality means: vertices and steps; and what a run is expected to cost."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..contract import Cost, Need, Quality
from .choosing import decide
from .params import WoodParams

__all__ = ["Settings", "choose", "expected_cost"]


@dataclass(frozen=True)
class Settings:
    """vertices: of a rod. courant: explicit step over the longest stable one."""

    vertices: int
    courant: float


_QUALITIES: dict[Quality, tuple[float, float]] = {"preview": (0.5, 0.8), "default": (1.0, 0.4), "fine": (2.0, 0.2)}
#: Of what breaks, at most: a break sets off the fastest modes, of whose motion velocity Verlet's energy misses
#: (omega dt)^2 / 4. On scaled masses up to 15 % of the energy went unbooked at 0.8, up to 1.5 % at 0.5.
_BREAKING = 0.5
#: Measured on one busy core: seconds per vertex and explicit step, and per vertex and stage at rest.
_EXPLICIT, _STATIC = 8e-8, 8e-4
#: Bytes of all arrays per vertex, bonds included; explicit, and with an equilibrium's factor.
_BYTES, _FACTORS = 3000, 30_000
_FEWEST = 3
#: What uneven rods that are bonded need, see `_least`: at this much they are half a percent too stiff.
_EVEN = 250.0


def _least(params: WoodParams) -> int:
    """Return the fewest edges of a rod with which a bundle bends as a beam does.

    Under a load at its end a beam's curvature falls evenly, by c / L. A curve through vertices then misses the place of
    a rod by some c h^3 / L, and bonds of length d = R / sqrt(rods) are stretched: their energy over the beam's goes
    with rods (L / R)^4 / edges^6. Measured at 15 vertices, L / R = 100: .8 % at 20 rods, 1.5 % at 50, 4 % at 200.
    """
    if params.rods == 1 or params.reach == 0 or params.unevenness == 0:
        return 0
    edges: float = (params.rods * (params.length / params.wide) ** 4 / _EVEN) ** (1 / 6)
    return math.ceil(edges)


def choose(params: WoodParams, quality: Quality) -> Settings:
    """Return the settings of a quality; they follow from parameters and quality alone."""
    share, courant = _QUALITIES[quality]
    if params.fracture != "none":
        courant = min(courant, _BREAKING)
    edges = max(round(share * (params.vertices - 1)), _FEWEST - 1, _least(params))
    return Settings(edges + 1, courant)


def expected_cost(params: WoodParams, need: Need) -> Cost:
    """Return what a run is expected to take."""
    if params.mode == "auto":
        choice = decide(params)
        params = params.model_copy(update={"mode": choice.mode, "mass_scaling": choice.scaling})
    settings = choose(params, need.quality)
    count = params.rods * settings.vertices
    width = 8 if need.dtype == "float64" else 4
    fixed = 6 * width * count * len(need.stages) if "rod_position" in need.fields else 0
    if params.mode == "static":
        return Cost(1.0 + len(need.stages) * count * _STATIC, count * _FACTORS + fixed)
    # the stretch waves of the mean edge bound the step within a factor of two
    speed = (params.stiffness / params.density) ** 0.5
    step = settings.courant * 0.3 * params.length / settings.vertices / speed * params.mass_scaling**0.5
    step = min(step, params.step or math.inf)
    return Cost(1.0 + need.stages[-1] / step * count * _EXPLICIT, count * _BYTES + fixed)
