"""Constants of the flesh, and what water and rot do to it: rest lengths (Eq. 1), softening, collapse of what is rotten.

Eq. 1 prints a cube root that shrinks sixty times too much: volume goes with the cube of lengths, so losing the share x
of a volume takes dL = -L (1 - (1 - x)^(1/3)) from each length. Steps of it multiply to (1 - X)^(1/3), with X the share
lost so far, whatever the steps; the stiffness, dK = -c K x per step, to (1 - X)^c likewise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from ...arrays import Bools, Floats

__all__ = ["SHORTEST", "Booked", "Flesh", "Skin", "Softened", "Swing", "softened"]


#: The shortest step of springs [s].
SHORTEST = 1e-6


class Flesh(BaseModel):
    """Constants of the body; the paper gives none of these numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    unit: float = Field(1e4, gt=0, le=1e8, description="Young's modulus of the flesh at firmness 1 [Pa]")
    poisson: float = Field(0.3, ge=0, le=0.45, description="Poisson's ratio [1]")
    stone: float = Field(
        30.0, ge=1, le=1000, description="Stiffness of stone or core, over that of the fresh flesh [1]"
    )
    shrinkage: float = Field(
        1.0, ge=0, le=1, description="Share of the lost water's volume that is not air, c of Eq. 1 [1]"
    )
    softening: float = Field(1.0, ge=0, le=10, description="c of the change of stiffness: (1 - X)^c is left [1]")
    rot_depth: float = Field(0.5, gt=0, le=3, description="Depth at which the skin's rot has faded out [r1]")
    rot_collapse: float = Field(0.25, ge=0, le=0.7, description="Share of its length that rotten flesh loses [1]")
    rot_respired: float = Field(
        0.02, ge=0, le=0.1, description="Share of rotten flesh's weight that leaves as carbon dioxide; a choice [1]"
    )
    rot_softness: float = Field(0.98, ge=0, le=0.999, description="Share of its stiffness that rotten flesh loses [1]")
    rind: float = Field(0.15, ge=0.02, le=1, description="Thickness of the flesh behind an open mesh of one's own [r1]")
    gravity: float = Field(9.81, ge=0, le=100, description="Gravity; 0 is a fruit that floats [m/s2]")

    @property
    def heeds_rot(self) -> bool:
        """Whether rot changes anything."""
        return self.rot_collapse > 0 or self.rot_softness > 0


class Skin(BaseModel):
    """Constants of the skin; its thickness is `exocarp_thickness`. The paper leaves them to a cloth solver."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    stiffness: float = Field(50.0, gt=0, le=10000, description="Young's modulus of the skin, over the flesh's [1]")
    shrinkage: float = Field(
        0.5, ge=0, le=1, description="Share of the drying body's shrinkage that the skin joins [1]"
    )
    joining: float = Field(
        0.7, ge=0, le=1, description="Share that it joins of what its place shrinks beyond that: rot takes skin too [1]"
    )
    slack: float = Field(
        0.15,
        ge=0,
        le=0.6,
        description="Most of the skin's lengths that the body may leave to be folded; beyond, it shrinks too: "
        "deeper folds close, and skin that dries gives way; a choice [1]",
    )
    depth: float = Field(0.1, ge=0.01, le=1, description="Depth of the flesh that holds the skin [r1]")
    uneven_hold: float = Field(
        0.0,
        ge=0,
        le=0.95,
        description="How much firmer or looser than on the mean the flesh holds the skin by place: dimples are of all "
        "widths then, and not even [1]",
        exclude_if=lambda value: value == 0,
    )


class Swing(BaseModel):
    """How the paper's springs are moved: from rest, for a while, in fixed steps."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    step: float = Field(0.006, ge=SHORTEST, le=1, description="Step of RK4 [s]")
    seconds: float = Field(1.0, ge=0, le=100, description="How long the springs swing before a stage is shown [s]")
    damping: float = Field(20.0, ge=0, le=1000, description="Damping of all motion [1/s]")


class Booked(NamedTuple):
    """Where the fresh weight is, as shares of it: in the fruit, in the air as water, on the ground as juice, in the air
    as carbon dioxide.
    """

    mass: float
    evaporated: float
    juice: float
    respired: float


class Softened(NamedTuple):
    """Per tetrahedron (t): lengths over fresh ones, Young's modulus [Pa], mass over fresh mass.

    booked: where the weight is. dried: lengths over fresh ones where nothing rots.
    """

    shrinkage: Floats
    young: Floats
    mass: Floats
    booked: Booked = Booked(1.0, 0.0, 0.0, 0.0)
    dried: float = 1.0


#: Least share of its volume that flesh keeps besides what rot takes.
_LEFT = 0.015


def softened(
    flesh: Flesh,
    firmness: float,
    water: float,
    rot: Floats,
    stone: Bools,
    volume: Floats,
    wet: float = 1.0,
    gives: Floats | None = None,
) -> Softened:
    """Return the state of tetrahedra of fresh volumes (t); rot (t), 0 to 1. A stone neither shrinks nor rots.

    water: evaporated, over the fresh weight. Rotten flesh collapses and its juice leaks: what it loses in volume it
    loses in weight. What evaporates comes evenly from the flesh that holds its juice, or in proportion to what a place
    `gives` (t), at most a share `wet` of it; some of the rotten flesh is respired. Weight and volume are fresh ones of
    one density.
    """
    share = np.where(stone, 0.0, volume) / np.sum(volume)
    kept = (1 - flesh.rot_collapse * rot) ** 3
    held = float(np.sum(share * kept))
    most = min(wet, 1 - _LEFT - flesh.rot_respired)
    mean = min(water / max(held, 1e-12), most)
    dry: float | Floats = mean
    evaporated = mean * held
    if gives is not None:
        given = float(np.sum(share * kept * gives))
        dry = np.minimum(gives * (water / given), most) if given > 0 else np.zeros_like(kept)
        evaporated = float(np.sum(share * kept * dry))
        mean = evaporated / max(held, 1e-12)
    gone = flesh.rot_respired * rot
    left = 1 - flesh.shrinkage * dry - gone
    young = flesh.unit * firmness
    mass = np.where(stone, 1.0, kept * (1 - dry - gone))
    soft = (1 - flesh.shrinkage * dry) ** flesh.softening * (1 - flesh.rot_softness * rot)
    return Softened(
        np.where(stone, 1.0, np.cbrt(kept * left)),
        young * np.where(stone, flesh.stone, soft),
        mass,
        Booked(
            float(np.sum(volume * mass) / np.sum(volume)),
            evaporated,
            float(np.sum(share * (1 - kept))),
            float(np.sum(share * kept * gone)),
        ),
        float(np.cbrt(1 - flesh.shrinkage * mean)),
    )
