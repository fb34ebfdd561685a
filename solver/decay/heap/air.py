"""The air between the fruits of a heap: what one gives off, the others do not.

Vapour spreads from each fruit as from a point source in still air, so at a distance r a fruit that loses E stands in
E / (4 pi D r) more of it, and a share `still` of that is not blown away. What each then gives off follows from all of
them at once: a linear system, in which a heap dampens itself and never more than to its own vapour pressure.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats

__all__ = ["Between", "between"]

#: Diffusivity of water vapour in air [m^2/s], and its gas constant [J/(kg K)]; sources in docs/decay.md.
_DIFFUSIVITY = 2.545e-5
_VAPOUR = 461.53


class Between(NamedTuple):
    """Of each fruit: evaporation over that of a fruit alone (b), and what the others add to its humidity [percent]."""

    dries: Floats
    damp: Floats


def between(
    centres: Floats,
    own: Floats,
    conductances: Floats,
    celsius: float,
    pressures: tuple[float, float, float],
    still: float,
) -> Between:
    """Return the air about fruits with centres (b, 3) [m], radii `own` (b) [m], conductances (b) [g/(s Pa)].

    pressures: of vapour at the skins, in the room, and in saturated air [Pa]. still: share that no wind takes away.
    """
    wet, dry, full = pressures
    count = len(centres)
    if wet <= dry or still == 0:
        return Between(np.ones(count), np.zeros(count))
    far = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    far = np.maximum(far, np.maximum(own[:, None], own[None]))
    raised = 1e-3 * still * _VAPOUR * (celsius + 273.15) / (4 * np.pi * _DIFFUSIVITY * far)
    np.fill_diagonal(raised, 0.0)
    lost = np.linalg.solve(np.eye(count) + conductances[:, None] * raised, conductances * (wet - dry))
    # where others are so much wetter that vapour would go into a fruit, no dew falls
    lost = np.clip(lost, 0.0, conductances * (wet - dry))
    more = np.clip(raised @ lost, 0.0, wet - dry)
    return Between(lost / (conductances * (wet - dry)), 100 * more / full)
