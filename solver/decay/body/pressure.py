"""The pressure map (D6): flesh that is stiffer or softer, longer or shorter, where a user pressed."""

from __future__ import annotations

import numpy as np

from ...fruit import directions
from ...painted import painted
from ..params import DecayParams
from .flesh import Softened
from .solid import Solid

__all__ = ["pressed"]


def pressed(state: Softened, params: DecayParams, solid: Solid) -> Softened:
    """Return the state of tetrahedra under the pressure points and the painted map; a stone feels neither."""
    if not params.pressure and params.pressure_map is None:
        return state
    stiffness, length = np.ones(len(solid.tets)), np.ones(len(solid.tets))
    for point in params.pressure:
        angles = np.radians([point.colatitude, point.azimuth])
        if params.mesh is None:
            centre = params.surface(*angles)
        else:
            centre = solid.points[solid.skin[np.argmax(solid.rays[solid.skin] @ directions(*angles))]]
        far = ((solid.points - centre) ** 2).sum(axis=1)
        share = np.clip(1 - far / point.radius**2, 0, None)[solid.tets].mean(axis=1)
        stiffness *= point.stiffness**share
        length *= point.length**share
    if params.pressure_map is not None:
        chosen = params.pressure_map
        fades = np.clip(1 - solid.depth / chosen.depth, 0, 1)
        share = (painted(chosen.values, solid.rays) * fades)[solid.tets].mean(axis=1)
        stiffness *= chosen.stiffness**share
        length *= chosen.length**share
    return state._replace(
        shrinkage=np.where(solid.stone, state.shrinkage, state.shrinkage * length),
        young=np.where(solid.stone, state.young, state.young * stiffness),
    )
