"""What a solver offers to those who work on a shape while it runs: an engine, and the actions that it understands."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from pydantic import BaseModel, ValidationError

from .errors import InvalidInput
from .need import Quality
from .params import Params
from .words import advise, say

if TYPE_CHECKING:
    from ..meshes import Frame

__all__ = ["Glimpse", "Live", "LiveEngine"]


class Glimpse(NamedTuple):
    """A surface on its way to a stage, and how far it is from equilibrium there."""

    surface: Frame
    stage: float
    residual: float


class LiveEngine(Protocol):
    """A run that is advanced in slices and acted upon in between.

    What it is given it takes between two steps, so that `script` is its exact record: a batch run of those parameters
    to the present stage, at the present quality, gives the bytes of `settled`.
    """

    #: How far one step goes along the stage axis.
    step: float
    quality: Quality
    #: Stage that has to be reached again before anything else, after an undo or another quality.
    owed: float

    @property
    def stage(self) -> float:
        """Where on the stage axis it is."""

    @property
    def following(self) -> float:
        """Where the next step starts that has not begun."""

    @property
    def gestures(self) -> int:
        """Gestures that can be taken back."""

    @property
    def undone(self) -> int:
        """Gestures that can be brought again."""

    @property
    def residual(self) -> float:
        """How far the present state is from equilibrium, as a share of the unit that the solver names."""

    @property
    def script(self) -> Params:
        """The parameters of which this is the batch run."""

    def do(self, action: BaseModel) -> Mapping[str, Any]:
        """Take an action from the next step on; return what its asker wants to know.

        Raises:
            InvalidInput: nothing that can be done here. Nothing has changed.

        """

    def begin(self) -> None:
        """Begin a gesture that is none of the actions: a time of free running."""

    def advance(self, budget: float, until: float) -> bool:
        """Work for about so many seconds, no further than a stage; return whether a step was completed.

        Raises:
            SolverError: the step failed; the state before it stands.

        """

    def undo(self) -> bool:
        """Take the last gesture back, with all that came of it; return whether there was one."""

    def redo(self) -> bool:
        """Bring the last gesture again that was taken back; return whether there was one."""

    def refine(self, quality: Quality) -> None:
        """Begin anew at another quality; what was done is done again up to the present stage.

        Raises:
            InvalidInput: there is no such run.

        """

    def frame(self, fields: Sequence[str]) -> Frame:
        """Return the present surface."""

    def glimpse(self, fields: Sequence[str]) -> Glimpse | None:
        """Return the surface that the step under way has come to, None where that is none that was not returned yet.

        When it is asked for changes nothing.
        """

    def settled(self, fields: Sequence[str]) -> Generator[object, None, tuple[Frame, float]]:
        """Settle the present state as a batch run does; yields between pieces of work. Returns surface and residual."""


@dataclass(frozen=True)
class Live:
    """The actions by name, frozen models whose fields have units and meaning, and what begins a run.

    `open(params, quality)` raises InvalidInput where the parameters cannot be begun with.
    """

    actions: Mapping[str, type[BaseModel]]
    open: Callable[[Any, Quality], LiveEngine]
    fields: tuple[str, ...] = ()

    def parse(self, name: str, values: Mapping[str, Any]) -> BaseModel:
        """Return an action.

        Raises:
            InvalidInput: unknown, or with wrong values.

        """
        if name not in self.actions:
            raise InvalidInput(f"there is no action {name!r}.", advice=f"Known: {', '.join(self.actions)}.")
        try:
            return self.actions[name].model_validate(dict(values))
        except ValidationError as error:
            raise InvalidInput(f"{say(error, self.actions[name].model_fields)}.", advice=advise(error)) from None
