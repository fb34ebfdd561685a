"""Work that waits, in threads; what came of it is handed over where Blender may be touched: in its timer."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from queue import Empty, SimpleQueue
from typing import Any

from .client import Refused

__all__ = ["Work"]

Then = Callable[[Any], None]


class Work:
    """Calls under way. Of several with one name the newest waits for the one that runs; those between are dropped."""

    def __init__(self) -> None:
        self._done: SimpleQueue[tuple[Then, Any]] = SimpleQueue()
        self._lock = threading.Lock()
        self._running: set[Hashable] = set()
        self._next: dict[Hashable, tuple[Callable[[], Any], Then, Then]] = {}

    @property
    def busy(self) -> int:
        """How many calls are under way or wait."""
        with self._lock:
            return len(self._running) + len(self._next)

    def begin(self, name: Hashable, call: Callable[[], Any], then: Then, otherwise: Then) -> None:
        """Make a call in a thread; `settle` hands its answer to `then`, and a sentence to `otherwise` if it failed."""
        with self._lock:
            if name in self._running:
                self._next[name] = call, then, otherwise
                return
            self._running.add(name)
        threading.Thread(target=self._run, args=(name, call, then, otherwise), daemon=True).start()

    def settle(self, most: int = 64) -> int:
        """Hand over what has come, in the thread that calls, and return how much that was."""
        for count in range(most):
            try:
                then, answer = self._done.get_nowait()
            except Empty:
                return count
            then(answer)
        return most

    def forget(self) -> None:
        """Drop what waits; what runs is not handed over any more."""
        with self._lock:
            self._next.clear()
        self._done = SimpleQueue()

    def _run(self, name: Hashable, call: Callable[[], Any], then: Then, otherwise: Then) -> None:
        done = self._done
        while True:
            try:
                answer = call()
                done.put((then, answer))
            except Refused as error:
                done.put((otherwise, str(error)))
            except Exception as error:  # a thread that dies in silence leaves a panel that waits for ever
                done.put((otherwise, f"{type(error).__name__}: {error}"))
            with self._lock:
                following = self._next.pop(name, None)
                if following is None:
                    self._running.discard(name)
                    return
            call, then, otherwise = following
