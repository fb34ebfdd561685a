"""Cooking and roasting: heat comes in from the oven's air, water leaves, the skin browns (D59).

    rho c dT/dt = div(k grad T)      k dT/dn = film (T_oven - T) - L m       m = K (a_w(w) P_sat(T) - P_air)
    db/dt = k0 exp(-E / R T) (1 - b)

Flesh and skin are one medium. Where it is wet it gets no hotter than boiling water: more heat makes steam, which leaves
at once, so that a dry crust grows inwards. K is that of broken skin, which a cooked one is, in series with the air's
film, which by Lewis' analogy goes with that for heat. Browning is that of a bread's crust in the oven (Zanoni, Peri and
Bruno 1995, Lebensm.-Wiss. Technol. 28, 604, abstract: first order, k0 = 42,000 1/s, E = 64,151 J/mol), b the share of
the colour of what is burnt.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats
from ..environment import opened, reference_radius, saturation
from ..fields.diffusion import linked
from ..params import DecayParams
from ..surfaces.surface import Extent
from .given import Within
from .joint import Joint
from .oven import Oven
from .spread import spread
from .water import activity, diffusivity, rising

__all__ = ["STEP", "Roast", "Roasted"]

#: Step [s].
STEP = 10.0
#: Latent heat of water [J/g], density of the fruit [g/m^3], heat of air [J/(m^3 K)], gas constant of vapour [J/(g K)].
_BOILS = 100.0
_LATENT, _DENSITY, _AIR, _VAPOUR = 2257.0, 1e6, 1.2 * 1005.0, 0.46153
_RATE, _ENERGY, _GAS, _ZERO = 42_000.0, 64_151.0, 8.314462618, 273.15
#: Hottest that the formula of the vapour pressure is asked for, and the difference that its slope is taken over [K].
_HOTTEST, _APART = 200.0, 0.01


class Roasted(NamedTuple):
    """Temperature (n) [degC], water over the fresh one (n), browning of the skin (v), and the heat that came in [J]."""

    warm: Floats
    wet: Floats
    brown: Floats
    heat: float


class Roast:
    """One fruit in an oven; extent: of its surface."""

    def __init__(self, params: DecayParams, within: Within, oven: Oven, joint: Joint, extent: Extent) -> None:
        self._params, self._within, self._oven, self.joint = params, within, oven, joint
        self._radius = reference_radius(params, extent)
        one = np.ones(len(joint.area))
        self._links = linked(one, np.empty(0), np.arange(len(one)), joint.start, joint.near, joint.weight, joint.area)
        skin = joint.skin
        self.area = skin.area * self._radius**2
        self._volume = joint.area * self._radius**3
        self.store = oven.conductivity / oven.diffusivity * self._volume
        self.held = _DENSITY * params.water_content / 100 * self._volume
        self._air = float(saturation(params.temperature)) * params.humidity / 100
        film = oven.film / _AIR / (_VAPOUR * (params.temperature + _ZERO)) * 1e6
        through = opened(params)
        self._conductance = 1e-6 * through * film / (through + film)
        count = len(skin.points)
        self.fresh = Roasted(params.temperature * one, one, np.zeros(count), 0.0)

    def lost(self, wet: Floats) -> float:
        """Return the water that is gone, over the fresh weight."""
        return self._params.water_content / 100 * (1 - self.joint.mean(wet))

    def evaporates(self, warm: Floats, wet: Floats) -> Floats:
        """Return what places of the skin (v) give off [g/(m2 s)]."""
        pressure = activity(wet) * saturation(np.minimum(warm, _HOTTEST))
        return np.asarray(self._conductance * np.maximum(pressure - self._air, 0.0))

    def advance(self, state: Roasted, seconds: float) -> Roasted:
        """Return the state so many seconds later, in one step."""
        count, oven = len(self.area), self._oven
        here, damp = state.warm[:count], state.wet[:count].copy()
        gives = self.evaporates(here, damp)
        steeper = (self.evaporates(here + _APART, damp) - gives) / _APART
        per = self.area / self.store[:count]
        gain, loss = np.zeros(len(state.warm)), np.zeros(len(state.warm))
        gain[:count] = per * (oven.film * oven.celsius - _LATENT * (gives - steeper * here))
        loss[:count] = per * (oven.film + _LATENT * steeper)
        rate, stiffest = oven.diffusivity / self._radius**2, self.joint.stiffest
        warm = spread(state.warm, self._links, rate, gain, loss, stiffest, seconds)
        # water with the temperatures of the step's middle
        there = (here + warm[:count]) / 2
        gives = self.evaporates(there, damp)
        dry = np.maximum(self._air / saturation(np.minimum(there, _HOTTEST)), 1e-6)
        out = (gives > 0) * gives / np.maximum(activity(damp) - dry, 1e-9) * self.area / self.held[:count]
        bend = rising(damp)
        gain[:count], loss[:count] = out * (dry - activity(damp) + bend * damp), out * bend
        middle = float(self.joint.mean(state.warm + warm)) / 2
        rate = diffusivity(self._within, middle) / self._radius**2
        wet = np.maximum(spread(state.wet, self._links, rate, gain, loss, stiffest, seconds), 0.0)
        # no wet place is hotter than boiling water
        steam = np.minimum(self.store * np.maximum(warm - _BOILS, 0.0) / _LATENT, self.held * wet)
        warm, wet = warm - steam * _LATENT / self.store, np.maximum(wet - steam / self.held, 0.0)
        heat = float(np.sum(self.store * (warm - state.warm) + _LATENT * self.held * (state.wet - wet)))
        there = (here + warm[:count]) / 2
        quick = _RATE * np.exp(-_ENERGY / _GAS / (there + _ZERO))
        return Roasted(warm, wet, 1 - (1 - state.brown) * np.exp(-quick * seconds), state.heat + heat)
