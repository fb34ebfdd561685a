"""Water in the flesh: it diffuses, and leaves where the skin lets it (Eq. 10, place by place).

    dw/dt = div(D grad w),   lost at the skin: K (a_w(w) - humidity) P_sat,   K that of sound or of broken skin

w is the water of a place over what it had when fresh. The activity follows Raoult's law, so that flesh which is dry
gives less; the diffusivity follows Arrhenius. What is lost is what the sum of w has less, to round-off.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ..environment import ACTIVITY, air, evaporated, opened, reference_radius
from ..fields.diffusion import linked
from ..params import DecayParams
from ..surfaces.surface import Extent
from .given import Within
from .joint import Joint
from .spread import spread

__all__ = ["Water", "activity", "diffusivity", "rising"]

_NO_ROT: Floats = np.empty(0)
_GAS = 8.314462618e-3
#: Temperature at which the diffusivity is given [K], and that of 0 degC.
_GIVEN, _ZERO = 293.15, 273.15
_DAY = 86400.0
#: Largest share of what the skin holds that it would lose in one step if nothing came from below, and the most steps.
_LARGEST, _MOST = 0.25, 200


def activity(wet: Floats) -> Floats:
    """Return the water activity of flesh with a share of its fresh water (n): Raoult's law for what is dissolved."""
    return np.asarray(1 / (1 + (1 / ACTIVITY - 1) / np.maximum(wet, 1e-3)))


def rising(wet: Floats) -> Floats:
    """Return the slope of the activity over that share (n)."""
    here = activity(wet)
    return np.asarray(here * (1 - here) / np.maximum(wet, 1e-3))


def diffusivity(within: Within, celsius: float) -> float:
    """Return the diffusivity of water in the flesh at a temperature [m2/s]."""
    kelvin = celsius + _ZERO
    return float(within.water * np.exp(within.water_energy / _GAS * (1 / _GIVEN - 1 / kelvin)))


class Water:
    """The water of one fruit whose skin and flesh are one medium; extent: of its surface."""

    def __init__(self, params: DecayParams, within: Within, joint: Joint, extent: Extent) -> None:
        self._params, self._within, self._joint, self._extent = params, within, joint, extent
        self._radius = reference_radius(params, extent)
        self._all = np.arange(len(joint.area))
        one = np.ones(len(joint.area))
        self._links = linked(one, _NO_ROT, self._all, joint.start, joint.near, joint.weight, joint.area)
        self.fresh = one
        skin = joint.skin
        # what a vertex loses at a conductance of 1 where the whole skin loses 1, over what its own flesh holds
        share = skin.area / skin.total(1.0)
        self._per = share * joint.total(1.0) / (joint.area[: len(share)] * params.water_content / 100)

    def lost(self, wet: Floats) -> float:
        """Return the water that is gone, over the fresh weight."""
        return max(self._params.water_content / 100 * (1 - self._joint.mean(wet)), 0.0)

    def advance(self, wet: Floats, broken: Floats, start: float, end: float, dries: float = 1.0) -> Floats:
        """Return the water at the end [day], with a share (v) of the skin broken meanwhile.

        dries: evaporation over that of a fruit alone.
        """
        if end <= start:
            return wet
        params = self._params
        celsius, humidity = air(params, (start + end) / 2)
        skin = params.transpiration + (opened(params) - params.transpiration) * broken
        # the whole loss of wet flesh; places give it in proportion to what their activity is above the air's
        whole = evaporated(params, self._extent, start, end) * dries
        dry = float(humidity) / 100
        give = skin * self._per * whole / max(ACTIVITY - dry, 1e-3)
        count = int(np.clip(np.ceil(float(give.max()) * ACTIVITY / _LARGEST), 1, _MOST))
        dt, rate = (end - start) / count, diffusivity(self._within, float(celsius)) * _DAY / self._radius**2
        size = len(give)
        give, gain, loss = give / (end - start), np.zeros(len(wet)), np.zeros(len(wet))
        for _ in range(count):
            # the activity as a straight line about what there is
            here, bend = activity(wet[:size]), rising(wet[:size])
            gives = give * (here > dry)
            gain[:size], loss[:size] = gives * (dry - here + bend * wet[:size]), gives * bend
            wet = np.maximum(spread(wet, self._links, rate, gain, loss, self._joint.stiffest, dt), 0.0)
        return wet
