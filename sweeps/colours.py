"""What a surface looks like besides its shape: fresh skin, rot and mould as layers of colour (Kider et al., 3.5)."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

__all__ = ["of_run"]

Array = NDArray[Any]

#: Rotten flesh under the skin, and the rim of mould that still grows; linear light.
_ROT = np.array([0.16, 0.075, 0.03])
_RIM = np.array([0.86, 0.86, 0.82])


def of_run(run: xr.Dataset, index: int) -> Array | None:
    """Return the colours (n, 2n, 3), linear light, of one stage of a run with maps of rot or mould; else None."""
    if not {"rot", "mould"} & set(run.data_vars):
        return None
    params = json.loads(run.attrs["params"])
    n, m = run.sizes["colatitude"], run.sizes["azimuth"]

    def layer(name: str) -> Array:
        return np.asarray(run[name][index], float) if name in run else np.zeros((n, m))

    colour = np.broadcast_to(np.array(params["skin_colour"], float), (n, m, 3))
    rot, mould, active = layer("rot"), layer("mould"), layer("mould_active")
    # rot shows long before it is complete, mould hides what is below it
    colour = _over(colour, _ROT, 0.9 * _smooth(rot / 0.2))
    # what grows is white while it is thin, and takes its colour with the spores of a dense or a resting mat
    growing = np.clip(active / np.maximum(mould, 1e-9), 0, 1) * (1 - _smooth((mould - 0.2) / 0.3))
    growing = growing[..., None]
    centre = np.array(params["mould_colour"], float)
    return _over(colour, centre + (_RIM - centre) * growing, 0.95 * _smooth(mould / 0.25))


def _over(below: Array, above: Array, cover: Array) -> Array:
    return below + (above - below) * cover[..., None]


def _smooth(x: Array) -> Array:
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)
