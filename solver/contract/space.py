"""Places and directions in parameters: finite numbers whose squares are, too."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator, Field

__all__ = ["Coordinate", "Direction", "Position"]

#: A coordinate, in whatever unit; what is farther away is meant in another one.
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Position = tuple[Coordinate, Coordinate, Coordinate]

#: Length below which a direction is none.
_LEAST = 1e-9


def _directed(value: Position) -> Position:
    if math.hypot(*value) <= _LEAST:
        raise ValueError("it has no direction: give one of any length, 0,0,1, say")
    return value


Direction = Annotated[Position, AfterValidator(_directed)]
