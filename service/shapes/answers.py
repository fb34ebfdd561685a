"""Answers worth keeping: sliders come back to where they were, and pipelines ask again.

A body is kept under its entity tag, which stands for the generation, the question in its one spelling and the format;
so different spellings share it, and a new generation is never answered with an old one's shape. `Repeats` answers a
question that came before, in the same words, without waking the router.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from typing import NamedTuple

from starlette.datastructures import State
from starlette.types import ASGIApp, Receive, Scope, Send

from solver.contract import Solver, SolverError
from store.errors import StoreError

from ..errors import ServiceError
from ..views.tags import matches

__all__ = ["Answer", "Answers", "Question", "Repeats"]

#: Questions in words whose answer is remembered, and the longest of them [bytes].
_QUESTIONS, _LONGEST = 4096, 512
#: Share of the room that one body may take.
_SHARE = 4


class Question(NamedTuple):
    """A question in the asker's words: path, query string and Accept header."""

    path: str
    query: bytes
    accept: bytes


class Answer(NamedTuple):
    """A whole answer: its tag, headers as they go on the wire, and body."""

    tag: str
    headers: tuple[tuple[bytes, bytes], ...]
    body: bytes


class _Asked(NamedTuple):
    solver: Solver
    table: str
    families: object
    digest: str
    tag: str
    route: object


class Answers:
    """The answers last given, up to `room` bytes of bodies; 0 keeps none. Safe among threads."""

    def __init__(self, room: int) -> None:
        self._room = room
        self._held = 0
        self._bodies: OrderedDict[str, Answer] = OrderedDict()
        self._asked: OrderedDict[Question, _Asked] = OrderedDict()
        self._guard = threading.Lock()

    def __len__(self) -> int:
        return len(self._bodies)

    @property
    def held(self) -> int:
        """Bytes of all bodies."""
        return self._held

    def get(self, tag: str) -> Answer | None:
        """Return the answer with a tag, if it is still there."""
        with self._guard:
            found = self._bodies.get(tag)
            if found is not None:
                self._bodies.move_to_end(tag)
            return found

    def keep(self, answer: Answer) -> None:
        """Keep an answer, and let go of those not asked for the longest; one too large for the room is not kept."""
        size = len(answer.body)
        if size * _SHARE > self._room:
            return
        with self._guard:
            if answer.tag in self._bodies:
                return
            self._bodies[answer.tag] = answer
            self._held += size
            while self._held > self._room:
                self._held -= len(self._bodies.popitem(last=False)[1].body)

    def remember(self, scope: Scope, solver: Solver, table: str, families: object, digest: str, tag: str) -> None:
        """Remember that the words of a request ask for the answer `tag` while the solver's tables are those `families`,
        and the one that answers has that digest.
        """
        asked = _question(scope)
        if len(asked.query) + len(asked.path) + len(asked.accept) > _LONGEST:
            return
        with self._guard:
            self._asked[asked] = _Asked(solver, table, families, digest, tag, scope.get("route"))
            self._asked.move_to_end(asked)
            while len(self._asked) > _QUESTIONS:
                self._asked.popitem(last=False)

    def repeated(self, scope: Scope, state: State) -> Answer | None:
        """Return the answer to a question that was asked before in these words, if it still holds."""
        asked = self._asked.get(_question(scope))
        if asked is None:
            return None
        try:
            table = state.tables.get(asked.table)
            families = state.tables.families(asked.solver)
        except (StoreError, ServiceError, SolverError, OSError):
            return None  # the handler meets the same, and explains it
        if table.digest != asked.digest or families is not asked.families:
            return None
        found = self.get(asked.tag)
        if found is not None:
            scope["route"] = asked.route  # for the log and the metrics
        return found

    def is_kept(self, state: State, scope: Scope) -> bool:
        """Return whether `Repeats` would answer a request."""
        settings = state.settings
        return bool(settings.public_read and settings.cache_bytes) and self.repeated(scope, state) is not None


class Repeats:
    """Answers repeated questions at once. Only where reading is free: whoever must show a token is asked for it."""

    def __init__(self, app: ASGIApp, state: State) -> None:
        self.app = app
        self.state = state

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send what is kept, or that the asker has it; pass on everything else."""
        found = None
        if scope["type"] == "http" and scope["method"] == "GET":
            found = self.state.answers.repeated(scope, self.state)
        if found is None:
            await self.app(scope, receive, send)
            return
        if matches(_header(scope, b"if-none-match").decode("latin-1"), found.tag):
            kept = [pair for pair in found.headers if pair[0] in (b"etag", b"cache-control", b"vary")]
            await send({"type": "http.response.start", "status": 304, "headers": kept})
            await send({"type": "http.response.body", "body": b""})
            return
        await send({"type": "http.response.start", "status": 200, "headers": list(found.headers)})
        await send({"type": "http.response.body", "body": found.body})


def _question(scope: Scope) -> Question:
    return Question(scope["path"], scope.get("query_string", b""), _header(scope, b"accept"))


def _header(scope: Scope, name: bytes) -> bytes:
    return b",".join(value for key, value in scope["headers"] if key == name)
