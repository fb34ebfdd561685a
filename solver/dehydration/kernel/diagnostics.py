"""Energies and inversion checks in float64, element by element, from the same algebra as the forces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.dehydration.kernel.algebra import Number
from solver.dehydration.kernel.coupled import momentum
from solver.dehydration.kernel.elements import energy, least_ratio, one_point_energy
from solver.dehydration.kernel.fixed_point import positions
from solver.dehydration.kernel.layout import Layout

from ...arrays import Bools, Floats, Ints, Ints32, Singles

CHUNK = 64
"""Blocks handled at once, so that temporaries stay in cache."""


class NumpyArithmetic:
    """`algebra.Arithmetic` on numpy arrays, one entry per element."""

    def minimum(self, a: Number, b: Number | float) -> Number:
        """Smaller of each pair."""
        return np.minimum(a, b)

    def maximum(self, a: Number, b: Number | float) -> Number:
        """Larger of each pair."""
        return np.maximum(a, b)

    def inverse_cube_root(self, a: Number) -> Number:
        """a^(-1/3) to float64."""
        return 1.0 / np.cbrt(a)


class ElementReport(NamedTuple):
    """What each element holds and how far it is from turning inside out."""

    energy: Floats
    """(elements,): strain energy"""
    least_ratio: Floats
    """(elements,): least J/Jd over the integration points of the full rule; inverted where not positive"""


def _chunks(
    layout: Layout, state: Ints32, elements: Ints, planes: Singles
) -> Iterator[tuple[slice, list[list[Floats]], Floats]]:
    """(blocks, positions [8][3] of (n,), planes (planes, n)) of a few blocks at a time, float64."""
    for first in range(0, len(elements), CHUNK):
        part = slice(first, first + CHUNK)
        # A lane that only fills its vector has element -1: it computes the last element and is dropped later.
        corners = positions(state[layout.connectivity[elements[part].ravel()].ravel()]).reshape(-1, 8, 3)
        nodes = [[np.ascontiguousarray(corners[:, a, i]) for i in range(3)] for a in range(8)]
        yield part, nodes, planes[part].transpose(1, 0, 2).reshape(planes.shape[1], -1).astype(np.float64)


def _deep(layout: Layout) -> Bools:
    """(core blocks,) bool: blocks below the layout's full levels."""
    deep = np.zeros(len(layout.core_elements), bool)
    for _, first, cores, _, _ in layout.strips:
        deep[first : first + max(cores - layout.full_levels, 0)] = True
    return deep


def element_report(layout: Layout, state: Ints32, theta: float, *, one_point: bool = False) -> ElementReport:
    """Strain energy and least J/Jd of every element; state (nodes, 4) int32, see `fixed_point`.

    With `one_point` the energy of the deep core is the one-point element's; the ratio is always that of the full rule.
    """
    arithmetic = NumpyArithmetic()
    results: list[tuple[Floats, Floats]] = []
    for exocarp in (False, True):
        elements = layout.exocarp_elements if exocarp else layout.core_elements
        planes = layout.exocarp_planes if exocarp else layout.core_planes
        energies, ratios = np.empty(elements.shape), np.empty(elements.shape)
        factor = 1.0 if exocarp else theta
        for part, nodes, stored in _chunks(layout, state, elements, planes):
            shape = elements[part].shape
            total, least = energy(arithmetic, nodes, stored.__getitem__, np.float64(factor), exocarp)
            energies[part], ratios[part] = total.reshape(shape), least.reshape(shape)
        if one_point and not exocarp:
            deep = np.flatnonzero(_deep(layout))
            for part, nodes, stored in _chunks(layout, state, elements[deep], layout.one_point_planes[deep]):
                total = one_point_energy(arithmetic, nodes, stored.__getitem__, np.float64(theta))
                energies[deep[part]] = total.reshape(energies[deep[part]].shape)
        results.append((energies, ratios))
    (core_energy, core_ratio), (skin_energy, skin_ratio) = results
    return ElementReport(layout.lanes(core_energy, skin_energy), layout.lanes(core_ratio, skin_ratio))


def least_ratios(layout: Layout, state: Ints32, theta: float) -> Floats:
    """The `least_ratio` of `element_report` alone, (elements,), in three fifths of its time."""
    arithmetic = NumpyArithmetic()
    found: list[Floats] = []
    for exocarp, elements, planes in (
        (False, layout.core_elements, layout.core_planes),
        (True, layout.exocarp_elements, layout.exocarp_planes),
    ):
        ratios, factor = np.empty(elements.shape), np.float64(1.0 if exocarp else theta)
        for part, nodes, stored in _chunks(layout, state, elements, planes):
            least = least_ratio(arithmetic, nodes, stored.__getitem__, factor, exocarp)
            ratios[part] = least.reshape(elements[part].shape)
        found.append(ratios)
    return layout.lanes(*found)


def strain_energy(layout: Layout, state: Ints32, theta: float, *, one_point: bool = False) -> float:
    """Total strain energy."""
    return float(element_report(layout, state, theta, one_point=one_point).energy.sum())


def kinetic_energy(layout: Layout, velocity: NDArray[np.floating]) -> float:
    """Kinetic energy of the scaled masses; velocity (nodes, 3 or 4), displacement per step."""
    doubled = (velocity[:, :3] * momentum(layout, velocity)).sum(axis=1)
    return float(0.5 * np.sum(np.where(layout.free, doubled, 0.0)))
