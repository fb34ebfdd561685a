"""How the fresh fruits of a heap lie: sizes from the seed, places and turns by falling, in a bowl or on a floor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Floats
from ...contract import Context, InvalidInput
from ...resting import Body, Bowl, settle
from ..params import DecayParams
from ..surfaces.surface import lay
from .given import WALL
from .kinds import Lot

__all__ = ["Ground", "Lying", "lie", "separate"]

#: Facets of the shape that falls.
_CELLS = 12
#: Of the generator's children, which one throws the fruits; the first four are a single fruit's own.
_STREAM = 7


class Ground(NamedTuple):
    """What carries a heap: a floor y = 0, or for fruits in a bowl the inside of a sphere (centre's height, radius)."""

    height: float
    radius: float


class Lying(NamedTuple):
    """Centres (b, 3) [r1], turns (b, 3, 3) from a fruit's own frame to the heap's, sizes (b), and what carries them.

    ground: None is the floor. inside (b): whether a fruit lies in the bowl and not beside it.
    """

    centre: Floats
    turn: Floats
    size: Floats
    ground: Ground | None
    inside: Floats


def separate(params: DecayParams, stream: int) -> np.random.Generator:
    """Return a generator of the heap's own; streams do not depend on each other."""
    seeds = np.random.SeedSequence(params.seed, spawn_key=(_STREAM, stream))
    return Context.generator(int(seeds.generate_state(1, np.uint64)[0]))


def lie(params: DecayParams, lot: Lot) -> Lying:
    """Return how the heap of the parameters lies before it decays; lot: its kinds, which are thrown together.

    Raises:
        InvalidInput: a fruit fell beside the bowl, where there is no floor to lie on in this model.

    """
    heap = params.heap
    assert heap is not None
    count = heap.count
    random = separate(params, 0)
    size = lot.scales * (1 + heap.spread * random.uniform(-1, 1, count))
    bowl = Bowl(heap.bowl, WALL) if heap.bowl else None
    ground = None if bowl is None else Ground(bowl.sphere + bowl.thickness, bowl.sphere)
    if heap.places:
        centre, turn = np.array(heap.places, float), np.tile(np.eye(3), (count, 1, 1))
    else:
        shapes = [Body(lay(one, _CELLS).points) for one in lot.params]
        seed = int(random.integers(2**31))
        # who falls first lies at the bottom: several kinds fall in any order
        order = random.permutation(count) if lot.names else np.arange(count)
        rest = settle(shapes, lot.kind[order].tolist(), size[order], bowl, seed)
        back = np.argsort(order)
        centre, turn = rest.centre[back], _matrices(rest.turn[back])
    inside = np.zeros(count, np.bool_)
    if ground is not None and bowl is not None:
        aside = np.hypot(centre[:, 0], centre[:, 2])
        inside = aside < bowl.sphere
        if not inside.all():
            raise InvalidInput(
                f"{int((~inside).sum())} of {count} fruits do not fit into a bowl of {heap.bowl:g} r1.",
                advice="Take fewer fruits, or a wider bowl.",
            )
    return Lying(centre, turn, size, ground, inside.astype(float))


def _matrices(quaternions: Floats) -> Floats:
    """Return rotations (b, 3, 3) of unit quaternions (b, 4: x, y, z, w)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
