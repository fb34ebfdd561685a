"""One engine and what is asked of it, message by message; knows no connection (docs/sessions.md)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Mapping
from typing import Any

import numpy as np

from solver.contract import InvalidInput, LiveEngine, Need, OverBudget, Params, Quality, Solver, SolverError
from solver.contract.words import SHORT
from solver.geometry.crossings import crossings
from solver.meshes import Frame

from .screen import Screen
from .script import command, toml
from .words import OWN, QUALITIES, check, number_of, problem

__all__ = ["Desk"]

#: Seconds of work between two looks at what has come.
_SLICE = 0.005
#: Seconds without work after which the client gets every digit.
_REST = 0.3
#: Processor seconds after which a step that has no end waits for somebody who wants it.
_LONG = 20.0


class Desk:
    """Takes messages, works, and says and shows what comes of it."""

    def __init__(
        self,
        solver: Solver,
        params: Params,
        quality: Quality,
        fields: tuple[str, ...],
        say: Callable[[dict[str, Any]], None],
        show: Callable[[bytes], None],
    ) -> None:
        """Begin.

        Raises:
            InvalidInput: the solver offers no engine, or cannot begin with these parameters.

        """
        if solver.live is None:
            raise InvalidInput(f"{solver.name} offers no live engine.", advice="Run it as a job.")
        unknown = [name for name in fields if name not in solver.live.fields]
        if unknown:
            known = ", ".join(solver.live.fields) or "none"
            raise InvalidInput(f"no field {unknown[0]!r} can be shown.", advice=f"Known: {known}.")
        self._solver, self._live, self._fields, self._say = solver, solver.live, fields, say
        self._engine: LiveEngine = solver.live.open(params, quality)
        self._note = "" if solver.remarks is None else solver.remarks(params, Need(quality=quality))
        self._screen = Screen(show)
        self._until, self._pace, self._since = 0.0, math.inf, (time.monotonic(), 0.0)
        self._settling: Generator[object, None, tuple[Frame, float]] | None = None
        self._exact: tuple[Frame, float] | None = None
        #: Whether there is something to show, and whether the client has what is there but for roundings.
        self._is_new, self._is_rough = True, False
        #: Pairs of triangles of the last frame at rest that pass through each other; None while the shape is under way.
        self._crossings: int | None = None
        self._worked = 0.0
        #: Processor seconds spent on the step under way.
        self._spent = 0.0
        self._told: dict[str, Any] = {}
        #: Whether nobody looks: until `begin_again`, and while a connection is lost.
        self.held = True

    def begin_again(self, more: Mapping[str, Any]) -> None:
        """Speak with a client that holds nothing; `more`: what it is told besides."""
        self._screen.forget()
        self._told, self._is_new, self.held = {}, True, False
        stages, engine = self._solver.stages, self._engine
        opened = {
            "say": "opened",
            "solver": self._solver.name,
            "version": self._solver.version,
            "stage": {"symbol": stages.symbol, "units": stages.units},
            "step": engine.step,
            "quality": engine.quality,
            "fields": list(self._fields),
            "actions": list(self._live.actions),
        }
        self._say({**opened, **({"note": self._note} if self._note else {}), **more})
        self._state()

    def take(self, message: Mapping[str, Any]) -> None:
        """Do what a message says, or say what is wrong with it."""
        if message.get("do") == "seen":
            self._screen.seen(message.get("frame"))
            return
        number = message.get("id")
        try:
            if type(number) is not int or not 0 < number < 2**32:
                number = None
                raise InvalidInput("id: a message has a whole number above 0.", advice='Send {"do": ..., "id": 1}.')
            said = self._done(message, number)
        except SolverError as error:
            self._say({"say": "error", "id": number, "problem": problem(error)})
        else:
            self._say({"say": "saved" if message.get("do") == "save" else "done", "id": number, **said})
        self._state()

    def _done(self, message: Mapping[str, Any], number: int) -> Mapping[str, Any]:
        values = {name: value for name, value in message.items() if name not in ("do", "id")}
        what = message.get("do")
        if not isinstance(what, str) or (what not in OWN and what not in self._live.actions):
            known = ", ".join([*OWN, *self._live.actions])
            raise InvalidInput(f"there is nothing to do by the name {SHORT.repr(what)}.", advice=f"Known: {known}.")
        if what in OWN:
            check(what, values)
            said: Mapping[str, Any] | None = getattr(self, f"_do_{what}")(number, **values)
            return said or {}
        found = self._engine.do(self._live.parse(what, values))
        self._leave_settling()
        grown = self._engine.following + self._engine.step
        self._until = max(self._until, grown)
        self._screen.wait(number, grown)
        return found

    def _do_play(self, number: int, until: Any = None, pace: Any = None) -> None:
        end, fastest = number_of("until", until), number_of("pace", pace)
        step = self._engine.step
        # less than a step would be done at once, and nothing would have grown
        if end < self._engine.stage + step - 1e-9:
            raise InvalidInput(
                f"until: growth time {end:g} does not come any more: it is {self._engine.stage:g}, and at least "
                f"{self._engine.stage + step:g} after the next step.",
                advice=f"It grows by steps of {step:g}. `undo` goes back.",
            )
        if fastest <= 0:
            raise InvalidInput("pace: it is above 0.", advice="Leave it out for as fast as it goes; `pause` stops it.")
        self._engine.begin()
        self._leave_settling()
        self._until, self._pace = min(end, self._solver.stages.highest), fastest
        self._since = time.monotonic(), self._engine.stage
        self._screen.wait(number, self._engine.following + self._engine.step)

    def _do_pause(self, number: int) -> None:
        self._until, self._pace = self._engine.following, math.inf

    def _do_undo(self, number: int) -> None:
        if not self._engine.undo():
            raise InvalidInput("there is nothing to undo.", advice="`state` says how many gestures there are.")
        self._jumped(number)

    def _do_redo(self, number: int) -> None:
        if not self._engine.redo():
            raise InvalidInput("there is nothing to bring again.", advice="Whatever is done ends it.")
        self._jumped(number)

    def _do_quality(self, number: int, quality: Any = None) -> None:
        if quality not in QUALITIES:
            raise InvalidInput(f"there is no quality {quality!r}.", advice=f"Known: {', '.join(QUALITIES)}.")
        self._engine.refine(quality)
        self._jumped(number)

    def _jumped(self, number: int) -> None:
        """The shape is another one, perhaps after the way back that is owed."""
        self._leave_settling()
        self._until, self._pace, self._is_new, self._spent = 0.0, math.inf, True, 0.0
        self._screen.give_up()
        self._screen.wait(number, self._engine.owed)

    def _do_settle(self, number: int) -> None:
        if self._engine.owed > self._engine.stage + 1e-9:
            raise InvalidInput("the shape is still on its way.", advice="Wait until `working` is false.")
        self._until = self._engine.stage
        self._leave_settling()
        self._settling = self._engine.settled(self._fields)
        self._screen.wait(number, self._engine.stage)

    def _do_save(self, number: int) -> Mapping[str, Any]:
        return self.saved()

    def _do_whole(self, number: int) -> None:
        self._screen.forget()
        self._is_new = True

    def saved(self) -> dict[str, Any]:
        """Return the session as a parameter file."""
        engine, solver = self._engine, self._solver
        # while the way back is owed, what counts is where it leads
        stage = max(engine.stage, engine.owed)
        text = toml(solver, engine.script, stage, engine.quality)
        told = {"toml": text, "stage": stage, "quality": engine.quality}
        return told | {"command": command(solver, stage, engine.quality)}

    def _leave_settling(self) -> None:
        if self._settling is not None:
            self._settling.close()
        self._settling = self._exact = None

    @property
    def _goal(self) -> float:
        """How far to work now."""
        if self._engine.owed > self._engine.stage + 1e-9:
            return self._engine.owed
        begun, stage = self._since
        if math.isinf(self._pace):
            return self._until
        return min(self._until, stage + self._pace * (time.monotonic() - begun))

    @property
    def _works(self) -> bool:
        """Whether there is more to grow, now or when its time has come."""
        end = max(self._engine.owed, self._until)
        return self._settling is not None or self._engine.stage + self._engine.step <= end + 1e-9

    @property
    def is_busy(self) -> bool:
        """Whether `work` has something to do at once."""
        if self.held:
            return False
        due = self._engine.stage + self._engine.step <= self._goal + 1e-9
        return self._settling is not None or due or (self._screen.may_show and self._has_news)

    @property
    def is_waiting(self) -> bool:
        """Whether `work` will have something to do when time has passed."""
        return not self.held and (self._works or self._has_news or self._is_rough)

    def finish(self) -> None:
        """Work until nothing is left to do; nobody looks on."""
        self.held = False
        while self._works:
            self._screen.all_seen()
            self.work()
            if self._pace < math.inf:
                time.sleep(_SLICE / 2)
        self._exact, self.held = None, True

    def work(self) -> None:
        """Work for some milliseconds, and show what came of it."""
        if self.held:
            return
        try:
            if self._settling is not None:
                self._settle()
            elif self._engine.stage + self._engine.step <= self._goal + 1e-9:
                self._advance()
        except SolverError as error:
            self._until, self._settling, self._is_new, self._spent = self._engine.stage, None, True, 0.0
            self._say({"say": "error", "id": self._screen.give_up(), "problem": problem(error)})
        if self._has_news:
            if self._screen.may_show:
                self._send()
        elif self._spent and self._screen.may_glimpse:
            self._glimpse()
        self._state()

    def _advance(self) -> None:
        begin = time.process_time()
        if not self._spent:
            self._screen.begin()
        completed = self._engine.advance(_SLICE, self._goal)
        self._worked = time.monotonic()
        self._is_new |= completed
        self._spent = 0.0 if completed else self._spent + time.process_time() - begin
        if self._spent > _LONG and self._engine.owed <= self._engine.stage + 1e-9:
            raise OverBudget(
                f"a step was not done after {_LONG:g} s of processor time.",
                advice="Undo what was asked for, ask for less at once, or `play` for as much time again.",
            )

    def _settle(self) -> None:
        assert self._settling is not None
        end = time.perf_counter() + _SLICE
        while time.perf_counter() < end:
            try:
                next(self._settling)
            except StopIteration as found:
                self._settling, self._exact = None, found.value
                return

    @property
    def _has_news(self) -> bool:
        return self._is_new or self._exact is not None or (self._is_rough and self._rests)

    @property
    def _rests(self) -> bool:
        return not self._works and time.monotonic() - self._worked >= _REST

    def _send(self) -> None:
        """Send the present state, or the settled one."""
        stage = self._engine.stage
        frame, residual = self._exact or (self._engine.frame(self._fields), self._engine.residual)
        rough = self._exact is None and not self._rests
        self._screen.rest(frame, stage, residual, self._exact is not None, rough)
        # as the client has it, in single precision
        self._crossings = None if rough else crossings(frame.vertices.astype(np.float32), frame.triangles).count
        self._is_new, self._is_rough, self._exact = False, rough, None

    def _glimpse(self) -> None:
        """Send where the step under way has come to."""
        found = self._engine.glimpse(self._fields)
        if found is not None:
            self._screen.glimpse(found.surface, found.stage, found.residual)
            self._crossings, self._is_rough = None, True

    def _state(self) -> None:
        """Say how things stand, if anything but the time has changed."""
        engine = self._engine
        until = max(self._until, engine.owed)
        told = {
            "until": until,
            "working": self._works,
            "undo": engine.gestures,
            "redo": engine.undone,
            "quality": engine.quality,
            "crossings": self._crossings,
        }
        if told != self._told:
            self._told = told
            self._say({"say": "state", "time": engine.stage, **told})
