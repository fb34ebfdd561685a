"""Which figures and tables of Liu et al. 2014 show a fruit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from solver.dehydration import DehydrationParams
from solver.fruit import PRESETS

from .pattern import name_of

__all__ = ["FIGURES", "FRUITS", "SKINS", "shown"]

SKINS = (0.01, 0.02, 0.03, 0.04)
GAMMAS, RADII, LENGTHS, WAISTS = (10, 30, 50), (0.3, 0.4, 0.5, 0.6), (0.4, 0.5, 0.6, 0.7), (0.6, 0.7, 0.8, 0.9)


#: The fruits of Table 1.
FRUITS = ("raisin", "wolfberry", "jujube1", "jujube2", "plum1", "plum2")


def sphere(te: float, gamma: float) -> dict[str, float]:
    return {"te": te, "gamma": gamma, "rs1": 0.4, "rs2": 0.4}


def stone(te: float, radius: float) -> dict[str, float]:
    return {"te": te, "gamma": 10, "rs1": radius, "rs2": radius}


def long_stone(te: float, length: float) -> dict[str, float]:
    return {"te": te, "gamma": 10, "rs1": length, "rs2": 0.4}


def prolate(te: float, r4: float) -> dict[str, float]:
    """An ellipse with half-axes 1 (along the poles) and r4, at every 30 degrees."""
    r2, r3 = (round(1 / math.hypot(math.cos(a), math.sin(a) / r4), 4) for a in (math.pi / 6, math.pi / 3))
    radii = {"r2": r2, "r3": r3, "r4": r4, "r5": r3, "r6": r2, "r8": r4}
    return {"te": te, "gamma": 10, "rs1": 0.3, "rs2": 0.3, **radii}


#: Figure -> the name and values of its other axis, and the fruit at a skin and a value of it.
FIGURES: dict[str, tuple[str, tuple[float, ...], Callable[[float, float], dict[str, float]]]] = {
    "fig7": ("stiffness of the skin, gamma", tuple(map(float, GAMMAS)), sphere),
    "fig8": ("radius of the stone [r1]", RADII, stone),
    "fig9": ("length of the stone [r1]", LENGTHS, long_stone),
    "fig10": ("radius at the equator [r1]", WAISTS, prolate),
}


def shown(params: DehydrationParams) -> Iterator[str]:
    """Yield the figures that show a fruit, by the names of their plans."""
    te, gamma, (long, round_) = params.exocarp_thickness, params.modulus_ratio, params.stone
    if name_of(params) in FRUITS:
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
