"""What is shown of a state beside its shape: values of its vertices by name."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from .. import shell
from ..arrays import Floats
from .looks import CHANNELS
from .matter import coloured
from .params import GrowthParams
from .state import State

__all__ = ["shown"]


def shown(state: State, params: GrowthParams, fields: Collection[str]) -> dict[str, Floats]:
    """Return the wanted ones of `elastic_strain`, `sheet_thickness`, red, green and blue, each (n,)."""
    found = {"elastic_strain": _strain(state)} if "elastic_strain" in fields else {}
    if "sheet_thickness" in fields:
        found["sheet_thickness"] = params.thickness * state.matter.get("thick", np.ones(len(state.x)))
    if set(CHANNELS) & set(fields):
        values = dict(zip(CHANNELS, coloured(state, params.colours).T, strict=True))
        found |= {name: values[name] for name in CHANNELS if name in fields}
    return found


def _strain(state: State) -> Floats:
    """Return the mean elastic stretch less 1 of each vertex's triangles (n,)."""
    t = state.mesh.triangles
    ratio = np.sqrt(shell.areas(shell.metric(state.x, t)) / shell.areas(state.g)) - 1
    count = np.bincount(t.ravel(), minlength=len(state.x))
    return np.bincount(t.ravel(), np.repeat(ratio, 3), len(state.x)) / np.maximum(count, 1)
