"""Where every individual of a scene is: arrays over all instances, from transforms or by a rule."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from solver import resting
from solver.arrays import Array, Floats
from solver.contract import SolverError

from ..errors import Wrong
from ..limits import waited
from .errors import InvalidScene
from .kinds import Kind
from .request import Place, Scene
from .scattering import scatter

__all__ = ["Instances", "bowl_of", "place"]

#: Share of a heaped bowl's room that fruits fill, and how much higher than its rim they may heap.
_FILLED, _HEAPED = 0.55, 1.6
#: A bowl is no larger than so many of the largest fruits in it, which would fall for ever, and no smaller than this
#: [scene unit]: numbers end somewhere.
_LOST, _SMALLEST = 1e4, 1e-9
#: How often somebody looks who waits for a heap that another one pours [s].
_LOOK = 0.2


class Instances(NamedTuple):
    """All individuals: item and kind by number (b), centre (b, 3), quaternion (b, 4; x, y, z, w), scale [scene unit of
    r1] (b), and whether it is the mirror image across x (b).
    """

    item: Array
    kind: Array
    centre: Floats
    turn: Floats
    scale: Floats
    mirrored: Array

    def only(self, which: Array) -> Instances:
        """Return some of them."""
        return Instances(*(values[which] for values in self))


def place(
    scene: Scene, kinds: Sequence[Kind], rows: Sequence[Sequence[int]]
) -> tuple[Instances, dict[str, resting.Rest]]:
    """Return where all individuals are, and how the piles and bowls came to rest.

    Raises:
        InvalidScene: a place is too small for what it is to hold.

    """
    counts = np.array([item.instances for item in scene.items])
    item = np.repeat(np.arange(len(counts)), counts)
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    own = np.array([len(row) for row in rows])
    start = np.concatenate([[0], np.cumsum(own)[:-1]])
    kind = np.array([k for row in rows for k in row])[(start[item] + (np.arange(len(item)) - first[item]) % own[item])]
    named = [one.size for one in scene.items]
    sizes = [
        size if isinstance(size, float) else _size(size, kinds[row[0]], scene.unit)
        for size, row in zip(named, rows, strict=True)
    ]
    scale = np.repeat(sizes, counts).astype(float)
    centre = np.zeros((len(item), 3))
    members: dict[str, list[Array]] = {one.name: [] for one in scene.places}
    seeds = np.array([-1 if one.seed is None else one.seed for one in scene.items])[item]
    turn, mirrored, share = _individuals(seeds, np.arange(len(item)) - first[item])
    scale *= 1 + np.array([one.vary for one in scene.items])[item] * share
    which = np.array([bool(one.transforms) for one in scene.items])[item]
    if which.any():
        given = [t for one in scene.items for t in one.transforms]
        centre[which] = [t.position for t in given]
        rotation = np.array([t.rotation for t in given])
        rotation /= np.linalg.norm(rotation, axis=1)[:, None]
        turn[which] = _product(rotation, turn[which])
        scale[which] *= [t.scale for t in given]
    for i, one in enumerate(scene.items):
        if one.place is not None:
            members[one.place].append(np.arange(first[i], first[i] + counts[i]))
    found = Instances(item, kind, centre, turn, scale, mirrored)
    rests = {}
    for i, rule in enumerate(scene.places):
        which = np.concatenate(members[rule.name]) if members[rule.name] else np.zeros(0, int)
        if not len(which):
            continue
        try:
            rest = _RULES[rule.rule](rule, found.only(which), kinds)
        except SolverError as error:
            raise InvalidScene.of([Wrong(f"places.{i}", error.message.rstrip("."), error.advice)]) from None
        except ValueError as error:
            raise InvalidScene.of([Wrong(f"places.{i}.{'mesh' if rule.mesh else 'radius'}", str(error), "")]) from None
        if not (np.isfinite(rest.centre).all() and np.isfinite(rest.turn).all()):
            advice = "Take sizes that are more alike, and neither tiny nor huge."
            raise InvalidScene.of([Wrong(f"places.{i}", "numbers end before such things lie anywhere", advice)])
        centre[which] = rest.centre + rule.at
        turn[which] = rest.turn
        rests[rule.name] = rest
    return found, rests


def _size(asked: str | None, kind: Kind, unit: float) -> float:
    """Return the length of a kind's own unit [scene unit]; that of tables is one unless the real one is asked for."""
    known = kind.metres if asked is not None or kind.topology is not None else None
    return 1.0 if known is None else known / unit


