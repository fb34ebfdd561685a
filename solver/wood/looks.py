"""Bark, fresh wood where it broke, and the steel of what pressed."""

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
_STEEL = np.array([0.25, 0.28, 0.32])
_DRY, _POLISHED = 0.85, 0.4


def _paint(fields: Mapping[str, Array], params: Mapping[str, Any]) -> Skin | None:
    if "inside" not in fields:
        return None
    share = np.asarray(fields["inside"], float)
    bark = np.broadcast_to(_BARK, (*share.shape, 3))
    colour = bark + (_WOOD - bark) * share[..., None]
    steel = np.asarray(fields.get("body", np.zeros(share.shape)), float)
    return Skin(colour + (_STEEL - colour) * steel[..., None], _DRY + (_POLISHED - _DRY) * steel)


LOOKS = Looks(layers=("inside", "body"), paint=_paint, aside="body", advance="Break")
