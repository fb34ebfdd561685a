"""The shape where a scene wants no more: transpiration drives shrinkage, the dehydration table gives the wrinkles."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ...arrays import Floats
from ...contract import Context, InvalidInput, Need
from ...fruit import Fruit
from ..body.flesh import Skin
from ..params import DecayParams

__all__ = ["at_rays", "check", "displaced", "shrinkage"]


#: Rows of the lattice that a mesh is moved by where no lattice was asked for: the table's own.
ROWS = 64


def check(params: DecayParams, need: Need) -> None:
    """Refuse what a table of surfaces cannot know.

    Raises:
        InvalidInput: the need names the flesh, or the parameters a march.

    """
    if "least_jacobian" in need.fields:
        raise InvalidInput("body=table has no flesh, so no least_jacobian.", advice="Take body=quasi-static for it.")
    if params.march is not None:
        raise InvalidInput("body=table settles nothing, so it cannot march.", advice="Leave march out.")


def shrinkage(params: DecayParams, water: float) -> float:
    """Return the share of each length that is lost with a share of the weight as water (Eq. 1 corrected)."""
    return float(1 - np.cbrt(1 - params.flesh.shrinkage * water))


def displaced(params: DecayParams, water: float, resolution: int, context: Context) -> Floats:
    """Return the displacement (n, 2 n, 3) [r1] on the lattice after a share of the weight has gone as water.

    The skin's stiffness over the flesh's is that of `skin`, given or not.

    Raises:
        InvalidInput: the table holds no such fruit, or none so dry.

    """
    fruit = {name: params.axis(name) for name in Fruit.axes}
    fruit["gamma"] = (params.skin or Skin()).stiffness
    return np.asarray(context.shape("dehydration", fruit, shrinkage(params, water), resolution), float)


def at_rays(values: Floats, rays: Floats) -> Floats:
    """Return a lattice's vectors (n, 2 n, 3) at unit rays (v, 3), by cubic splines across poles and seam."""
    n, rim = len(values), 8
    # beyond a pole the rows go on on the other side
    rows = np.concatenate([values[:rim][::-1], values, values[-rim:][::-1]])
    rows[:rim], rows[-rim:] = np.roll(rows[:rim], n, axis=1), np.roll(rows[-rim:], n, axis=1)
    padded = np.concatenate([rows[:, -rim:], rows, rows[:, :rim]], axis=1)
    down = np.arccos(np.clip(rays[:, 1], -1, 1)) * n / np.pi - 0.5 + rim
    along = np.arctan2(rays[:, 2], rays[:, 0]) % (2 * np.pi) * n / np.pi + rim
    return np.stack([ndimage.map_coordinates(padded[..., k], [down, along], order=3) for k in range(3)], axis=-1)
