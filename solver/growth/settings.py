"""What a quality means, and what a run is expected to cost."""

from __future__ import annotations

from dataclasses import dataclass

from ..contract import Cost, Need, Quality
from .params import GrowthParams

__all__ = ["Settings", "choose", "expected_cost"]


@dataclass(frozen=True)
class Settings:
    """vertices: of the start shape. tolerance: residual, largest out-of-balance force over mu l."""

    vertices: int
    tolerance: float


_SETTINGS: dict[Quality, Settings] = {
    "preview": Settings(600, 1e-3),
    "default": Settings(2500, 1e-3),
    "fine": Settings(10_000, 5e-4),
}
#: Measured on one busy core: seconds per step and vertex at equilibrium; bytes per vertex of factor and rest state.
_SECONDS, _BYTES = 1e-4, 20_000


def choose(quality: Quality) -> Settings:
    """Return the settings of a quality."""
    return _SETTINGS[quality]


def expected_cost(params: GrowthParams, need: Need) -> Cost:
    """Return what a run is expected to take, without the vertices that remeshing adds."""
    vertices = len(params.mesh.points) if params.mesh else choose(need.quality).vertices
    steps = need.stages[-1] / params.step + len(need.stages)
    width = 8 if need.dtype == "float64" else 4
    return Cost(steps * vertices * _SECONDS, vertices * (_BYTES + len(need.stages) * (3 * width + 24)))
