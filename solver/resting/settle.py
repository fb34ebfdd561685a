"""Bodies poured onto a floor or into a bowl, until they rest on each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..arrays import Floats
from ..contract import InvalidInput
from ..lattice import azimuths, colatitudes, directions
from . import kernel, near

__all__ = ["MOST", "Body", "Bowl", "Pouring", "Rest", "radii", "settle"]

#: Most bodies of one pile: each is held against all others.
MOST = 1500
_DIRECTIONS, _POINTS = 24, 12
_STEP, _FRICTION = 0.02, 0.5
#: Speed below which a pile is at rest, where gravity and the mean radius are 1.
_STILL = 0.02
_BATCH, _LONGEST = 100, 40
#: Bodies begin no farther from the middle than so many of the widest: all of a pile have room there, layer by layer.
_WIDEST = 64
#: Of so many bodies, a few always creep: such a heap is done when all but a hundredth have moved more slowly than this
#: for a batch. Overlaps are then what they are at the end of the longest way (1,000 raisins: .031 in the mean, both).
_MANY, _CREEP = 300, 0.12


class Body(NamedTuple):
    """A shape: points (v, 3) of its surface about its centre."""

    surface: Floats


class Bowl(NamedTuple):
    """A part of a spherical shell that opens upwards, standing on the floor: radius of its opening, and thickness."""

    opening: float
    thickness: float

    @property
    def sphere(self) -> float:
        """Radius of the inner sphere."""
        return 1.12 * self.opening

    @property
    def rim(self) -> float:
        """Height of the rim over the floor."""
        return self.sphere + self.thickness - float(np.sqrt(self.sphere**2 - self.opening**2))


class Rest(NamedTuple):
    """Where bodies came to rest: centres (b, 3) and quaternions (b, 4: x, y, z, w); y is up, the floor y = 0.

    speed: the largest, in units of the square root of gravity times mean radius. still: whether that is rest.
    """

    centre: Floats
    turn: Floats
    speed: float
    still: bool


def radii(body: Body) -> Floats:
    """Return the outer radius (n, 2n) of a body by direction: of a fold, the outermost."""
    n = _DIRECTIONS
    r = np.linalg.norm(body.surface, axis=1)
    row = np.clip(np.arccos(np.clip(body.surface[:, 1] / r, -1, 1)) / np.pi * n, 0, n - 1).astype(int)
    column = (np.arctan2(body.surface[:, 2], body.surface[:, 0]) / np.pi * n).round().astype(int) % (2 * n)
    table = np.zeros((n, 2 * n))
    np.maximum.at(table, (row, column), r)
    while not table.all():
        # directions that no point has: as far as their neighbours
        padded = np.pad(np.pad(table, ((1, 1), (0, 0)), mode="edge"), ((0, 0), (1, 1)), mode="wrap")
        around = np.stack([padded[a : a + n, b : b + 2 * n] for a in range(3) for b in range(3)])
        found = around.sum(axis=0) / np.maximum((around > 0).sum(axis=0), 1)
        table = np.where(table > 0, table, found)
    return table


def settle(bodies: Sequence[Body], kinds: Sequence[int], sizes: Floats, bowl: Bowl | None, seed: int) -> Rest:
    """Pour bodies, `kinds` of `bodies` by number, each `sizes` large, and return how they rest.

    Raises:
        InvalidInput: there are too many for one pile.

    """
    return Pouring(bodies, kinds, sizes, bowl, seed).rest()


class Pouring:
    """Bodies on their way: what was computed stays where somebody stops waiting, and goes on from there."""

    def __init__(
        self, bodies: Sequence[Body], kinds: Sequence[int], sizes: Floats, bowl: Bowl | None, seed: int
    ) -> None:
        """Place bodies, `kinds` of `bodies` by number, each `sizes` large, above the floor or the bowl.

        Raises:
            InvalidInput: there are too many for one pile.

        """
        count = len(kinds)
        if count > MOST:
            raise InvalidInput(
                f"{count} bodies are more than {MOST} of one pile.", advice=f"Make several piles of at most {MOST}."
            )
        random = np.random.default_rng(seed)
        tables = np.stack([radii(body) for body in bodies])
        ways = directions(*np.meshgrid(colatitudes(_POINTS), azimuths(_POINTS), indexing="ij")).reshape(-1, 3)
        ways = np.concatenate([ways, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
        points = np.stack([ways * _along(table, ways)[:, None] for table in tables])
        kind = np.asarray(kinds)
        reach = tables.max(axis=(1, 2))[kind] * sizes
        mean = np.sqrt((tables**2).mean(axis=(1, 2)))[kind] * sizes
        self._unit = unit = float(mean.mean())
        scale, mass = sizes / unit, (mean / unit) ** 3
        shell = np.zeros(3) if bowl is None else np.array([bowl.sphere, bowl.thickness, bowl.rim]) / unit
        self._at = _poured(reach / unit, 0.0 if bowl is None else bowl.opening / unit, shell, random)
        self._turn = random.standard_normal((count, 4))
        self._turn /= np.linalg.norm(self._turn, axis=1)[:, None]
        self._speed, self._spin = np.zeros((count, 3)), np.zeros((count, 3))
        inertia = 0.4 * mass * (mean / unit) ** 2
        self._fixed = kind, scale, tables, points, reach / unit, mass, inertia, shell
        self._batch, self._fastest, self._drag = 0, float("inf"), 0.05
        self._found: Rest | None = None

    @property
    def centre(self) -> Floats:
        """Where bodies are (b, 3)."""
        return self._at * self._unit

    @property
    def share(self) -> float:
        """Share of the longest way to rest that is behind."""
        return 1.0 if self._found else self._batch / _LONGEST

    def rest(self, check: Callable[[], None] = lambda: None) -> Rest:
        """Return how they rest; `check` is called now and then, and may raise what ends the wait."""
        while self._found is None:
            check()
            self.advance()
        return self._found

    def advance(self) -> None:
        """Go on by a batch of steps, also where they rest already."""
        before = self._at.copy()
        self._fastest = kernel.step(
            self._at, self._turn, self._speed, self._spin, *self._fixed, _STEP, self._drag, _FRICTION, _BATCH
        )
        batch, self._batch = self._batch, self._batch + 1
        moved = np.linalg.norm(self._at - before, axis=1) / (_BATCH * _STEP)
        creeps = len(moved) >= _MANY and np.quantile(moved, 0.99) < _CREEP
        if (batch > 6 and (self._fastest < _STILL or creeps)) or self._batch == _LONGEST:
            still = bool(self._fastest < _STILL)
            self._found = Rest(self._at * self._unit, self._turn, float(self._fastest), still)
        elif batch > 10:
            # thicker air, but never so thick that what falls in it would seem to rest
            self._drag = min(1.3 * self._drag, 1.0)


def _along(table: Floats, ways: Floats) -> Floats:
    return np.array([near.radius_at(table, x, y, z, 1.0) for x, y, z in ways])


def _poured(reach: Floats, opening: float, shell: Floats, random: np.random.Generator) -> Floats:
    """Return centres above the floor, layer by layer, in which no body touches another or the bowl's `shell`: radius
    of its inner sphere, thickness, and height of its rim.
    """
    cell = 2.05 * float(reach.max())
    wide = max(opening * 0.7 if opening else 0.75 * cell * len(reach) ** (1 / 3), 0.5 * cell)
    wide = min(wide, _WIDEST * cell)
    span = np.arange(-int(wide / cell), int(wide / cell) + 1) * cell
    x, z = (grid.ravel() for grid in np.meshgrid(span, span))
    inside = np.hypot(x, z) <= wide
    x, z = x[inside], z[inside]
    layer, place = np.divmod(np.arange(len(reach)), len(x))
    angle = layer * 0.7
    cos, sin = np.cos(angle), np.sin(angle)
    first = cell if not opening else float(shell[2])
    # what begins in the wall is thrown out of the bowl: then all begin above the rim
    if opening and np.hypot(np.hypot(x, z).max(), first - shell[0] - shell[1]) + 0.53 * cell > shell[0]:
        first += 0.53 * cell
    found = np.stack([x[place] * cos - z[place] * sin, first + layer * cell, x[place] * sin + z[place] * cos], axis=1)
    return found + random.uniform(-0.02, 0.02, found.shape) * cell
