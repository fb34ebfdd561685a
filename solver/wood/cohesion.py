"""How bonds give way: a cohesive law by crack area, in opening, in shear and in any mix of both.

A bond stands for a crack area a (`model.cracks`). With the energies that it would have if it were whole, w_I by
opening and w_II by shear, lambda^2 = w_I + w_II measures its separation and beta = w_II / lambda^2 the mix. Damage
begins at 1 / lambda_0^2 = (1 - beta) / w_I0 + beta / w_II0, the quadratic criterion of stresses, and is whole at
lambda_f. Between them stress falls evenly, D = lambda_f (lambda - lambda_0) / (lambda (lambda_f - lambda_0)), so that
lambda_0 lambda_f is what taking it apart costs: a (G_Ic + (G_IIc - G_Ic) beta^eta) (Benzeggagh and Kenane 1996; the law
by separation: Camanho and Davila 2002, Turon et al. 2006). Damage never heals. A bond under pressure opens nothing, and
resists it whatever its damage.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .model.arrays import Bonds
from .model.plan import KEEP, SPRING, Plan

__all__ = ["separation", "soften"]

#: Least ratio of separations at the end and at the beginning of damage: a bond of coarse rods, which at its strength
#: holds more than its crack costs, is as tough as it should be, and weaker.
_BRITTLE = 1.05
#: Strain of a broken bond beyond which it is out of the way, and is forgotten.
_AWAY = 0.5


@njit(cache=True, error_model="numpy")
def separation(
    opening: float, shear: float, opens: float, slides: float, torn: float, shorn: float, mixing: float
) -> tuple[float, float, float]:
    """Return separation, and where damage begins and ends [J^0.5]; arguments in J as `Bonds` has them."""
    both = opening + shear
    beta = shear / both
    begin = 1.0 / np.sqrt((1.0 - beta) / opens + beta / slides)
    cost = torn + (shorn - torn) * beta**mixing
    if begin * begin * _BRITTLE > cost:
        begin = np.sqrt(cost / _BRITTLE)
    return np.sqrt(both), begin, cost / begin


@njit(cache=True, error_model="numpy")
def soften(plan: Plan, bonds: Bonds, each: np.ndarray, mixing: float) -> tuple[float, int, int]:
    """Damage bonds by the energies each (2, b) [J] that they would have if whole, in `bonds` and in the plan's law.

    Returns the energy [J] that this takes, how many broke, and how many broken ones got out of the way.
    """
    taken = 0.0
    broken = 0
    gone = 0
    for p in range(len(plan.part) - 1):
        for m in range(plan.lane[plan.part[p + 1] + p]):
            b = plan.origin[p, m]
            opening = each[0, b]
            shear = each[1, b]
            if bonds.on[b] == 2:
                if opening > 0.5 * _AWAY * _AWAY * bonds.k[b] * bonds.rest[b]:
                    bonds.on[b] = 0
                    plan.law[p, SPRING, m] = 0.0
                    gone += 1
                continue
            # below the least of both, nothing begins
            if bonds.on[b] == 0 or opening + shear <= min(
                min(bonds.opens[b], bonds.slides[b]), min(bonds.torn[b], bonds.shorn[b]) / _BRITTLE
            ):
                continue
            now, begin, end = separation(
                opening, shear, bonds.opens[b], bonds.slides[b], bonds.torn[b], bonds.shorn[b], mixing
            )
            if now <= begin:
                continue
            damage = 1.0 if now >= end else end * (now - begin) / (now * (end - begin))
            if damage <= bonds.damage[b]:
                continue
            taken += (damage - bonds.damage[b]) * (opening + shear)
            bonds.damage[b] = damage
            # of its cost, what was spent: stress falls evenly, so this is how far separation has come
            bonds.parted[b] = max(bonds.parted[b], min((now - begin) / (end - begin), 1.0))
            plan.law[p, KEEP, m] = 1.0 - damage
            if damage >= 1.0:
                bonds.on[b] = 2
                broken += 1
    return taken, broken, gone
