"""Fragments as a list: how many there are, what the heaviest weigh, where they are and how long."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .model.state import Wood
from .params import WoodParams

__all__ = ["MOST", "pieces"]

#: Fragments that are listed, the heaviest first; lists of fewer end in zeros.
MOST = 32


def pieces(wood: Wood, params: WoodParams) -> dict[str, Any]:
    """Return the number of fragments, and mass (32,) [kg], middle (32, 3) [m] and length (32,) [m] of the heaviest.

    A fragment hangs together by whole edges and whole bonds. Its length is along the direction in which it is longest.
    """
    m, rods, bonds = wood.motion, wood.rods, wood.bonds
    real, alive = rods.k > 0, (rods.alive == 1) & (rods.k > 0)
    on = (bonds.on == 1) & (bonds.damage < 1)
    a = np.concatenate([rods.a[alive], rods.a[bonds.i[on]]])
    b = np.concatenate([rods.b[alive], rods.a[bonds.j[on]]])
    count = len(m.x)
    label = connected_components(coo_matrix((np.ones(len(a)), (a, b)), (count, count)), directed=False)[1]
    # vertices of ghosts have a mass that is none
    solid = np.zeros(count, bool)
    solid[rods.a[real]] = solid[rods.b[real]] = True
    mass = m.mass / params.mass_scaling
    weight = np.bincount(label[solid], mass[solid])
    order = np.argsort(-weight, kind="stable")
    order = order[weight[order] > 0]
    found = {"fragment_mass": np.zeros(MOST), "fragment_place": np.zeros((MOST, 3)), "fragment_length": np.zeros(MOST)}
    for n, k in enumerate(order[:MOST]):
        mine = np.flatnonzero(solid & (label == k))
        x, w = m.x[mine], mass[mine]
        middle = w @ x / w.sum()
        way = np.linalg.eigh(((x - middle) * w[:, None]).T @ (x - middle))[1][:, -1]
        found["fragment_mass"][n] = weight[k]
        found["fragment_place"][n] = middle
        found["fragment_length"][n] = np.ptp((x - middle) @ way)
    return {"fragments": len(order), **found}
