"""A cushion that is blown up: a solver of one folder, which test_new_solver.py puts into a tree as if it were ours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import xarray as xr
from pydantic import Field

from ..contract import Context, Cost, Fresh, Need, Params, Solver, StageAxis, Surface
from ..quantities import Quantity, register

__all__ = ["SOLVER", "CushionParams"]

register(plumpness=Quantity("1", "height over width of the cushion", "h/w"))


class CushionParams(Params):
    """How flat a cushion lies, and how far it gives."""

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {"flatness": ("flatness", None), "give": ("give", None)}

    flatness: float = Field(
        0.5, ge=0.1, le=1, description="Height over width at rest", json_schema_extra={"units": "1"}
    )
    give: float = Field(0.5, ge=0, le=2, description="Growth of the height", json_schema_extra={"units": "1"})


class Rest(Fresh):
    """An ellipsoid of unit half-width."""

    def __init__(self, flatness: float) -> None:
        self.flatness = flatness

    def points(self, colatitude: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
        """Return points (..., 3) of its surface."""
        around = np.sin(colatitude)
        height = self.flatness * np.cos(colatitude)
        return np.stack(np.broadcast_arrays(around * np.cos(azimuth), height, around * np.sin(azimuth)), axis=-1)


def _run(params: CushionParams, need: Need, context: Context) -> xr.Dataset:
    from .run import run

    return run(params, need, context)


def _cost(params: CushionParams, need: Need) -> Cost:
    return Cost(0.01, 10_000)


def _rest(values: Mapping[str, Any]) -> Rest:
    return Rest(values["flatness"])


SOLVER = Solver(
    name="cushion",
    version="1",
    title="A cushion that is blown up",
    params=CushionParams,
    fields=("displacement", "plumpness"),
    default_fields=("displacement", "plumpness"),
    stages=StageAxis("p", "pressure", "1", 0.0, 1.0, (0.5, 1.0)),
    default_resolution={"preview": 12, "default": 16, "fine": 24},
    tolerances={"preview": 0.1, "default": 0.01},
    presets={"flat": {"flatness": 0.3}},
    run=_run,
    cost=_cost,
    surface=Surface(("flatness",), _rest),
)
