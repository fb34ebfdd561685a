"""What a surface looks like besides its shape: fields as colours, by the looks of the solver that made them.

The one place where fields become colours: pictures, vertex colours and textures all ask here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from solver import registry
from solver.arrays import Array, Bytes
from solver.contract import Fur, Looks, Shade, Skin, Worn, dryness

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["by_field", "encoded", "furred", "looks", "maps_of", "of_run", "painted", "shade", "worn"]


def looks(run: xr.Dataset) -> Looks:
    """Return the looks of the solver that made a result; plain ones where it is no longer here."""
    name = str(run.attrs.get("solver", ""))
    return registry.get(name).looks if name in registry.names() else Looks()


def painted(run: xr.Dataset, index: int, fields: Mapping[str, Array]) -> Skin | None:
    """Return the look of a stage's surface with these fields (...); None where they give it none."""
    known = looks(run)
    stage = {name: run[name].values[index] for name in known.scalars if name in run}
    return None if known.paint is None else known.paint({**stage, **fields}, _params(run))


def worn(run: xr.Dataset, stage: float) -> Worn | None:
    """Return the skin, at a stage, of a result whose fields say no colours: of the preset that has its fresh shape;
    None where nobody knows one.
    """
    name = str(run.attrs.get("solver", ""))
    known = shade(name, str(run.attrs.get("params", "{}"))) if name in registry.names() else None
    if known is None:
        return None
    return known.worn(dryness(stage, registry.get(name).stages.reach))


def shade(solver: str, params: str) -> Shade | None:
    """Return the skin of what has these parameters, JSON; None where nobody knows one."""
    # solvers without skins take meshes, whose parameters are megabytes that nobody shall keep
    return _shade(solver, params) if registry.get(solver).looks.shades else None


@lru_cache(maxsize=64)
def _shade(solver: str, params: str) -> Shade | None:
    return registry.get(solver).shade(json.loads(params))


def furred(run: xr.Dataset, fields: Mapping[str, Array]) -> Fur | None:
    """Return the threads on a surface of `run` with these fields (...); None where nothing grows."""
    fur = looks(run).fur
    return None if fur is None else fur(fields, _params(run))


def of_run(run: xr.Dataset, index: int) -> Skin | None:
    """Return colours (n, 2n, 3) and roughness (n, 2n) of one stage of a run with maps that give it some; else None."""
    return painted(run, index, maps_of(run, index))


def maps_of(run: xr.Dataset, index: int) -> dict[str, Array]:
    """Return the fields (n, 2n) of one stage that colours are made of."""
    layers = looks(run).layers
    return {name: run[name][index].values for name in layers if name in run and "colatitude" in run[name].dims}


def _params(run: xr.Dataset) -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads(run.attrs.get("params", "{}"))
    return found


def by_field(values: Array, low: float, high: float) -> Array:
    """Return colours (..., 3), linear light, of a field (...): viridis from `low` to `high`."""
    from matplotlib import colormaps

    share = np.clip((np.asarray(values, float) - low) / max(high - low, 1e-300), 0, 1)
    display = np.asarray(colormaps["viridis"](share))[..., :3]
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)


def encoded(linear: Array) -> Bytes:
    """Return linear light, 0 to 1, as the bytes of an sRGB picture (IEC 61966-2-1)."""
    x = np.clip(linear, 0, 1)
    display = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return (255 * display + 0.5).astype(np.uint8)
