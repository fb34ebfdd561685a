"""What a user says of a heap of fruits."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from ..presets import FRUITS

__all__ = ["WALL", "Heap", "Kind"]

#: Thickness of the bowl [r1].
WALL = 0.15
#: How high above the next place below a fruit may hang [r1]: it is let down to rest, not found from any height.
_FALL = 6.0


class Kind(BaseModel):
    """Fruits of one preset in a heap: shape, size, skin, flesh and species are its own, air and rules the heap's."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    preset: str = Field(description=f"Which fruit: {', '.join(FRUITS)} [1]")
    fruits: int = Field(1, ge=1, le=60, description="How many of it there are [1]")

    @field_validator("preset")
    @classmethod
    def _known(cls, value: str) -> str:
        if value not in FRUITS:
            raise ValueError(f"a heap knows no fruit {value!r}: take one of {', '.join(FRUITS)}; the air is the heap's")
        return value


class Heap(BaseModel):
    """Fruits that lie on each other; each is that of the parameters, or of its kind, a little larger or smaller."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    fruits: int = Field(20, ge=1, le=60, description="How many there are [1]")
    kinds: tuple[Kind, ...] = Field(
        (),
        max_length=12,
        description="Fruits of several presets, numbered in this order and thrown together; without, all are the "
        "fruit of the parameters. Lengths are in that one's r1 all the same [1]",
    )
    bowl: float = Field(
        4.5, ge=0, le=20, description="Radius of the opening of the bowl that they lie in; 0: on a floor [r1]"
    )
    spread: float = Field(0.06, ge=0, le=0.3, description="How far sizes depart from the parameters' at most [1]")
    places: tuple[tuple[float, float, float], ...] = Field(
        (),
        max_length=60,
        description="Centres, where they are to lie from the start, upright; without, they are poured. The floor, or "
        "the bowl's foot, is at y = 0 [r1]",
    )
    infected: tuple[int, ...] = Field(
        (0,), max_length=60, description="Numbers from 0 of the fruits that have the wounds; the others are sound [1]"
    )
    infection: float = Field(
        1.0,
        ge=0,
        le=50,
        description="Infections in a day through a contact that is rotten on one side, at the best temperature; a "
        "choice [1/day]",
    )
    still: float = Field(
        0.5,
        ge=0,
        le=1,
        description="How much of the vapour that a fruit gives off reaches the others: 1 in still air, 0 where a wind "
        "takes it away; a choice [1]",
    )
    step: float = Field(
        0.25, ge=0.02, le=10, description="Days between looks at what touches what, and at the air between [day]"
    )

    @model_validator(mode="after")
    def _there(self) -> Self:
        count = self.count
        if self.places and "fruits" in self.model_fields_set and self.fruits != count:
            raise ValueError(f"{count} places and {self.fruits} fruits: name as many, or leave fruits out")
        if self.kinds:
            several = sum(kind.fruits for kind in self.kinds)
            if "fruits" in self.model_fields_set and self.fruits != several:
                raise ValueError(f"the kinds are {several} fruits and not {self.fruits}: leave fruits out")
            if self.places and len(self.places) != several:
                raise ValueError(f"{len(self.places)} places for {several} fruits of all kinds: name as many")
            if several > 60:
                raise ValueError(f"the kinds are {several} fruits together: a heap has 60 at most")
        self._check_places()
        for number in self.infected:
            if not 0 <= number < count:
                raise ValueError(f"infected names fruit {number}: they are numbered 0 to {count - 1}")
        if self.bowl and self.bowl < 1.5:
            raise ValueError("a bowl that holds a fruit opens 1.5 r1 wide at least; 0 is a floor")
        return self

    def _check_places(self) -> None:
        below = 0.0
        for y, number in sorted((place[1], number) for number, place in enumerate(self.places)):
            if y <= 0:
                raise ValueError(f"places.{number} lies at y = {y:g}, below the floor: middles are some 1 above it")
            if y > below + _FALL:
                raise ValueError(
                    f"places.{number} hangs at y = {y:g}, {y - below:g} above the next below: bring it down"
                )
            below = y

    @property
    def count(self) -> int:
        """How many fruits there are."""
        return len(self.places) or sum(kind.fruits for kind in self.kinds) or self.fruits
