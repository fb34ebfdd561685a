"""What a surface looks like besides its shape: fields as colours, by the looks of the solver that made them.

The one place where fields become colours: pictures, vertex colours and textures all ask here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from solver import registry
from solver.arrays import Array, Bytes
from solver.contract import Looks, Skin

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["by_field", "encoded", "looks", "of_run", "painted"]


def looks(run: xr.Dataset) -> Looks:
    """Return the looks of the solver that made a result; plain ones where it is no longer here."""
    name = str(run.attrs.get("solver", ""))
    return registry.get(name).looks if name in registry.names() else Looks()


def painted(run: xr.Dataset, fields: Mapping[str, Array]) -> Skin | None:
    """Return the look of a surface of `run` with these fields (...); None where they give it none."""
    paint = looks(run).paint
    return None if paint is None else paint(fields, json.loads(run.attrs.get("params", "{}")))


def of_run(run: xr.Dataset, index: int) -> Array | None:
    """Return the colours (n, 2n, 3), linear light, of one stage of a run with maps that give it some; else None."""
    layers = looks(run).layers
    maps = {name: run[name][index].values for name in layers if name in run and "colatitude" in run[name].dims}
    skin = painted(run, maps)
    return None if skin is None else skin.colour


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
