"""What a set-up is made of besides bundle and bodies: grain, notches, cuts and grips, as parameters."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from .bodies import Part, Turn, Vector

__all__ = ["Corner", "Cut", "Fork", "Grain", "Grip", "GripPoint", "Knot", "Notch"]

Corner = tuple[Annotated[float, Field(ge=-1, le=1)], Annotated[float, Field(ge=-1, le=1)]]


class Knot(Part):
    """A dead branch's knot: a cone from the pith, round which fibres pass; it bears nothing itself."""

    at: Vector = Field(description="Place of its axis in the unloaded straight bundle at which its radius is given [m]")
    radius: float = Field(gt=1e-5, le=1, description="Radius there; nearer to the pith it is narrower [m]")
    elongation: float = Field(1.5, ge=1, le=4, description="How much longer along the fibres than wide it is [1]")


class Grain(Part):
    """How stiffness and strength vary: a smooth field from the run's seed, growth rings, and rays from the pith.

    And where fibres go: along the bundle, but for spiral grain and knots.
    """

    stiffness: float = Field(0.0, ge=0, le=0.5, description="Relative deviation of the stiffness [1]")
    strength: float = Field(
        0.1, ge=0, le=0.5, description="Relative deviation of the strength, distributed after Weibull [1]"
    )
    along: float = Field(0.02, gt=1e-5, le=10, description="Correlation length along the rods [m]")
    across: float = Field(0.003, gt=1e-6, le=1, description="Correlation length across them [m]")
    rings: float = Field(0.0, ge=0, le=1, description="Width of growth rings; 0 lays none [m]")
    late: float = Field(0.3, gt=0, lt=1, description="Late wood's share of a ring, its outer part [1]")
    contrast: float = Field(3.0, ge=1, le=20, description="Stiffness of late wood over that of early wood [1]")
    pith: Corner = Field((0.0, 0.0), description="Place y, z of the pith, where rings and rays begin [m]")
    rays: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="How much less wood bears in cracks along rays than in those around the pith [1]",
    )
    spiral: float = Field(
        0.0,
        ge=-200,
        le=200,
        description="Turn of the fibres about the pith along the bundle; at the distance d from it their slope is this "
        "times d. What does not lie round the pith is sawn out of such wood [radian/m]",
    )
    knots: tuple[Knot, ...] = Field((), max_length=32, description="Knots, round which fibres pass")

    @property
    def deviates(self) -> bool:
        """Whether fibres do not run straight along the bundle."""
        return self.spiral != 0 or bool(self.knots)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        for knot in self.knots:
            if knot.radius > 0.5 * math.hypot(knot.at[1] - self.pith[0], knot.at[2] - self.pith[1]):
                raise ValueError("a knot is wider than half its distance from the pith: take a smaller radius")
        return self


class Fork(Part):
    """Where some of the stem's rods bend away, upwards, into a branch. Boxes of grips and cuts see both unforked."""

    at: float = Field(gt=0, le=10, description="Where on the bundle its limbs part [m]")
    angle: float = Field(0.5, ge=0.1, le=1.6, description="Angle of the branch to the stem below [radian]")
    lean: float = Field(
        0.2, ge=0, le=1.6, description="Angle of the stem above to the stem below, away from it [radian]"
    )
    share: float = Field(0.4, ge=0.1, le=0.9, description="Share of the stem's section that goes into the branch [1]")


class Notch(Part):
    """A place where all rods are weaker, as if cut in from all sides."""

    position: float = Field(ge=0, le=10, description="Along the bundle [m]")
    depth: float = Field(ge=0, lt=1, description="Depth over the rod's radius [1]")
    width: float = Field(1e-3, gt=0, le=1, description="Length of the bundle that it weakens [m]")


def _ordered(box: Cut | Grip) -> None:
    if any(a > b for a, b in zip(box.low, box.high, strict=True)):
        raise ValueError("the corner `low` must not be above `high` in any direction")


class Cut(Part):
    """A saw cut: bonds that pass the box are broken, rods that pass it are parted where they are halfway through.

    So it takes no wood away. Slices are no thinner than a quarter of an edge.
    """

    low: Vector = Field(description="Lowest corner x, y, z of a box in the unloaded straight bundle [m]")
    high: Vector = Field(description="Highest corner; a box may be flat [m]")

    @model_validator(mode="after")
    def _sound(self) -> Self:
        _ordered(self)
        return self


class GripPoint(Part):
    """How far a grip has gone at a time; between two of them it goes evenly."""

    time: float = Field(ge=0, le=1000, description="Time [s]")
    shift: Vector = Field((0.0, 0.0, 0.0), description="How far it has been moved [m]")
    turn: tuple[Turn, Turn, Turn] = Field(
        (0.0, 0.0, 0.0), description="How far it has been turned about its pivot: axis times angle [radian]"
    )


class Grip(Part):
    """Jaws that hold what is in a box of the unloaded bundle, and move and turn it on a path."""

    low: Vector = Field(description="Lowest corner x, y, z of the box [m]")
    high: Vector = Field(description="Highest corner [m]")
    path: tuple[GripPoint, ...] = Field((), max_length=64, description="Its way; it rests before and after")
    pivot: Vector | None = Field(None, description="What it turns about; by default the middle of what it holds [m]")
    holds: Literal["xyz", "xy", "xz", "yz", "x", "y", "z"] = Field(
        "xyz", description="Directions in which it holds; what holds in z alone lets an end turn as a hinge does"
    )

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if any(a.time >= b.time for a, b in pairwise(self.path)):
            raise ValueError("the times of the path must rise: sort them, and give each once")
        _ordered(self)
        return self
