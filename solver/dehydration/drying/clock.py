"""Hours to shrinkage: moisture ratio by the fruit's kinetics, volume by the water that left, s by its cube root."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from ...contract import Clock, InvalidInput
from ...rounding import towards_zero
from . import moisture
from .conditions import Drying

__all__ = ["CLOCK", "LATEST", "shrinkage"]

#: Shrinkage up to which there are stages.
LATEST = 0.6

#: Densities at 25 C [kg/m3] of water and of carbohydrate, which most of the dry matter is (Choi and Okos 1986).
_WATER, _SOLIDS = 997.0, 1591.3


class _Measured(NamedTuple):
    """A law of moisture, the share of water in the fresh flesh (None: to be said), and conditions that do not enter."""

    left: Callable[[float, Drying], float]
    water: float | None
    without: tuple[str, ...]


_OWN, _AIR = ("rate", "exponent"), ("temperature", "humidity", "air_speed", "diameter")

_KINETICS: Mapping[str, _Measured] = {
    "grape": _Measured(moisture.grape, 0.782, _OWN),  # Doymaz 2012
    "jujube": _Measured(moisture.jujube, 0.7786, _OWN),  # USDA FoodData Central, jujube, raw
    "page": _Measured(moisture.page, None, _AIR),
}

#: Presets whose fruit was measured.
_FRUITS = {"raisin": "grape", "raisin2": "grape", "jujube1": "jujube", "jujube2": "jujube"}


def shrinkage(left: float, water: float) -> float:
    """Return s = 1 - (V / V0)^(1/3) of flesh that keeps `left` of its water, `water` of its fresh mass.

    The flesh loses the volume of the water that leaves and holds no air, so V is linear in the moisture, as Touil et
    al. (J. Food Processing 2014, 175402) measured on prickly pears.
    """
    share = water / _WATER / (water / _WATER + (1 - water) / _SOLIDS)
    return float(1 - (1 - share * (1 - left)) ** (1 / 3))


def _stage(hours: float, under: Drying, preset: str | None) -> float:
    name = under.kinetics or _FRUITS.get(preset or "")
    if name is None:
        raise InvalidInput(
            f"nobody measured how {preset or 'this fruit'} dries over hours.",
            advice="Say under which conditions: kinetics=grape, jujube, or page with rate, exponent and moisture of "
            f"your own; presets with kinetics of their own: {', '.join(_FRUITS)}.",
        )
    law = _KINETICS[name]
    _heeds(name, law, under)
    water = law.water if under.moisture is None else under.moisture
    if water is None:
        raise InvalidInput(
            f"kinetics={name} wants the moisture of the fresh flesh.", advice="For example moisture=0.8 (of its mass)."
        )
    stage = _after(law, hours, under, water)
    if stage > LATEST:
        raise InvalidInput(
            f"after {hours:g} h the flesh would have shrunk by s = {stage:.4g}, and stages end at {LATEST:g}.",
            advice=f"Ask for at most {towards_zero(_longest(law, hours, under, water), 4)} hours.",
        )
    return stage


def _heeds(name: str, law: _Measured, under: Drying) -> None:
    """Refuse conditions that would change nothing."""
    idle = [each for each in law.without if each in under.model_fields_set and getattr(under, each) is not None]
    if idle:
        instead = ", or set kinetics=page with rate, exponent and moisture of your own"
        if law.water is None:
            instead = ": what your own measurements had is in their rate and exponent"
        raise InvalidInput(
            f"{', '.join(idle)} would change nothing: the law of kinetics={name} does not hold it.",
            advice=f"Leave {' and '.join(idle)} out{instead}.",
        )


def _after(law: _Measured, hours: float, under: Drying, water: float) -> float:
    return round(shrinkage(law.left(hours, under), water), 6)


def _longest(law: _Measured, hours: float, under: Drying, water: float) -> float:
    """Return until when there are stages, of a fruit that is past the last one after `hours`."""
    early, late = 0.0, hours
    for _ in range(100):
        middle = (early + late) / 2
        early, late = (early, middle) if _after(law, middle, under, water) > LATEST else (middle, late)
    return early


CLOCK = Clock(conditions=Drying, stage=_stage)
