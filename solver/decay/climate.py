"""How fast an organism grows in a climate: cardinal temperatures times water activity, after a lag.

Temperature by the cardinal model with inflection (Rosso, Lobry and Flandrois 1993, doi:10.1006/jtbi.1993.1099): 0 at
and beyond both ends, 1 at the best, and nothing else to fit. Water activity by the square of the distance from the
driest at which it grows (the gamma concept of Zwietering et al. 1992). The two multiply. What lives in the flesh feels
the flesh's activity, which falls as the fruit dries; what is in the air feels that of the surface, which lies between
flesh and air as their resistances to vapour do: on a sound skin nearly the air's, on a rotten one nearer the flesh's.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Floats
from .environment import ACTIVITY, air, opened
from .fields.colony import Colony
from .params import DecayParams

__all__ = ["Germination", "flesh_activity", "moisture", "surface_activity", "warmth"]

#: Conductance of still air about a fruit [g/(m2 s MPa)]: a transfer coefficient of 3 mm/s at 22 C. A choice.
_STILL_AIR = 22.0
#: Step and end of the table of thermal time in weather [day].
_STEP, _END = 0.01, 121.0


def warmth(colony: Colony, celsius: float | Floats) -> Any:
    """Return the rate of growth at temperatures [degC] over that at the best one."""
    t = np.asarray(celsius, float)
    low, best, high = colony.coldest, colony.best, colony.hottest
    inside = np.clip(t, low, high)
    above = (inside - high) * (inside - low) ** 2
    below = (best - low) * ((best - low) * (inside - best) - (best - high) * (best + low - 2 * inside))
    return np.clip(above / below, 0.0, 1.0)


def moisture(colony: Colony, activity: float | Floats) -> Any:
    """Return the rate of growth at water activities over that at the wettest."""
    share = (np.asarray(activity, float) - colony.driest) / (colony.wettest - colony.driest)
    return np.clip(share, 0.0, 1.0) ** 2


def flesh_activity(params: DecayParams, water: float) -> float:
    """Return the flesh's water activity after a share of the weight has gone as water: Raoult's law for its solutes."""
    fresh = params.water_content / 100
    left = max(fresh - water, 1e-3 * fresh)
    return float(1 / (1 + (1 / ACTIVITY - 1) * fresh / left))


def surface_activity(
    params: DecayParams, day: float, flesh: float | Floats, broken: Floats, damp: float = 0.0
) -> Floats:
    """Return the water activity at the surface (v) where a share of the skin is broken (v), 0 to 1.

    flesh: activity below, of all or place by place (v). damp: what other fruits add to the humidity [percent].
    """
    skin = params.transpiration + (opened(params) - params.transpiration) * broken
    humidity = (float(air(params, day)[1]) + damp) / 100
    return np.asarray((skin * flesh + _STILL_AIR * humidity) / (skin + _STILL_AIR))


class Germination:
    """When what lands on a day starts to grow: after so many days at the best temperature as its lag."""

    def __init__(self, colony: Colony, params: DecayParams) -> None:
        self._lag = colony.lag
        self._steady = 0.0 if params.weather else float(warmth(colony, params.temperature))
        self._days = self._thermal = np.empty(0)
        if params.weather:
            self._days = np.arange(0.0, _END, _STEP)
            rate = warmth(colony, air(params, self._days)[0])
            self._thermal = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * _STEP)])

    def day(self, landed: float) -> float:
        """Return the day on which growth begins; infinite if it never gets warm enough."""
        if self._lag == 0:
            return landed
        if not len(self._days):
            return landed + self._lag / self._steady if self._steady > 0 else np.inf
        wanted = float(np.interp(landed, self._days, self._thermal)) + self._lag
        if wanted >= self._thermal[-1]:
            return np.inf
        k = int(np.searchsorted(self._thermal, wanted))
        before, after = self._thermal[k - 1], self._thermal[k]
        return float(self._days[k - 1] + _STEP * (wanted - before) / (after - before))
