"""How rods crush: pressed along the grain beyond what it bears, wood folds into kinks, and stays shorter.

Elastic and perfectly plastic: an edge bears a compressive stress up to the strength. What it is pressed beyond, it
keeps: the length at which it bears nothing, `Rods.free` over that at rest, is moved along until the stress is the
strength again (a return mapping, exact in one dimension; Simo and Hughes 1998, sec. 1.2). Between two looks a run goes
a few waves' steps ahead, so that stress overshoots by little. It unloads with its own stiffness, and in tension breaks
at the strain it breaks at, counted from where it bears nothing. Kinks soften a little and then hold (Poulsen et al.
1997): the plateau stands for that. Rods crush by the mean of their section: a bundle's rods are the layers of a bent
stick, and what a single rod bears by its own bending does not crush.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .model.arrays import Rods
from .model.plan import FREE, Plan

__all__ = ["crush"]


@njit(cache=True, error_model="numpy")
def crush(plan: Plan, rods: Rods, inverse: np.ndarray, limit: float) -> int:
    """Shorten edges that are pressed beyond the strain `limit`, in `rods` and in the plan; return how many.

    inverse (e,) [1/m]: 1 over their lengths now.
    """
    found = 0
    for p in range(len(plan.part) - 1):
        for e in range(plan.part[p], plan.part[p + 1]):
            if rods.alive[e] == 0 or rods.k[e] == 0.0:
                continue
            ratio = 1.0 / (inverse[e] * rods.rest[e])
            if ratio - rods.free[e] < -limit:
                rods.free[e] = ratio + limit
                plan.edge[p, FREE, e - int(plan.part[p])] = rods.free[e]
                found += 1
    return found
