"""The air: vapour pressures and transpiration (Eq. 10-11), and how the climate damps what grows (Eq. 6).

Eq. 11 is Goff and Gratch's formula with its printed slips put right: 5.02808 and 3.49149, logarithms to base 10. The
two T_s of the paper are two things: the steam point in Eq. 11, the surface's temperature in Eq. 10.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Floats
from .params import DecayParams
from .surfaces.surface import Extent

__all__ = ["air", "damping", "deficit", "reference_radius", "saturation", "water_lost"]


_STEAM_POINT = 373.16
#: The ice point of the formula's own temperature scale, on which 100 degC is 373.16 K; 273.15 is off by 0.07 %.
_ICE_POINT = 273.16
_STEAM_PRESSURE = 101324.6
#: Water activity at the evaporating surface: dissolved matter lowers the vapour pressure (the paper: 0.98 or 0.99).
_ACTIVITY = 0.98
_SECONDS = 86400.0
_DENSITY = 1e6


def saturation(celsius: float | Floats) -> Any:
    """Return the saturation vapour pressure over water [Pa], Goff and Gratch 1946, at temperatures [degC]."""
    ratio = _STEAM_POINT / (np.asarray(celsius, dtype=float) + _ICE_POINT)
    exponent = (
        -7.90298 * (ratio - 1)
        + 5.02808 * np.log10(ratio)
        - 1.3816e-7 * (10 ** (11.344 * (1 - 1 / ratio)) - 1)
        + 8.1328e-3 * (10 ** (-3.49149 * (ratio - 1)) - 1)
    )
    return _STEAM_PRESSURE * 10**exponent


def air(params: DecayParams, day: float | Floats) -> tuple[Any, Any]:
    """Return temperature [degC] and relative humidity [percent] at times [day]."""
    if not params.weather:
        return params.temperature + 0 * day, params.humidity + 0 * day
    days = [w.day for w in params.weather]
    temperature = np.interp(day, days, [w.temperature for w in params.weather])
    return temperature, np.interp(day, days, [w.humidity for w in params.weather])


def deficit(params: DecayParams, day: float | Floats = 0.0) -> Any:
    """Return P_s - P_a [Pa] at times [day], at least 0: fruit and air share one temperature, and no dew falls."""
    celsius, humidity = air(params, day)
    return np.maximum(saturation(celsius) * (_ACTIVITY - humidity / 100), 0.0)


def water_lost(params: DecayParams, extent: Extent, days: float) -> float:
    """Return the water lost after some days, over the fresh weight: Eq. 10 until no water is left.

    The fruit's size follows from its weight, its shape and a density of 1 g/cm^3.
    """
    r1 = reference_radius(params, extent)
    grams = params.transpiration * extent.area * r1**2 * _dryness(params, days) * 1e-6 * _SECONDS
    return float(min(grams / params.weight, params.water_content / 100))


def reference_radius(params: DecayParams, extent: Extent) -> float:
    """Return r1 [m] of a fruit of this shape and weight, at a density of 1 g/cm^3."""
    return float((params.weight / (_DENSITY * extent.volume)) ** (1 / 3))


def _dryness(params: DecayParams, days: float) -> float:
    """Return the integral of the deficit over time [Pa day]: Simpson's rule between the given days."""
    knots = np.unique(np.clip([0.0, *(w.day for w in params.weather), days], 0.0, days))
    total = 0.0
    for first, last in pairwise(knots):
        samples = deficit(params, np.linspace(first, last, 17))
        total += float(
            (last - first) / 48 * (samples[0] + samples[-1] + 4 * samples[1::2].sum() + 2 * samples[2:-1:2].sum())
        )
    return total


def damping(celsius: float, humidity: float) -> float:
    """Return D_damp of Eq. 6, between 0 (dry frost) and 1 (the paper's room, 72 F and 50 %, and anything above).

    The paper leaves its `norm` open: the sum of degrees Fahrenheit and per cent between those two climates.
    """
    return float(np.clip((1.8 * celsius + humidity) / (72 - 32 + 50), 0, 1))
