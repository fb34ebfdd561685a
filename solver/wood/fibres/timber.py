"""What a bundle is hewn from where fibres deviate: wood wide enough that they fill the bundle from end to end."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from ..model.outline import area, corners
from ..params import WoodParams
from .paths import named

__all__ = ["LEAST", "hews", "timber"]

#: Share of a rod's section within the outline with which it ends.
LEAST = 0.15

#: Sections along, and places on each side of the outline, at which fibres are asked for.
_SECTIONS, _PLACES = 65, 8


def hews(params: WoodParams) -> bool:
    """Return whether fibres may leave the bundle: they do not in a round one that grew about its pith."""
    return params.grain.deviates and (bool(params.outline) or params.grain.pith != (0.0, 0.0))


def timber(params: WoodParams) -> WoodParams:
    """Return the parameters of the wood to lay: as dense in rods, its outline that of all fibres, by their names."""
    if not hews(params):
        return params
    own = corners(params)
    part = np.arange(_PLACES)[:, None, None] / _PLACES
    rim = ((1 - part) * own + part * np.roll(own, -1, 0)).reshape(-1, 2)
    # what is left of rods whose middle is outside
    rim *= 1 + 0.5 * (area(own) / params.rods) ** 0.5 / np.linalg.norm(rim, axis=1).min()
    x = np.linspace(0, params.length, _SECTIONS)
    through = np.concatenate([np.repeat(x, len(rim))[:, None], np.tile(rim, (len(x), 1))], 1)
    found = named(through, params)[:, 1:]
    # an outline's centroid becomes the axis: one that is its own mirror image about the origin stays where it is
    both = np.concatenate([found, -found])
    hull = both[ConvexHull(both).vertices]
    rods = max(round(params.rods * area(hull) / area(own)), 1)
    return params.model_copy(update={"outline": tuple(map(tuple, hull.tolist())), "rods": rods})
