"""Where decay enters when nobody points: the stem, what the fruit rests on, and what it touches (D5, D49)."""

from __future__ import annotations

import numpy as np

from .params import DecayParams, Wound

__all__ = ["seeds"]

#: Gap at which two fruits touch [r1]: their skins give way by about as much.
_GAP = 0.05
#: Colatitude of a neighbour that carries the fruit [degree].
_ABOVE = 120.0
#: A fruit that rests on a ring rather than on its pole touches the floor at so many places.
_RING = 6


def seeds(params: DecayParams) -> tuple[Wound, ...]:
    """Return the wounds of a run: the given ones, or stem, floor and touching neighbours in their place."""
    if params.seeds == "wounds":
        return params.wounds
    touching = _touching(params)
    # a fruit that lies on another one does not reach the floor
    carried = any(wound.colatitude > _ABOVE for wound in touching)
    return (Wound(colatitude=0), *([] if carried else _resting(params)), *touching)


def _resting(params: DecayParams) -> list[Wound]:
    theta = np.linspace(np.pi / 2, np.pi, 181)
    height = params.surface(theta, np.zeros_like(theta))[:, 1]
    lowest = int(np.argmin(height))
    if height[-1] - height[lowest] < 0.01:
        return [Wound(colatitude=180)]
    down = float(np.degrees(theta[lowest]))
    return [Wound(colatitude=down, azimuth=360 * k / _RING) for k in range(_RING)]


def _touching(params: DecayParams) -> list[Wound]:
    found = []
    for other in params.neighbours:
        far = float(np.linalg.norm(other.position))
        if far == 0:
            continue
        wound = Wound.model_validate({"position": other.position})
        theta, phi = np.radians([wound.colatitude, wound.azimuth])
        if far - float(np.linalg.norm(params.surface(theta, phi))) - other.radius <= _GAP:
            found.append(wound)
    return found
