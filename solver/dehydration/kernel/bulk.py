"""A bulk modulus larger than the one that is marched with: augmented Lagrangian, element by element.

The critical step falls with the root of kappa, so marching at kappa/mu = 1000 costs six times what it costs at 30. The
pressure p = kappa (J/(g Jd) - 1) does not know what part of it is compression and what the rest volume g holds: with

    g = (1 + p / kappa_wanted) / (1 + p / kappa)

in equilibrium J/Jd = 1 + p / kappa_wanted, as if the modulus were the wanted one. g follows p by the same rule, taken
from the state every now and then (Uzawa's iteration; it contracts by about mu / kappa).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numba import njit, prange

from solver.dehydration.kernel.algebra import INVERSE_VOLUME, KAPPA, MU
from solver.dehydration.kernel.fixed_point import QUANTUM
from solver.dehydration.kernel.layout import Layout, aligned_copy
from solver.dehydration.kernel.metric import SLOPES, quadrature

from ...arrays import Floats, Ints, Ints32, Singles

__all__ = ["dilatations", "pressure_energy", "rested", "rests", "without_bulk"]


@njit(cache=True, error_model="numpy", parallel=True)
def _dilatations(
    state: Ints32,
    connectivity: Ints,
    elements: Ints,
    planes: Singles,
    slopes: Floats,
    weights: Floats,
    cube: float,
    result: Floats,
) -> None:
    """Fill the `result` (ne,) of `elements` (blocks, 16), by a rule with shape derivatives `slopes` (q, 8, 3).

    planes (blocks, ..., 16): theirs. cube: the volume that they would have, over the fresh one.
    """
    for place in prange(elements.size):
        block, lane = place // elements.shape[1], place % elements.shape[1]
        e = elements[block, lane]
        if e < 0:
            continue
        total = 0.0
        for q in range(weights.size):
            # scalars: an array for each point would come from the heap, which took most of the time
            f00 = f01 = f02 = f10 = f11 = f12 = f20 = f21 = f22 = 0.0
            for a in range(8):
                node = connectivity[e, a]
                x, y, z = state[node, 0], state[node, 1], state[node, 2]
                s, t, u = slopes[q, a, 0], slopes[q, a, 1], slopes[q, a, 2]
                f00, f01, f02 = f00 + x * s, f01 + x * t, f02 + x * u
                f10, f11, f12 = f10 + y * s, f11 + y * t, f12 + y * u
                f20, f21, f22 = f20 + z * s, f21 + z * t, f22 + z * u
            total += weights[q] * (
                f00 * (f11 * f22 - f12 * f21) - f01 * (f10 * f22 - f12 * f20) + f02 * (f10 * f21 - f11 * f20)
            )
        result[e] = total * QUANTUM**3 * planes[block, INVERSE_VOLUME, lane] / cube - 1.0


def dilatations(layout: Layout, state: Ints32, theta: float) -> Floats:
    """J / Jd - 1 of every element, (ne,), as the kernel's volumetric energy sees it; state (nodes, 4)."""
    found = np.empty(layout.elements)
    for exocarp, elements, planes, cube in (
        (False, layout.core_elements, layout.core_planes, theta**3),
        (True, layout.exocarp_elements, layout.exocarp_planes, 1.0),
    ):
        rule = SLOPES[exocarp], quadrature(exocarp)[1]
        _dilatations(state, layout.connectivity, elements, planes, *rule, cube, found)
    return found


def rests(dilatation: Floats, kappa: Floats | float, wanted: float) -> Floats:
    """Rest volumes g (ne,) that go with the pressure kappa times `dilatation` (ne,), measured under the g before.

    kappa: of every element, or of all. A pressure beyond its half is that of an element about to be crushed: only that
    much of it is taken; of a pull, which cannot crush, twice kappa.
    """
    strain = np.clip(dilatation, -0.5, 2.0)
    g: Floats = (1 + strain * kappa / wanted) / (1 + strain)
    return g


def rested(layout: Layout, g: Floats, before: Layout | None = None) -> Layout:
    """`layout`, as built or reloaded, with the rest volumes g (ne,) of its elements.

    before: what this returned for other rest volumes of the same layout, where nobody needs that any more; its planes
    are written over, which takes a tenth of the time that copies take.
    """
    core, skin = ((g[elements]).astype(np.float32) for elements in (layout.core_elements, layout.exocarp_elements))
    old = layout.core_planes, layout.exocarp_planes, layout.one_point_planes
    if before is None:
        core_planes, skin_planes, single = (aligned_copy(planes, np.float32) for planes in old)
    else:
        core_planes, skin_planes, single = before.core_planes, before.exocarp_planes, before.one_point_planes
    np.divide(old[0][:, INVERSE_VOLUME], core, out=core_planes[:, INVERSE_VOLUME])
    np.divide(old[1][:, INVERSE_VOLUME], skin, out=skin_planes[:, INVERSE_VOLUME])
    if len(single):
        # one volume ratio serves both terms of this element: the shear's share is taken out of its modulus
        np.divide(old[2][:, INVERSE_VOLUME], core, out=single[:, INVERSE_VOLUME])
        np.divide(old[2][:, MU], np.cbrt(core) ** 2, out=single[:, MU])
    return dataclasses.replace(layout, core_planes=core_planes, exocarp_planes=skin_planes, one_point_planes=single)


def without_bulk(layout: Layout) -> Layout:
    """`layout` without bulk moduli: its energy is that of shear, and of the barrier."""
    planes = [aligned_copy(p, np.float32) for p in (layout.core_planes, layout.exocarp_planes, layout.one_point_planes)]
    for each in planes:
        if len(each):
            each[:, KAPPA] = 0
    return dataclasses.replace(layout, core_planes=planes[0], exocarp_planes=planes[1], one_point_planes=planes[2])


def pressure_energy(layout: Layout, dilatation: Floats, theta: float, share: Floats | float) -> Floats:
    """Energy (ne,) of pressures kappa times `dilatation` (ne,) in flesh whose bulk modulus is kappa / `share` (ne,).

    layout: without rest volumes, which hold what the march's bulk modulus alone would let go.
    """
    core, skin = layout.core_planes, layout.exocarp_planes
    kappa, inverse = (layout.lanes(core[:, plane], skin[:, plane]) for plane in (KAPPA, INVERSE_VOLUME))
    ratio = layout.lanes(np.full_like(core[:, KAPPA], theta**3), np.ones_like(skin[:, KAPPA]))
    found: Floats = 0.5 * share * kappa * ratio / inverse * dilatation**2
    return found
