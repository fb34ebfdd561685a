"""The colours that ride on a growing surface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..contract import Looks, Skin

__all__ = ["CHANNELS", "LOOKS"]

CHANNELS = ("red", "green", "blue")
#: Leaves, skins and petals: chosen by eye.
_ROUGHNESS = 0.55


def _paint(fields: Mapping[str, Array], _params: Mapping[str, Any]) -> Skin | None:
    if any(name not in fields for name in CHANNELS):
        return None
    colour = np.clip(np.stack([np.asarray(fields[name], float) for name in CHANNELS], -1), 0, 1)
    return Skin(colour, np.full(colour.shape[:-1], _ROUGHNESS))


LOOKS = Looks(layers=CHANNELS, paint=_paint, advance="Grow")
