"""Whether a surface around the origin is seen whole from there: then it crosses itself nowhere.

In plain numpy, so that whoever asks for smooth shapes alone loads no compiler. `solver.geometry.inward` looks at the
others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["STEEP", "faces_outward"]

#: Cosine between a triangle's normal and the direction to it below which it counts as facing inwards.
STEEP = 0.03


def faces_outward(x: NDArray[np.float64], triangles: NDArray[np.integer]) -> bool:
    """Return whether all triangles (nt, 3), counter-clockwise from outside, of points x (nv, 3) face the outside."""
    a, b, c = (x[triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    volume = np.einsum("ti,ti->t", normal, a)
    if volume.min() <= 0:
        return False
    square = np.einsum("ti,ti->t", normal, normal) * np.einsum("ti,ti->t", a, a)
    return bool((volume * volume > STEEP**2 * square).all())
