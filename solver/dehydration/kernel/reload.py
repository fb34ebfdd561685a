"""A core whose target shape is not the same everywhere: Fd = theta G, with its own diagonal G in every element.

With X' = G X, F' = dx/dX' and V' = G V the energy of an element is exactly that of an isotropic one:

    integral over V of det(Fd) W(F Fd^-1)  =  integral over V' of theta^3 W(F' / theta).

So the kernel, which knows one theta for the whole core, is handed the fresh geometry of X', and nothing else changes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial

import numpy as np

from solver.dehydration.kernel.algebra import KAPPA, MU
from solver.dehydration.kernel.fixed_point import positions
from solver.dehydration.kernel.layout import Layout, aligned_zeros
from solver.dehydration.kernel.metric import element_planes, one_point_planes
from solver.dehydration.kernel.strips import LANES

from ...arrays import Bools, Floats, Singles

__all__ = ["reload"]


def reload(layout: Layout, fresh: Layout, target: Floats) -> Layout:
    """`layout` with the core's targets theta G.

    fresh: the same mesh as `build_layout` made it, G = I. target: (ne, 3) diagonal of G of each element, positive;
    the exocarp's rows are not read. Masses stay: see `reweigh`.

    Raises ValueError for a target that is not positive.
    """
    if target.shape != (layout.elements, 3):
        raise ValueError(f"target must have shape {(layout.elements, 3)}, got {target.shape}")
    lanes = target[fresh.core_elements]
    if not np.all(lanes > 0):
        raise ValueError("targets must be positive: the flesh would shrink to nothing")
    corners = positions(fresh.fresh)[fresh.connectivity[fresh.core_elements]] * lanes[:, :, None]
    real = fresh.core_elements >= 0
    core, single = fresh.core_planes, fresh.one_point_planes
    return dataclasses.replace(
        layout,
        core_planes=_anew(core, real, corners, partial(element_planes, exocarp=False)),
        one_point_planes=_anew(single, real, corners, one_point_planes),
    )


def _anew(old: Singles, real: Bools, corners: Floats, planes_of: Callable[..., Floats], chunk: int = 128) -> Singles:
    """Planes like the `old` ones (blocks, planes, 16) of elements whose fresh corners are (blocks, 16, 8, 3).

    Lanes that only fill a vector, those that are not `real` (blocks, 16), keep the old ones.
    """
    planes: Singles = aligned_zeros(old.shape, np.float32)
    for first in range(0, len(old), chunk):
        part = slice(first, first + chunk)
        mu, kappa = (old[part, plane].ravel().astype(np.float64) for plane in (MU, KAPPA))
        made = planes_of(corners[part].reshape(-1, 8, 3), mu, kappa)
        made = made.reshape(old.shape[1], -1, LANES).transpose(1, 0, 2)
        planes[part] = np.where(real[part, None], made, old[part])
    return planes
