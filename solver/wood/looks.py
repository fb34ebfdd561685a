"""Bark, and fresh wood where it broke."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..contract import Looks, Skin

__all__ = ["LOOKS"]

#: Bark and fresh wood, linear light; roughness chosen by eye.
_BARK = np.array([0.105, 0.062, 0.036])
_WOOD = np.array([0.63, 0.43, 0.235])
_DRY = 0.85


def _paint(fields: Mapping[str, Array], params: Mapping[str, Any]) -> Skin | None:
    if "inside" not in fields:
        return None
    share = np.asarray(fields["inside"], float)
    bark = np.broadcast_to(_BARK, (*share.shape, 3))
    return Skin(bark + (_WOOD - bark) * share[..., None], np.full(share.shape, _DRY))


LOOKS = Looks(layers=("inside",), paint=_paint)
