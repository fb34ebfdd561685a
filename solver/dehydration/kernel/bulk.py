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

from ...arrays import Floats, Ints, Ints32

__all__ = ["dilatations", "pressure_energy", "rested", "rests", "without_bulk"]


@njit(cache=True, error_model="numpy", parallel=True)
def _volumes(
    state: Ints32,
    connectivity: Ints,
    elements: Ints,
    slopes: Floats,
    weights: Floats,
) -> Floats:
    """Volume of each of `elements` by a rule with shape derivatives `slopes` (q, 8, 3), in quanta cubed."""
    result = np.empty(elements.size)
    for place in prange(elements.size):
        e = elements[place]
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
        result[place] = total
    return result


def dilatations(layout: Layout, state: Ints32, theta: float) -> Floats:
    """J / Jd - 1 of every element, (ne,), as the kernel's volumetric energy sees it; state (nodes, 4)."""
    inverse = layout.lanes(layout.core_planes[:, INVERSE_VOLUME], layout.exocarp_planes[:, INVERSE_VOLUME])
    ratio = np.empty(layout.elements)
    for exocarp, held, cube in ((False, layout.core_elements, theta**3), (True, layout.exocarp_elements, 1.0)):
        elements = held[held >= 0]
        rule = SLOPES[exocarp], quadrature(exocarp)[1]
        volume = _volumes(state, layout.connectivity, elements, *rule) * QUANTUM**3
        ratio[elements] = volume * inverse[elements] / cube
    return ratio - 1


def rests(dilatation: Floats, kappa: float, wanted: float) -> Floats:
    """Rest volumes g (ne,) that go with the pressure kappa times `dilatation` (ne,), measured under the g before.

    A pressure beyond kappa / 4 is that of an element about to be crushed: only that much of it is taken.
    """
    strain = np.clip(dilatation, -0.25, 0.25)
    g: Floats = (1 + strain * kappa / wanted) / (1 + strain)
    return g


def rested(layout: Layout, g: Floats) -> Layout:
    """`layout`, as built or reloaded, with the rest volumes g (ne,) of its elements."""
    core, skin = ((g[elements]).astype(np.float32) for elements in (layout.core_elements, layout.exocarp_elements))
    core_planes, skin_planes, single = (
        aligned_copy(planes, np.float32)
        for planes in (layout.core_planes, layout.exocarp_planes, layout.one_point_planes)
    )
    core_planes[:, INVERSE_VOLUME] /= core
    skin_planes[:, INVERSE_VOLUME] /= skin
    if len(single):
        # one volume ratio serves both terms of this element: the shear's share is taken out of its modulus
        single[:, INVERSE_VOLUME] /= core
        single[:, MU] /= np.cbrt(core) ** 2
    return dataclasses.replace(layout, core_planes=core_planes, exocarp_planes=skin_planes, one_point_planes=single)


def without_bulk(layout: Layout) -> Layout:
    """`layout` without bulk moduli: its energy is that of shear, and of the barrier."""
    planes = [aligned_copy(p, np.float32) for p in (layout.core_planes, layout.exocarp_planes, layout.one_point_planes)]
    for each in planes:
        if len(each):
            each[:, KAPPA] = 0
    return dataclasses.replace(layout, core_planes=planes[0], exocarp_planes=planes[1], one_point_planes=planes[2])


def pressure_energy(layout: Layout, dilatation: Floats, theta: float, share: float) -> Floats:
    """Energy (ne,) of pressures kappa times `dilatation` (ne,) in flesh whose bulk modulus is kappa / `share`.

    layout: without rest volumes, which hold what the march's bulk modulus alone would let go.
    """
    core, skin = layout.core_planes, layout.exocarp_planes
    kappa, inverse = (layout.lanes(core[:, plane], skin[:, plane]) for plane in (KAPPA, INVERSE_VOLUME))
    ratio = layout.lanes(np.full_like(core[:, KAPPA], theta**3), np.ones_like(skin[:, KAPPA]))
    found: Floats = 0.5 * share * kappa * ratio / inverse * dilatation**2
    return found
