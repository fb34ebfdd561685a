"""What a scene is refused for."""

from __future__ import annotations

from ..errors import BatchTooLarge, InvalidQuery

__all__ = ["InvalidScene", "OverBudget", "SceneTooLarge"]


class InvalidScene(InvalidQuery):
    """A scene that means nothing: misspelt, missing or impossible parts."""

    code = "invalid-scene"


class SceneTooLarge(BatchTooLarge):
    """More instances than one scene may have."""

    code = "scene-too-large"


class OverBudget(InvalidQuery):
    """A scene that does not fit its budget even at the coarsest; the advice says what to drop."""

    code = "over-budget"
