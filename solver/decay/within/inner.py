"""The flesh's fields beside the body that moves: what its tetrahedra are given of them, and where their points go."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...arrays import Floats, Ints32
from ...geometry.tetrahedra import within
from .joint import Joint

if TYPE_CHECKING:
    from ..body.body import Body
    from ..body.equilibrium import Balance

__all__ = ["Held", "Inner"]


class Held(NamedTuple):
    """On the points of a body (p): rot, 0 to 1, and water over the fresh one."""

    rot: Floats
    wet: Floats


class Inner:
    """Flesh and core (q points) of one medium with its skin, in a body that moves, or in one that stays as it is."""

    def __init__(self, joint: Joint, body: Body | None) -> None:
        self._joint, self._body = joint, body
        self._above = len(joint.cover.points)
        self._points = np.concatenate([joint.flesh, joint.core])
        if body is not None:
            self._given = within(joint.flesh, joint.tets, body.solid.points)
            self._moved = within(body.solid.points, body.solid.tets, self._points)

    @property
    def cells(self) -> Ints32:
        """Tetrahedra (t, 4) of flesh and core."""
        return self._joint.cells.astype(np.int32)

    def held(self, rot: Floats, wet: Floats) -> Held:
        """Return what a body holds of fields (n) of the medium."""
        return Held(self._given @ rot[self._above :], self._given @ wet[self._above :])

    @property
    def joint(self) -> Joint:
        """The medium."""
        return self._joint

    def of(self, field: Floats, core: float) -> Floats:
        """Return a field (n) of the medium in the flesh and, as one number, in the core (q)."""
        return np.concatenate([field[self._above :], np.full(len(self._joint.core), core)])

    def positions(self, balance: Balance | None) -> Floats:
        """Return where the points (q, 3) of flesh and core are."""
        if self._body is None or balance is None:
            return self._points
        moved = self._points + self._moved @ (balance.points - self._body.solid.points)
        return self._body.obstacles.laid(moved)
