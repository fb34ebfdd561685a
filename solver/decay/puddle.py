"""What leaked: a puddle of juice below the fruit (D55).

A large one is as thick as gravity and its edge let it be, 2 l sin(angle / 2) with l the capillary length; a small one
is a cap (de Gennes, Brochard-Wyart and Quere 2004, ch. 2). Juice has water's tension; the angle on the table is a
choice.
"""

from __future__ import annotations

import numpy as np

__all__ = ["puddle_radius"]

#: Surface tension [N/m], density [kg/m^3], and the angle of the edge.
_TENSION, _DENSITY, _ANGLE = 0.072, 1000.0, np.pi / 3


def puddle_radius(grams: float, gravity: float) -> float:
    """Return the radius [m] of a puddle of so much juice [g]; 0 where nothing leaked or nothing falls."""
    if grams <= 0 or gravity <= 0:
        return 0.0
    volume = 1e-3 * grams / _DENSITY
    thick = 2 * np.sqrt(_TENSION / (_DENSITY * gravity)) * np.sin(_ANGLE / 2)
    # of a cap with that angle and a base of radius 1
    height = np.tan(_ANGLE / 2)
    cap = np.pi * height * (3 + height**2) / 6
    return float(max(np.sqrt(volume / (np.pi * thick)), np.cbrt(volume / cap)))
