"""A bundle that gets thinner along its axis, as a branch does: its fibres run together with its surface.

All fibres are straight lines that meet in the tip of the cone, so that a taper costs nothing at rest, and nothing bends
that was straight. Rods get thinner by as much as the bundle: their share of each section stays what it is.
"""

from __future__ import annotations

import numpy as np

from ..params import WoodParams

__all__ = ["tapered", "thickness"]


def thickness(x: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return the radius (...) over that at the start at places x (...) [m] along the straight bundle."""
    found: np.ndarray = 1 + (params.taper - 1) * np.asarray(x) / params.length
    return found


def tapered(points: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return points (..., 3) [m] of the even bundle where they lie in the tapered one."""
    if params.taper == 1:
        return points
    scale = thickness(points[..., 0], params)[..., None]
    return np.concatenate([points[..., :1], points[..., 1:] * scale], -1)
