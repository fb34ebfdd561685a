"""Parameters that are fine each and do not go together: what is wrong, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .params import DecayParams

__all__ = ["contradiction"]

#: Halves of a mesh's longest side [r1] within which wounds, spores and depths, which are lengths in r1, mean something.
_HALF = (0.2, 20.0)


def contradiction(params: DecayParams) -> str:
    """Return what of the parameters contradicts what else, and what to change; nothing if they go together."""
    return _of_mesh(params) or _of_heap(params) or _of_cuts(params) or _of_oven(params)


def _half(params: DecayParams) -> float:
    """Return half of the longest side of the mesh [r1], 0 without one or where it is all in one place."""
    if params.mesh is None:
        return 0.0
    points = np.array(params.mesh.points)
    return float((points.max(axis=0) - points.min(axis=0)).max()) / 2


def _of_mesh(params: DecayParams) -> str:
    count = len(params.mesh.points) if params.mesh else 0
    for wound in params.wounds:
        if wound.vertex is not None and wound.vertex >= count:
            where = (
                f"the mesh has vertices 0 to {count - 1}" if count else "only an imported mesh has numbered vertices"
            )
            return f"a wound names vertex {wound.vertex}: {where}"
    half = _half(params)
    if half and not _HALF[0] <= half <= _HALF[1]:
        return (
            f"half of the mesh's longest side is {half:.3g}, and lengths are in r1, a fruit's radius, which weight and "
            f"volume make so many millimetres: multiply its points by {1 / half:.3g}"
        )
    if params.mesh is not None and params.body == "table":
        return "the table of dried fruits knows no imported mesh: take body=quasi-static, not table"
    if params.mesh is not None and params.seeds == "contacts":
        return "an imported mesh has neither stem nor floor: take seeds=wounds"
    return ""


def _of_heap(params: DecayParams) -> str:
    if params.heap is None:
        return ""
    if params.mesh is not None or params.neighbours:
        return "the fruits of a heap are each other's neighbours: leave mesh and neighbours out"
    if params.within is not None:
        return "the fruits of a heap have no fields in their flesh: leave within out"
    if params.skin is not None or params.body not in ("none", "quasi-static"):
        return "the fruits of a heap have body=none or quasi-static, and no skin that wrinkles"
    if params.pressure or params.pressure_map is not None or params.march is not None:
        return "a heap takes no pressure, and heap.step is its march"
    return ""


def _of_cuts(params: DecayParams) -> str:
    if not params.cuts:
        return ""
    if params.heap is not None or params.body == "table":
        return "neither a heap nor the table of dried fruits knows cut fruits: leave cuts out"
    if params.skin is not None:
        return "a cut fruit's skin does not wrinkle: leave skin out"
    if params.seeds == "contacts" or any(wound.vertex is not None for wound in params.wounds):
        return "a cut fruit takes wounds by angles or positions: leave seeds and vertices out"
    return ""


def _of_oven(params: DecayParams) -> str:
    if params.oven is not None and params.within is None:
        return "heat goes into flesh that has fields of its own: give within, {} will do"
    if params.oven is not None and (params.heap is not None or params.weather or params.march is not None):
        return "an oven holds one fruit in one air: leave heap, weather and march out"
    return ""
