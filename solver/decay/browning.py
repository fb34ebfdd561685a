"""How brown cut flesh is after a time: its polyphenols oxidise where air comes to them.

    b = 1 - exp(-(k t)^n)

Weibull's law of the lightness of apple slices (Quevedo et al. 2014, Food Bioprocess Technol. 7, 1526, abstract:
k = 0.0117 a minute and n = 0.451 at 5 degC); that b is the share of what it comes to in the end is our reading. The
activation energy is a choice.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .environment import air
from .params import DecayParams

__all__ = ["browned"]

_RATE, _ORDER, _GIVEN = 0.0117 * 1440, 0.451, 278.15
_ENERGY, _GAS, _ZERO = 35.0, 8.314462618e-3, 273.15
_SAMPLES = 33


def browned(params: DecayParams, day: float) -> float:
    """Return how brown bare flesh is on a day after the cut, 0 to 1, in the air of the parameters."""
    knots = np.unique(np.clip([0.0, *(w.day for w in params.weather), day], 0.0, day))
    age = 0.0
    for first, last in pairwise(knots):
        kelvin = air(params, np.linspace(first, last, _SAMPLES))[0] + _ZERO
        faster = np.exp(_ENERGY / _GAS * (1 / _GIVEN - 1 / kelvin))
        age += float(np.trapezoid(faster, dx=(last - first) / (_SAMPLES - 1)))
    return float(1 - np.exp(-((_RATE * age) ** _ORDER)))
