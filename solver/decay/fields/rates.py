"""The constants of Eq. 2-9 in days and in r1, with the scale s, the clock and the climate's warmth in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..climate import warmth
from ..environment import air, damping
from ..params import DecayParams
from .colony import Colony
from .front import front

__all__ = ["Rates", "daily", "units"]

#: The paper's unit of length is the width of its map: the girth of the fruit, 2 pi r1.
_GIRTH = 2 * np.pi
#: Temperature and humidity in s where the climate has its own say: the paper's room, 72 F and 50 %.
_ROOM = 72.0 + 50.0
#: s of the fruit whose fronts run at the published speed: the paper's apple in that room.
_APPLE = 25.0 + 84.0 + _ROOM


class Rates(NamedTuple):
    """mobility [r1^2/day]: D = mobility u (1 - u/cap) n. consume, wither: [1/day]. feed: D_n [r1^2/day]."""

    mobility: float
    cap: float
    consume: float
    half: float
    wither: float
    a1: float
    a2: float
    theta: float
    feed: float

    def slowed(self, share: float) -> Rates:
        """Return the rates at a share of their pace."""
        mobility, consume, wither, feed = (share * x for x in (self.mobility, self.consume, self.wither, self.feed))
        return self._replace(mobility=mobility, consume=consume, wither=wither, feed=feed)

    @property
    def fastest(self) -> float:
        """Largest diffusivity of the organism at n = 1 [r1^2/day]."""
        return self.mobility * self.cap / 4


def daily(colony: Colony, params: DecayParams, radius: float, day: float = 0.0) -> Rates:
    """Return a colony's constants per day on a fruit of radius r1 [mm], in the air of a day.

    In the cardinal climate without what its water activity takes: that differs from place to place.
    """
    clock = units(colony, params, radius)
    celsius, humidity = air(params, day)
    # s adds per cents and degrees Fahrenheit: only the raw sum of the paper gives fronts that move
    s = params.porosity + params.water_content
    if params.climate == "paper":
        s += max(_fahrenheit(celsius), 0.0) + humidity
        s *= damping(celsius, humidity)
    else:
        s += _ROOM
        clock *= float(warmth(colony, celsius))
    motility = s * colony.sigma1 * colony.d1
    return Rates(
        mobility=clock * motility * _GIRTH**2,
        cap=colony.d2,
        consume=clock * colony.sigma2 * colony.f1,
        half=colony.f2,
        wither=clock * colony.sigma3,
        a1=colony.a1,
        a2=colony.a2,
        theta=colony.theta,
        feed=clock * colony.nutrient_diffusion * _GIRTH**2,
    )


def units(colony: Colony, params: DecayParams, radius: float) -> float:
    """Return how many units of the model's time pass in a day on a fruit of radius r1 [mm], at the best temperature.

    In the cardinal climate as many as make the front as quick as `speed` on a skin and flesh like the paper's apple's.
    """
    pace = colony.pace
    motility = _APPLE * colony.sigma1 * colony.d1
    if params.climate == "cardinal" and motility > 0 and (scaled := front(colony)) > 0:
        pace = colony.speed / (radius * _GIRTH * scaled * float(np.sqrt(motility * colony.d2)))
    return pace * params.growth_rate / 50


def _fahrenheit(celsius: float) -> float:
    return 32 + 1.8 * celsius
