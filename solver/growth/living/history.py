"""Moments that a run can go back to, from each of which the way on is the same to the last bit."""

from __future__ import annotations

from typing import NamedTuple

from ..solids import Solid
from ..state import State
from ..stepping import Carried
from ..tooling.tools import Tool

__all__ = ["History", "Moment"]

#: Inverses that are kept, which are large but serve many steps each, and moments.
_INVERSES, _MOMENTS = 30, 500


class Moment(NamedTuple):
    """What stands before a step, and how many were done."""

    steps: int
    state: State
    tools: tuple[Tool, ...]
    solids: tuple[Solid, ...]
    carried: Carried


class History(list[Moment]):
    """The first moment and the latest ones, rising."""

    def remember(self, moment: Moment) -> None:
        """Keep one more, and let go what is long ago."""
        self.append(moment)
        seen: set[int] = set()
        for number in range(len(self) - 1, 0, -1):
            seen.add(id(self[number].carried.tangent.inverse))
            if len(seen) > _INVERSES or len(self) - number > _MOMENTS:
                del self[1 : number + 1]
                return

    def back_to(self, steps: int) -> list[Moment]:
        """Take out the moments after the last one before which at most so many steps were done, and that one too."""
        first = max((k for k, moment in enumerate(self) if moment.steps <= steps), default=len(self))
        taken = self[first:]
        del self[first:]
        return taken
