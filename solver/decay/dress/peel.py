"""What a fruit's skin and its rot look like, and what stands at its poles, by preset. No field depends on any of it.

Colours are linear light. All of it was chosen by eye from the words for what is seen (docs/decay.md), none measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["LESIONS", "PEELS", "Lesion", "Peel"]

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Colour = tuple[Share, Share, Share]


class Lesion(BaseModel):
    """Skin over rot."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    colour: Colour = Field((0.16, 0.075, 0.03), description="Rotten skin, linear red, green, blue [1]")
    cover: Share = Field(0.9, description="Share of the fresh colour that rot hides [1]")
    roughness: Share = Field(0.45, description="Roughness of rotten skin: low is wet [1]")
    middle: Colour | None = Field(
        None, description="Colour of what has long been rotten, linear red, green, blue; none: as the rest [1]"
    )
    paling: float = Field(4.0, gt=0, le=120, description="Age of rot at which it is halfway to that colour [day]")
    rings: Share = Field(0.0, description="How dark rings of one age are in it, over its colour [1]")
    ring: float = Field(2.5, gt=0, le=60, description="Age from one ring to the next [day]")


class Peel(BaseModel):
    """Skin, stem and calyx of a fruit."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    roughness: Share = Field(0.35, description="Roughness of fresh skin: low is waxy [1]")
    bloom: Share = Field(0.0, description="Dust of wax on fresh skin, which rot and drying take away [1]")
    fuzz: Share = Field(0.0, description="Down on fresh skin, as sheen [1]")
    blush: Share = Field(0.0, description="How much of the skin's shaded side has the second colour [1]")
    blush_colour: Colour = Field((0.6, 0.5, 0.1), description="The second colour, linear red, green, blue [1]")
    streak: Share = Field(0.0, description="How far the second colour runs in streaks from pole to pole [1]")
    spots: float = Field(0.0, ge=0, le=5000, description="Lenticels or pores on an area of r1^2 [1/r1^2]")
    spot_radius: float = Field(0.01, gt=0, le=0.1, description="Radius of a large one [r1]")
    spot_height: float = Field(0.0, ge=-0.05, le=0.05, description="Its height; negative: a pit [r1]")
    spot_colour: Colour = Field((0.5, 0.4, 0.25), description="Its colour, linear red, green, blue [1]")
    spot_cover: Share = Field(0.0, description="Share of the skin's colour that it hides [1]")
    subsurface: Share = Field(0.2, description="Share of the light that goes on below the skin [1]")
    stem: float = Field(0.0, ge=0, le=2, description="Length of the stem; 0: none [r1]")
    stem_width: float = Field(0.05, gt=0, le=0.5, description="Width of the stem [r1]")
    stem_colour: Colour = Field((0.13, 0.08, 0.035), description="The stem, linear red, green, blue [1]")
    sepals: int = Field(0, ge=0, le=12, description="Sepals of the calyx; 0: none [1]")
    sepal: float = Field(0.1, gt=0, le=1, description="Length of a sepal [r1]")
    sepal_width: float = Field(0.05, gt=0, le=0.5, description="Width of a sepal [r1]")
    sepal_lift: float = Field(0.2, ge=-1, le=2, description="How far a sepal's tip stands off, over its length [1]")
    sepal_colour: Colour = Field((0.06, 0.12, 0.02), description="Fresh sepals, linear red, green, blue [1]")
    sepals_at_stem: bool = Field(True, description="Whether the calyx is about the stem, or at the other end [1]")


#: Water-soaked, tan; softened rind of its own colour; brown and wet; dark, firm, dull.
LESIONS: Mapping[str, Lesion] = {
    "penicillium-expansum": Lesion(colour=(0.26, 0.13, 0.045), cover=0.92, roughness=0.34),
    "penicillium-digitatum": Lesion(colour=(0.47, 0.23, 0.06), cover=0.7, roughness=0.42),
    "neofabraea": Lesion(
        colour=(0.095, 0.036, 0.012), cover=0.95, roughness=0.68, middle=(0.40, 0.225, 0.10), rings=0.18, ring=4.0
    ),
    "rhizopus": Lesion(colour=(0.17, 0.072, 0.026), cover=0.85, roughness=0.33),
}

_SEPALS: dict[str, Any] = {"sepals": 5, "sepals_at_stem": False, "sepal": 0.13, "sepal_width": 0.07, "sepal_lift": 0.5}
_DRY = (0.10, 0.065, 0.03)

#: By fruit: lenticels of apple and pear, oil glands of the orange, down of the peach; stems, and what is left of the
#: flower, at the other end but for the tomato's star and the orange's button.
PEELS: Mapping[str, Peel] = {
    "apple": Peel(
        roughness=0.3, bloom=0.15, blush=0.6, blush_colour=(0.55, 0.40, 0.07), streak=0.6, spots=60, spot_radius=0.02,
        spot_colour=(0.80, 0.62, 0.36), spot_cover=0.9, subsurface=0.15, stem=0.45, stem_width=0.055,
        sepal_colour=_DRY, **_SEPALS,
    ),
    "orange": Peel(
        roughness=0.38, spots=700, spot_radius=0.014, spot_height=-0.006, spot_colour=(0.62, 0.16, 0.01),
        spot_cover=0.35, subsurface=0.25, stem=0.05, stem_width=0.09, stem_colour=(0.16, 0.17, 0.06), sepals=5,
        sepal=0.12, sepal_width=0.10, sepal_lift=0.12, sepal_colour=(0.10, 0.15, 0.04),
    ),
    "peach": Peel(
        roughness=0.8, fuzz=0.7, blush=0.75, blush_colour=(0.42, 0.05, 0.03), streak=0.15, subsurface=0.3, stem=0.09,
        stem_width=0.10,
    ),
    "pear": Peel(
        roughness=0.42, blush=0.3, blush_colour=(0.50, 0.26, 0.06), spots=260, spot_radius=0.014,
        spot_colour=(0.22, 0.16, 0.05), spot_cover=0.7, spot_height=0.0015, subsurface=0.2, stem=0.5, stem_width=0.06,
        sepal_colour=_DRY, **_SEPALS,
    ),
    "tomato": Peel(
        roughness=0.2, blush=0.2, blush_colour=(0.62, 0.20, 0.03), subsurface=0.3, stem=0.22, stem_width=0.07,
        stem_colour=(0.07, 0.15, 0.02), sepals=5, sepal=0.55, sepal_width=0.14, sepal_lift=0.12,
        sepal_colour=(0.05, 0.13, 0.015),
    ),
}  # fmt: skip