def _individuals(seeds: Array, numbers: Array) -> tuple[Floats, Array, Floats]:
    """Return turns (b, 4), mirrorings (b) and -1 to 1 for sizes (b) of individuals by seed and number; -1: as stored.

    Numbers come from a hash of both (splitmix64): a generator for each item would take longer than all else about it.
    """
    state = seeds.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + numbers.astype(np.uint64) * np.uint64(
        0xD1B54A32D192ED03
    )
    u = np.empty((5, len(seeds)))
    for k in range(5):
        state = state + np.uint64(0x9E3779B97F4A7C15)
        z = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        u[k] = ((z ^ (z >> np.uint64(31))) >> np.uint64(11)).astype(float) * 2.0**-53
    # uniform over all turns (Shoemake 1992)
    a, b, p, q = np.sqrt(1 - u[0]), np.sqrt(u[0]), 2 * np.pi * u[1], 2 * np.pi * u[2]
    turn = np.stack([a * np.sin(p), a * np.cos(p), b * np.sin(q), b * np.cos(q)], axis=1)
    alike = seeds < 0
    turn[alike] = [0.0, 0.0, 0.0, 1.0]
    return turn, (u[3] < 0.5) & ~alike, np.where(alike, 0.0, 2 * u[4] - 1)


def _product(a: Floats, b: Floats) -> Floats:
    """Return quaternions a b, rows of x, y, z, w."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    real = a[:, 3] * b[:, 3] - np.einsum("ij,ij->i", a[:, :3], b[:, :3])
    return np.concatenate([vector, real[:, None]], axis=1)


def _reach(found: Instances, kinds: Sequence[Kind]) -> Floats:
    outer = np.array([kinds[k].reach[1] if k in set(found.kind) else 0.0 for k in range(len(kinds))])
    return np.asarray(outer[found.kind] * found.scale)


def _lowest(found: Instances, kinds: Sequence[Kind]) -> Floats:
    """Return how far each individual reaches below its centre, as it is turned."""
    down = np.array([[0.0, -1.0, 0.0]])
    back = found.turn * [-1, -1, -1, 1]
    vector = np.repeat(down, len(back), axis=0)
    cross = 2 * np.cross(back[:, :3], vector)
    local = vector + back[:, 3:] * cross + np.cross(back[:, :3], cross)
    local[:, 0] *= np.where(found.mirrored, -1, 1)
    return np.array([(kinds[k].outline @ d).max() for k, d in zip(found.kind, local, strict=True)]) * found.scale


def _row(rule: Place, found: Instances, kinds: Sequence[Kind]) -> resting.Rest:
    """Stand them in a row along x on the floor."""
    reach = _reach(found, kinds)
    x = np.cumsum(2 * reach + rule.gap) - reach
    centre = np.stack([x - 0.5 * (x[-1] + reach[-1]), _lowest(found, kinds), np.zeros(len(x))], axis=1)
    return resting.Rest(centre, found.turn, 0.0, True)


def _scatter(rule: Place, found: Instances, kinds: Sequence[Kind]) -> resting.Rest:
    """Scatter them over a mesh, or a square of the floor: a lattice of cells, one in each, jittered as far as cells
    allow.
    """
    if rule.mesh is not None:
        return scatter(rule.mesh, rule.seed, found, kinds)
    assert rule.radius is not None
    random, reach = np.random.default_rng(rule.seed), _reach(found, kinds)
    count = len(reach)
    side = math.ceil(math.sqrt(count))
    cell = 2 * rule.radius / side
    need = 2 * float(reach.max())
    if cell < need:
        raise ValueError(f"{count} fruits up to {need:.3g} across need a radius of {0.5 * need * side:.3g} or more")
    place = random.permutation(side * side)[:count]
    loose = 0.5 * cell - reach
    x, z = ((index + 0.5) * cell - rule.radius for index in np.divmod(place, side))
    x, z = (values + random.uniform(-1, 1, count) * loose for values in (x, z))
    return resting.Rest(np.stack([x, _lowest(found, kinds), z], axis=1), found.turn, 0.0, True)


def bowl_of(rule: Place) -> resting.Bowl:
    """Return the bowl of a place."""
    assert rule.radius is not None
    return _bowl(rule.radius)


def _bowl(radius: float) -> resting.Bowl:
    return resting.Bowl(radius, 0.05 * radius)


def _pour(rule: Place, found: Instances, kinds: Sequence[Kind]) -> resting.Rest:
    """Pour them; the result is kept, so that another camera or budget waits for no pile."""
    bowl = bowl_of(rule) if rule.rule == "bowl" else None
    if bowl is not None:
        _check_bowl(bowl, _reach(found, kinds))
    used, kind = np.unique(found.kind, return_inverse=True)
    # the mirror image is a body of its own
    number = 2 * kind + found.mirrored
    shapes = tuple(_Told(kinds[k], mirrored) for k in used for mirrored in (False, True))
    return _heap(shapes, number.tobytes(), found.scale.tobytes(), bowl, rule.seed).rest()


def _check_bowl(bowl: resting.Bowl, reach: Floats) -> None:
    """Refuse a bowl that what lies in it heaps over, or is lost in.

    Raises:
        ValueError: it says how wide a bowl is to be.

    """
    # of a bowl that is 1 wide: lengths may be so small that their cubes are none
    one, size = _bowl(1.0), float(reach.max())
    high = one.rim - one.thickness
    room = math.pi * high**2 * (one.sphere - high / 3)
    volume = 4 / 3 * math.pi * float(((reach / size) ** 3).sum())
    least = size * (volume * _FILLED / (_HEAPED * room)) ** (1 / 3)
    if least > bowl.opening:
        raise ValueError(f"{len(reach)} fruits heap over a bowl of {bowl.opening:g}: take {least:.3g} or more")
    if bowl.opening < _SMALLEST:
        raise ValueError(f"a bowl of {bowl.opening:g} is too small for numbers: take another unit of length")
    if bowl.opening > _LOST * size:
        said = f"fruits up to {2 * size:.3g} across are lost in a bowl of {bowl.opening:g}"
        raise ValueError(f"{said}: take {_LOST * size:.3g} or less")


class _Told:
    """A body that is equal to another one of the same content."""

    def __init__(self, kind: Kind, mirrored: bool) -> None:
        self.key = (kind.identity, mirrored)
        surface = kind.body.surface
        self.body = resting.Body(surface * [-1, 1, 1] if mirrored else surface)

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Told) and other.key == self.key


class _Heap:
    """Bodies that are poured, by whoever asks for them first, as long as somebody waits."""

    def __init__(self, pouring: resting.Pouring, order: Array) -> None:
        self._pouring, self._back = pouring, np.argsort(order)
        self._lock = threading.Lock()

    def rest(self) -> resting.Rest:
        """Return how they rest.

        Raises:
            TimedOut: nobody waits any more; what was computed is kept for whoever asks again.

        """
        while not self._lock.acquire(timeout=_LOOK):
            waited.check()  # another request pours the same ones
        try:
            rest = self._pouring.rest(self._check)
        finally:
            self._lock.release()
        return rest._replace(centre=rest.centre[self._back], turn=rest.turn[self._back])

    def _check(self) -> None:
        done = f"{len(self._back)} fruits are {self._pouring.share:.0%} of their longest way to rest"
        waited.check(f"{done}, and go on from there: ask again.")


@lru_cache(maxsize=16)
def _heap(shapes: tuple[_Told, ...], number: bytes, scale: bytes, bowl: resting.Bowl | None, seed: int) -> _Heap:
    order = np.random.default_rng(seed).permutation(len(scale) // 8)
    kinds, sizes = np.frombuffer(number, np.int64)[order], np.frombuffer(scale)[order]
    return _Heap(resting.Pouring([one.body for one in shapes], kinds.tolist(), sizes, bowl, seed), order)


_RULES = {"row": _row, "scatter": _scatter, "bowl": _pour, "pile": _pour}
