"""The constants of Eq. 2-9 in days and in r1, with the scale s, the clock and the climate in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..environment import air, damping
from ..params import DecayParams
from .colony import Colony

__all__ = ["Rates", "daily"]

#: The paper's unit of length is the width of its map: the girth of the fruit, 2 pi r1.
_GIRTH = 2 * np.pi


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

    @property
    def fastest(self) -> float:
        """Largest diffusivity of the organism at n = 1 [r1^2/day]."""
        return self.mobility * self.cap / 4


def daily(colony: Colony, params: DecayParams, day: float = 0.0) -> Rates:
    """Return a colony's constants per day on this fruit, in the air of a day."""
    clock = colony.pace * params.growth_rate / 50
    celsius, humidity = air(params, day)
    # s adds per cents and degrees Fahrenheit: only the raw sum of the paper gives fronts that move
    s = params.porosity + max(_fahrenheit(celsius), 0.0) + humidity + params.water_content
    motility = s * damping(celsius, humidity) * colony.sigma1 * colony.d1
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


def _fahrenheit(celsius: float) -> float:
    return 32 + 1.8 * celsius
