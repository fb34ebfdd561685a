"""Where decay enters when nobody points: the stem, what the fruit rests on, and what it touches (D5, D49)."""

from __future__ import annotations

import numpy as np

from ..params import DecayParams, Wound
from .places import Neighbour

__all__ = ["carried", "gap", "seeds"]

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
    # a fruit that lies on another one does not reach the floor
    return (Wound(colatitude=0), *([] if carried(params) else _resting(params)), *_touching(params))


def carried(params: DecayParams) -> bool:
    """Return whether the fruit lies on a neighbour that it touches, and not on the floor."""
    return any(wound.colatitude > _ABOVE for wound in _touching(params))


def gap(params: DecayParams, other: Neighbour) -> float:
    """Return how far the fresh skin is from a neighbour [r1], on the line between the centres."""
    far = float(np.linalg.norm(other.position))
    if far == 0:
        return -other.radius - 1
    towards = _towards(other)
    theta, phi = np.radians([towards.colatitude, towards.azimuth])
    return far - float(np.linalg.norm(params.surface(theta, phi))) - other.radius


def _resting(params: DecayParams) -> list[Wound]:
    theta = np.linspace(np.pi / 2, np.pi, 181)
    height = params.surface(theta, np.zeros_like(theta))[:, 1]
    lowest = int(np.argmin(height))
    if height[-1] - height[lowest] < 0.01:
        return [Wound(colatitude=180)]
    down = float(np.degrees(theta[lowest]))
    return [Wound(colatitude=down, azimuth=360 * k / _RING) for k in range(_RING)]


def _touching(params: DecayParams) -> list[Wound]:
    return [_towards(other) for other in params.neighbours if any(other.position) and gap(params, other) <= _GAP]


def _towards(other: Neighbour) -> Wound:
    return Wound.model_validate({"position": other.position})
