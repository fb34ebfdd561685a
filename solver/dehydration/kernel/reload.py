"""A core whose target shape is not the same everywhere: Fd = theta G, with its own diagonal G in every element.

With X' = G X, F' = dx/dX' and V' = G V the energy of an element is exactly that of an isotropic one:

    integral over V of det(Fd) W(F Fd^-1)  =  integral over V' of theta^3 W(F' / theta).

So the kernel, which knows one theta for the whole core, is handed the fresh geometry of X'. The stored planes hold the
modes of the fresh element, which are linear in X: three multiplications a mode, and nothing else changes.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from solver.dehydration.kernel.algebra import GEOMETRY, INVERSE_VOLUME, KAPPA, MU
from solver.dehydration.kernel.fixed_point import positions
from solver.dehydration.kernel.layout import Layout, aligned_copy, aligned_zeros
from solver.dehydration.kernel.metric import one_point_planes

from ...arrays import Floats, Singles

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
    scale = np.ascontiguousarray(lanes.transpose(0, 2, 1), np.float32)
    planes = aligned_copy(fresh.core_planes, np.float32)
    blocks, _, width = planes.shape
    planes[:, GEOMETRY:].reshape(blocks, -1, 3, width)[...] *= scale[:, None]
    planes[:, INVERSE_VOLUME] /= scale.prod(axis=1)
    return dataclasses.replace(layout, core_planes=planes, one_point_planes=_one_point(fresh, lanes))


def _one_point(fresh: Layout, lanes: Floats) -> Singles:
    """Planes of the one-point element; its metric is not linear in X and is taken anew."""
    old = fresh.one_point_planes
    if not len(old):
        return old
    elements = fresh.core_elements.ravel()
    corners = positions(fresh.fresh)[fresh.connectivity[elements]] * lanes.reshape(-1, 1, 3)
    mu, kappa = (old[:, plane].ravel().astype(np.float64) for plane in (MU, KAPPA))
    planes: Singles = aligned_zeros(old.shape, np.float32)
    made = one_point_planes(corners, mu, kappa).reshape(-1, *fresh.core_elements.shape)
    planes[...] = made.transpose(1, 0, 2)
    return planes
