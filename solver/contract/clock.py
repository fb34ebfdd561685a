"""Hours in place of stages: how a solver whose stages are no times says where it is after some hours."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ValidationError

from .errors import InvalidInput
from .words import advise, say

__all__ = ["Clock"]


@dataclass(frozen=True)
class Clock:
    """What turns hours under given conditions into stages.

    `conditions` is a frozen model whose fields have units and meaning in their schema; `stage(hours, conditions,
    preset)` returns the stage, and raises InvalidInput outside of what was measured; its advice names conditions as
    NAME=VALUE.
    """

    conditions: type[BaseModel]
    stage: Callable[[float, Any, str | None], float]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the conditions."""
        return tuple(self.conditions.model_fields)

    def written(self, advice: str, write: Callable[[Mapping[str, str]], str]) -> str:
        """Return an advice with its conditions written by `write`: "rate=0.05, exponent=1" is one call for two."""
        one = rf"(?:{'|'.join(self.names)})=[A-Za-z0-9]+(?:\.[0-9]+)?"
        return re.sub(
            rf"\b{one}(?:, {one})*", lambda found: write(dict(c.split("=") for c in found[0].split(", "))), advice
        )

    def stages(self, hours: Iterable[float], under: Mapping[str, Any], preset: str | None = None) -> tuple[float, ...]:
        """Return the stages after those hours, in their order.

        Raises:
            InvalidInput: an unknown or impossible condition, or one that nobody measured.

        """
        try:
            conditions = self.conditions.model_validate(dict(under))
        except ValidationError as error:
            raise InvalidInput(f"{say(error, self.conditions.model_fields)}.", advice=advise(error)) from None
        return tuple(self.stage(hour, conditions, preset) for hour in hours)
