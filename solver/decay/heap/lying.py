"""How the fresh fruits of a heap lie: sizes from the seed, places and turns by falling, in a bowl or on a floor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...arrays import Bools, Floats
from ...contract import Context, InvalidInput
from ...resting import Body, Bowl, settle
from ..params import DecayParams
from ..surfaces.surface import lay
from .given import WALL
from .kinds import Lot

__all__ = ["Ground", "Lying", "lie", "separate"]

#: Facets of the shape that falls.
_CELLS = 12
#: Wider bowls tried for one that holds what fell beside, in times the radius; middles are to stay off the rim by
#: a tenth, as where the last one comes to lie hangs on last digits in a bowl that is just wide enough.
_WIDER, _ROOM = (1.1, 1.25, 1.5, 1.75, 2.0), 0.9
#: Times that fruits are thrown if one of ten falls beside at most: more would not fit another time either.
_THROWS = 6
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
        InvalidInput: a fruit fell beside the bowl, where there is no floor to lie on in this model; which bowl is wide
            enough is in the advice.

    """
    heap = params.heap
    assert heap is not None
    count = heap.count
    random = separate(params, 0)
    size = lot.scales * (1 + heap.spread * random.uniform(-1, 1, count))
    bowl = Bowl(heap.bowl, WALL) if heap.bowl else None
    ground = None if bowl is None else Ground(bowl.sphere + bowl.thickness, bowl.sphere)
    wider = None
    if heap.places:
        centre, turn = np.array(heap.places, float), np.tile(np.eye(3), (count, 1, 1))
    else:
        pour = _Pour(lot, size, random)
        centre, turn = pour.into(bowl)
        for _ in range(_THROWS - 1):
            if bowl is None or not 0 < (~_within(centre, bowl)).sum() <= max(count // 10, 1):
                break
            pour.seed = int(random.integers(2**31))
            centre, turn = pour.into(bowl)
        wider = pour.wider
    inside = np.zeros(count, np.bool_)
    if bowl is not None:
        inside = _within(centre, bowl)
        if not inside.all():
            raise InvalidInput(
                f"{int((~inside).sum())} of {count} fruits do not fit into a bowl of {heap.bowl:g} r1.",
                advice="Put places nearer to the middle, or take a wider bowl." if wider is None else wider(bowl),
            )
    return Lying(centre, turn, size, ground, inside.astype(float))


class _Pour:
    """Fruits of a lot, each with its `size` (b), that fall as `seed` says; the one after it is drawn from `random`."""

    def __init__(self, lot: Lot, size: Floats, random: np.random.Generator) -> None:
        self.seed = int(random.integers(2**31))
        # who falls first lies at the bottom: several kinds fall in any order
        self._order = random.permutation(len(size)) if lot.names else np.arange(len(size))
        self._shapes = [Body(lay(one, _CELLS).points) for one in lot.params]
        self._kinds, self._size = lot.kind[self._order].tolist(), size[self._order]

    def into(self, bowl: Bowl | None) -> tuple[Floats, Floats]:
        """Return centres (b, 3) and turns (b, 3, 3)."""
        rest = settle(self._shapes, self._kinds, self._size, bowl, self.seed)
        back = np.argsort(self._order)
        return rest.centre[back], _matrices(rest.turn[back])

    def wider(self, bowl: Bowl) -> str:
        """Return the advice to take a bowl that holds all, which is tried."""
        for opening in (round(times * bowl.opening, 1) for times in _WIDER):
            if _aside(self.into(Bowl(opening, WALL))[0]).max() < _ROOM * opening:
                return f"Take a bowl of {opening:g} r1, which holds them, or fewer fruits."
        return "Take a wider bowl, or fewer fruits."


def _aside(centre: Floats) -> Floats:
    """Return how far from the bowl's axis places (b, 3) are (b)."""
    return np.hypot(centre[:, 0], centre[:, 2])


def _within(centre: Floats, bowl: Bowl) -> Bools:
    """Return whether fruits at centres (b, 3) are in a bowl or heaped above it (b), not beside or under its wall."""
    aside, up = _aside(centre), centre[:, 1] - bowl.sphere - bowl.thickness
    hollow = np.hypot(aside, up) < bowl.sphere
    return np.asarray((aside < bowl.sphere) & (hollow | (centre[:, 1] > bowl.rim)))


def _matrices(quaternions: Floats) -> Floats:
    """Return rotations (b, 3, 3) of unit quaternions (b, 4: x, y, z, w)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
