"""A growing shell that somebody works on: brushes, tools and solids between two steps, gestures that are taken back."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel

from ...arrays import Floats
from ...contract import Glimpse, InvalidGeometry, InvalidInput, Quality, SolverError
from ...meshes import Frame
from ..anchors import place
from ..engine import Engine, Undone
from ..params import GrowthParams
from ..settings import choose
from ..settling.stage import residual
from ..shapes import Ground, Mesh
from ..shown import shown
from ..solids import Solid, check_outside, check_pace
from ..state import State
from ..told import note_of_tool
from ..tooling.places import check_mapped
from ..tooling.placing import border
from ..tooling.tools import HotCurve, HotStroke, Point, Tool
from .actions import Add, Brush, End, Lift, Put

__all__ = ["GrowingLive"]

#: As many tools, solids and dabs as a parameter file may hold.
_MOST_TOOLS, _MOST_SOLIDS, _MOST_DABS = 200, 20, 20_000


class _Gesture(NamedTuple):
    """What stood before it."""

    steps: int
    tools: tuple[Tool, ...]
    solids: tuple[Solid, ...]


class _Back(NamedTuple):
    """A gesture that was taken back, and what brings it again."""

    gesture: _Gesture
    undone: Undone
    owed: float


class GrowingLive:
    """An engine with gestures; see `solver.contract.LiveEngine`."""

    def __init__(self, params: GrowthParams, quality: Quality) -> None:
        """Begin.

        Raises:
            InvalidInput: parameters that the start shape cannot have.

        """
        self._gestures: list[_Gesture] = []
        self._undone: list[_Back] = []
        self._stroke: int | None = None
        self._glimpsed: Floats | None = None
        self.owed, self.step = 0.0, params.step
        self._engine = self._begun(params, quality)
        self.quality: Quality = quality

    @staticmethod
    def _begun(params: GrowthParams, quality: Quality) -> Engine:
        settings = choose(quality)
        return Engine(params, settings.vertices, settings.tolerance)

    @property
    def stage(self) -> float:
        """Growth time."""
        return self._engine.steps * self.step

    @property
    def following(self) -> float:
        """When the next step starts that has not begun."""
        return self._engine.following

    @property
    def residual(self) -> float:
        """Largest force over that of an edge that is stretched or folded by 1, whichever is less."""
        return residual(self._engine.state, self._engine.params)

    @property
    def script(self) -> GrowthParams:
        """The parameters of which this is the batch run."""
        return self._engine.script

    @property
    def gestures(self) -> int:
        """Gestures that can be taken back."""
        return len(self._gestures)

    @property
    def undone(self) -> int:
        """Gestures that can be brought again."""
        return len(self._undone)

    def do(self, action: BaseModel) -> Mapping[str, Any]:
        """Take an action; return the number of the tool or solid that it concerns, and a `note` where it does nothing.

        Raises:
            InvalidInput: too many tools, solids or dabs, a place off the surface, a solid that is too fast, or
                a number that nothing has.
            InvalidGeometry: a solid that the whole sheet lies in, a texture without coordinates to lie by.

        """
        if self.owed > self.stage + 1e-9:
            raise InvalidInput(
                "the shape is still on its way to where it was.", advice="Wait until `until` is reached."
            )
        if isinstance(action, Brush):
            said = self._check_near(action)
            return {"tool": self._dab(action)} | ({"note": said} if said else {})
        if isinstance(action, End):
            return self._end(action)
        self._stroke = None
        if isinstance(action, Add):
            _room("tools", len(self.script.tools), _MOST_TOOLS)
            if "uv" not in self._engine.state.corners:
                try:
                    check_mapped(action.tool)
                except ValueError as error:
                    raise InvalidGeometry(f"tool: {error}.", advice="Begin with such a mesh, or project it.") from None
            said = self._note(action.tool)
            self.begin()
            return {"tool": self._engine.add(action.tool)} | ({"note": said} if said else {})
        if isinstance(action, Put):
            _room("solids", len(self.script.solids), _MOST_SOLIDS)
            self._check_solid(action.solid)
            self.begin()
            return {"solid": self._engine.put(action.solid)}
        assert isinstance(action, Lift)
        return {}

    def begin(self) -> None:
        """Begin a gesture; what was taken back is gone."""
        steps = round(self._engine.following / self.step)
        self._gestures.append(_Gesture(steps, self.script.tools, self.script.solids))
        self._undone.clear()

    def _check_solid(self, solid: Solid) -> None:
        try:
            check_pace(solid, self.step)
        except ValueError as error:
            raise InvalidInput(f"solid: {error}.", advice="Take a smaller `velocity`.") from None
        if solid.start > self._engine.following + 1e-9:
            return
        state = self._engine.state
        try:
            check_outside("it", solid, Mesh(state.x, state.mesh.triangles), self.script.thickness)
        except ValueError as error:
            advice = "Or take another place for it: nothing has changed."
            raise InvalidGeometry(f"solid: {error}.", advice=advice) from None

    def _dab(self, brush: Brush) -> int:
        hold = brush.hold or self.step
        stroke = None if self._stroke is None else self.script.tools[self._stroke]
        if not (
            isinstance(stroke, HotStroke)
            and (stroke.radius, stroke.stretch, stroke.thickening, stroke.kernel, stroke.hold)
            == (brush.radius, brush.stretch, brush.thickening, brush.kernel, hold)
        ):
            _room("tools", len(self.script.tools), _MOST_TOOLS)
            self.begin()
            looks = brush.model_dump(include={"radius", "stretch", "thickening", "kernel"}) | {"hold": hold}
            tool = HotStroke(points=(brush.at,), ways=(brush.way or (0.0, 0.0, 0.0),), times=(0.0,), **looks)
            self._stroke = self._engine.add(tool)
            return self._stroke
        assert self._stroke is not None
        _room("dabs of one stroke", len(stroke.points), _MOST_DABS)
        self._undone.clear()
        more = {
            "points": (*stroke.points, brush.at),
            "ways": (*stroke.ways, brush.way or _way(stroke.points[-1], brush.at)),
            "times": (*stroke.times, self._engine.following - stroke.start),
        }
        self._engine.change(self._stroke, stroke.model_copy(update=more))
        return self._stroke

    def _note(self, tool: Tool) -> str:
        """Return what to say of a tool that is to be added."""
        state, params = self._engine.state, self.script
        if tool.start > self._engine.following + 1e-9 or (isinstance(tool, HotCurve) and tool.apex is not None):
            return ""
        ground = Ground(Mesh(state.x, state.mesh.triangles), border(state.mesh), state.corners.get("uv"))
        return note_of_tool(len(params.tools), tool, params, ground)

    def _check_near(self, brush: Brush) -> str:
        """Refuse a dab that is off the surface; return what to say of one that lies between all vertices."""
        state = self._engine.state
        at = np.array(brush.at)
        there = place(at, state.x, state.mesh.triangles).at(state.x, state.mesh.triangles)[0]
        away = float(np.linalg.norm(there - at))
        if away > brush.radius:
            near = ", ".join(f"{value:.3g}" for value in there)
            raise InvalidInput(
                f"at: the surface is {away:.3g} away from there, further than the brush's radius.",
                advice=f"Its nearest point is ({near}).",
            )
        gap = float(np.linalg.norm(state.x - there, axis=1).min())
        if gap < brush.radius:
            return ""
        return f"It touches no vertex, the nearest being {gap:.2g} away, and so does nothing: take a larger radius."

    def _end(self, action: End) -> Mapping[str, Any]:
        tools, solids = self.script.tools, self.script.solids
        number, there = (action.tool, tools) if action.tool is not None else (action.solid, solids)
        assert number is not None
        if number >= len(there):
            what = "tool" if action.tool is not None else "solid"
            raise InvalidInput(
                f"there is no {what} {number}.",
                advice=f"They go from 0 to {len(there) - 1}." if there else "There is none.",
            )
        self.begin()
        if action.tool is None:
            self._engine.take(number)
            return {"solid": number}
        self._stroke = None if self._stroke == number else self._stroke
        self._engine.end(number)
        return {"tool": number}

    def advance(self, budget: float, until: float) -> bool:
        """Work for about so many seconds; return whether a step was completed.

        Raises:
            SolverError: the step failed; the state before it stands, and nothing is owed any more.

        """
        try:
            return self._engine.advance(budget, until)
        except SolverError:
            self.owed = 0.0
            raise

    def undo(self) -> bool:
        """Take the last gesture back; what lies too long ago to be kept is grown again from the start (`owed`)."""
        if not self._gestures:
            return False
        gesture = self._gestures.pop()
        self._undone.append(_Back(gesture, self._engine.back(gesture.steps), self.owed))
        self._engine.lay(gesture.tools, gesture.solids)
        self._stroke, self.owed = None, gesture.steps * self.step
        return True

    def redo(self) -> bool:
        """Bring the last gesture again."""
        if not self._undone:
            return False
        gesture, undone, self.owed = self._undone.pop()
        self._gestures.append(gesture)
        self._engine.forth(undone)
        self._stroke = None
        return True

    def refine(self, quality: Quality) -> None:
        """Begin anew on another mesh and owe the way to the present stage.

        Raises:
            InvalidInput: the parameters do not fit it.

        """
        engine = self._begun(self.script, quality)
        self.owed = max(self.owed, self.stage)
        self._engine, self.quality, self._stroke = engine, quality, None
        self._undone.clear()

    def frame(self, fields: Sequence[str]) -> Frame:
        """Return the present surface."""
        return self._shown(self._engine.state, fields)

    def glimpse(self, fields: Sequence[str]) -> Glimpse | None:
        """Return where the step under way has come to, if it is somewhere else than when it was asked for last."""
        state = self._engine.underway
        if state is None or state.x is self._glimpsed:
            return None
        self._glimpsed = state.x
        return Glimpse(self._shown(state, fields), state.time, residual(state, self._engine.params))

    def settled(self, fields: Sequence[str]) -> Generator[object, None, tuple[Frame, float]]:
        """Settle the present state as a batch run does; yields between pieces of work."""
        state = yield from self._engine.reaching(self.stage)
        return self._shown(state, fields), residual(state, self._engine.params)

    def _shown(self, state: State, fields: Sequence[str]) -> Frame:
        return Frame(state.x, state.mesh.triangles, shown(state, self._engine.params, fields))


def _room(what: str, count: int, most: int) -> None:
    if count >= most:
        raise InvalidInput(
            f"there are {count} {what} already, as many as may be.", advice="Save, and go on from there."
        )


def _way(before: Point, now: Point) -> Point:
    x, y, z = (float(b - a) for a, b in zip(before, now, strict=True))
    return (x, y, z)
