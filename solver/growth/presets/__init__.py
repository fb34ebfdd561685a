"""Shapes of the paper's gallery (Fig. 2), and further plants, as parameters; every preset runs to growth time 1."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from . import cloths, leaves, spots

__all__ = ["PRESETS"]

PRESETS: Mapping[str, Mapping[str, Any]] = {**spots.PRESETS, **leaves.PRESETS, **cloths.PRESETS}
