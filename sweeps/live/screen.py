"""What a client sees of a live engine: frames at a pace that it keeps up with, and which inputs they hold."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

from solver.meshes import Frame

from .frames import EXACT, MORE, UNDERWAY, Encoder, Told

__all__ = ["Screen"]

#: Frames that a client may have without having said that it took them in.
_WINDOW = 2
#: Seconds between two frames at rest, and from the last frame, or the step's begin, to one of a shape on its way.
_BETWEEN, _UNDERWAY = 1 / 45, 1 / 80


class _Waiting(NamedTuple):
    """An input that the geometry holds at a stage; processor time when it was taken [s]; whether it was shown."""

    stage: float
    id: int
    taken: float
    seen: bool = False


class Screen:
    """Frames for one client, when it may have them."""

    def __init__(self, show: Callable[[bytes], None]) -> None:
        """Begin; `show` takes frames."""
        self._show = show
        self._encoder = Encoder()
        self._unseen: set[int] = set()
        self._waiting: list[_Waiting] = []
        #: When the last frame was sent, and whether it was of a shape on its way.
        self._sent, self._was_underway = 0.0, False
        self._begun = 0.0
        self._input = 0

    def forget(self) -> None:
        """Take it that the client holds nothing."""
        self._encoder.forget()
        self._unseen.clear()

    def seen(self, number: object) -> None:
        """The client has taken a frame in."""
        if isinstance(number, int):
            self._unseen.discard(number)

    def all_seen(self) -> None:
        """Nobody looks on: what was sent keeps nothing up."""
        self._unseen.clear()

    def wait(self, number: int, stage: float) -> None:
        """An input was taken that the geometry will hold at a stage."""
        self._waiting.append(_Waiting(stage, number, time.process_time()))

    def give_up(self) -> int | None:
        """Wait for no input any more; return the last one that was waited for."""
        last = max((w.id for w in self._waiting), default=None)
        self._waiting.clear()
        return last

    def begin(self) -> None:
        """A step begins."""
        self._begun = time.monotonic()

    @property
    def may_show(self) -> bool:
        """Whether a frame at rest may be sent now."""
        return len(self._unseen) < _WINDOW and (self._was_underway or time.monotonic() - self._sent >= _BETWEEN)

    @property
    def may_glimpse(self) -> bool:
        """Whether a frame of a shape on its way may be sent now: where steps are short there are none."""
        return len(self._unseen) < _WINDOW and time.monotonic() - max(self._sent, self._begun) >= _UNDERWAY

    def rest(self, frame: Frame, stage: float, residual: float, exact: bool, rough: bool) -> None:
        """Send a frame in equilibrium. rough: to half a quantum, more is to come."""
        held = [w for w in self._waiting if w.stage <= stage + 1e-9]
        self._waiting = [w for w in self._waiting if w.stage > stage + 1e-9]
        self._input = max((w.id for w in held), default=self._input)
        flags = (EXACT if exact else 0) | (MORE if rough else 0)
        self._send(frame, Told(stage, residual, self._input, _spent(held), flags), not rough)

    def glimpse(self, frame: Frame, stage: float, residual: float) -> None:
        """Send a frame of a shape on its way to a stage."""
        held = [w for w in self._waiting if w.stage <= stage + 1e-9]
        new = [w for w in held if not w.seen]
        self._waiting = [w._replace(seen=w.seen or w in new) for w in self._waiting]
        last = max((w.id for w in held), default=self._input)
        self._send(frame, Told(stage, residual, last, _spent(new), MORE | UNDERWAY), False)

    def _send(self, frame: Frame, told: Told, exact: bool) -> None:
        self._show(self._encoder.frame(frame, told, exact=exact))
        self._unseen.add(self._encoder.number)
        self._sent, self._was_underway = time.monotonic(), bool(told.flags & UNDERWAY)


def _spent(inputs: list[_Waiting]) -> float:
    """Return the milliseconds of processor since the first of some inputs was taken, 0 where there are none."""
    return 1e3 * (time.process_time() - min(w.taken for w in inputs)) if inputs else 0.0
