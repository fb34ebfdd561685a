"""Which fruits lie in a heap: parameters, surface and size of each kind, and which species can live on which.

A kind has of its preset what belongs to a fruit: shape, weight, water, skin, firmness, its own species and its looks.
All else is the heap's: air, flesh's laws, seed. Lengths are in r1 of the parameters' own fruit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ..environment import reference_radius
from ..fields.skin import laid
from ..params import DecayParams
from ..presets import FRUITS, SPECIES
from ..surfaces.surface import Extent, Surface, extent

__all__ = ["Lot", "lives", "sorted_out"]

#: What belongs to a fruit and not to where it lies.
_OWN = frozenset(name for values in FRUITS.values() for name in values)
#: Fruits that a species rots where it comes to them; sources in docs/decay.md.
_HOSTS = {
    "penicillium-expansum": {"apple", "pear", "peach", "tomato"},
    "penicillium-digitatum": {"orange"},
    "neofabraea": {"apple", "pear"},
    "rhizopus": {"pear", "peach", "tomato"},
}


class Lot(NamedTuple):
    """The kinds (k) of a heap and the fruits (b) of each.

    names: presets, empty where all are the parameters' own fruit. params, surfaces: of a fruit of each kind alone.
    scale (k): r1 over the heap's. extents: in r1 of its own. kind (b): of each fruit. unit: the heap's r1 [m].
    """

    names: tuple[str, ...]
    params: tuple[DecayParams, ...]
    surfaces: tuple[Surface, ...]
    extents: tuple[Extent, ...]
    scale: Floats
    kind: Ints
    unit: float

    @property
    def scales(self) -> Floats:
        """Sizes (b) of each fruit's kind."""
        return self.scale[self.kind]


def of_kind(params: DecayParams, preset: str) -> DecayParams:
    """Return the parameters of one fruit of a preset in the air and under the rules of others."""
    values = DecayParams.parse(FRUITS[preset])
    update: dict[str, Any] = {name: getattr(values, name) for name in _OWN}
    return params.model_copy(update=update)


def sorted_out(params: DecayParams, single: DecayParams, cells: int) -> Lot:
    """Return the kinds of a heap; single: the parameters' own fruit alone, and without its wounds."""
    heap = params.heap
    assert heap is not None
    names = tuple(kind.preset for kind in heap.kinds)
    each = tuple(of_kind(single, name) for name in names) or (single,)
    extents = tuple(extent(one) for one in each)
    own = reference_radius(single, extent(single))
    scale = np.array([reference_radius(one, size) / own for one, size in zip(each, extents, strict=True)])
    many = [kind.fruits for kind in heap.kinds] or [heap.count]
    surfaces = tuple(laid(one, cells) for one in each)
    return Lot(names, each, surfaces, extents, scale, np.repeat(np.arange(len(each)), many), own)


def lives(lot: Lot, of: int, on: int) -> bool:
    """Return whether the species of a kind can live on a fruit of another; each lives on its own."""
    if of == on or not lot.names:
        return True
    host = lot.names[on].partition("-")[0]
    return host in _HOSTS[SPECIES[lot.names[of]]]
