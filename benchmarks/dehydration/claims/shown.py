"""Which figures and tables of Liu et al. 2014 show a fruit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from solver.dehydration import DehydrationParams
from solver.fruit import PRESETS

from .pattern import name_of

__all__ = ["shown"]

SKINS = (0.01, 0.02, 0.03, 0.04)
GAMMAS, RADII, LENGTHS, WAISTS = (10, 30, 50), (0.3, 0.4, 0.5, 0.6), (0.4, 0.5, 0.6, 0.7), (0.6, 0.7, 0.8, 0.9)


def shown(params: DehydrationParams) -> Iterator[str]:
    """Yield the figures that show a fruit, by the names of their plans."""
    te, gamma, (long, round_) = params.exocarp_thickness, params.modulus_ratio, params.stone
    if name_of(params) in PRESETS and set(params.radii) != {1.0}:
        if (te, gamma) == (PRESETS[name_of(params)]["exocarp_thickness"], 10):
            yield "table1"
        return
    if not any(math.isclose(te, skin) for skin in SKINS):
        return
    if set(params.radii) != {1.0}:
        if any(math.isclose(params.radii[3], waist) for waist in WAISTS) and gamma == 10:
            yield "fig10"
        return
    if (long, round_) == (0.4, 0.4) and gamma in GAMMAS:
        yield "fig7"
    if gamma == 10 and long == round_ and long in RADII:
        yield "fig8"
    if gamma == 10 and round_ == 0.4 and long in LENGTHS:
        yield "fig9"
