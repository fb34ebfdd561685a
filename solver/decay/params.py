"""Parameters of a decay run: the fruit, what lives on it, the air about it, and where it was wounded."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from ..fruit import Fruit
from ..painted import Painted, Photo
from .body.flesh import Flesh, Skin, Swing
from .dress.peel import LESIONS, PEELS, Lesion, Peel
from .fields.colony import MOULDS, ROTS, Colony
from .fitting import contradiction
from .heap.given import Heap
from .hyphae import FURS, Hyphae
from .surfaces.cut import Cut
from .surfaces.imported import Mesh
from .surfaces.places import Neighbour, Pressure, PressureMap, Wound
from .within.given import Within
from .within.oven import Oven

__all__ = ["DecayParams", "Weather", "Wound"]

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Weather(BaseModel):
    """The air on one day; between two days it changes evenly."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    day: float = Field(ge=0, le=120, description="Time since the wounds", json_schema_extra={"units": "day"})
    temperature: float = Field(
        ge=-10, le=60, description="Temperature of air and fruit", json_schema_extra={"units": "degC"}
    )
    humidity: float = Field(ge=0, le=100, description="Relative humidity", json_schema_extra={"units": "percent"})


class DecayParams(Fruit):
    """Kider, Raja and Badler 2011: nutrient, soft rot and mould on the fruit's own surface; time in days."""

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {
        **Fruit.axes,
        "temperature": ("temperature", None),
        "humidity": ("humidity", None),
        "porosity": ("porosity", None),
        "water": ("water_content", None),
        "growth": ("growth_rate", None),
        "propagation": ("propagation_rate", None),
        "firmness": ("firmness", None),
    }

    temperature: float = Field(
        22.2, ge=-10, le=60, description="Temperature of air and fruit", json_schema_extra={"units": "degC"}
    )
    humidity: float = Field(
        50.0, ge=0, le=100, description="Relative humidity of the air", json_schema_extra={"units": "percent"}
    )
    weather: tuple[Weather, ...] = Field(
        (),
        max_length=1000,
        description="The air in the course of time, in place of temperature and humidity; days in rising order",
        json_schema_extra={"units": "1", "along": "day"},
    )
    porosity: float = Field(
        25.0, ge=0, le=100, description="Porosity of the skin (Table 2)", json_schema_extra={"units": "percent"}
    )
    water_content: float = Field(
        84.0, ge=1, le=99, description="Water in the fresh fruit, by weight", json_schema_extra={"units": "percent"}
    )
    weight: float = Field(138.0, ge=0.1, le=20000, description="Fresh weight", json_schema_extra={"units": "g"})
    transpiration: float = Field(
        0.17,
        ge=0,
        le=50,
        description="Mass transfer coefficient K of Eq. 10",
        json_schema_extra={"units": "g m-2 s-1 MPa-1"},
    )
    climate: Literal["cardinal", "paper"] = Field(
        "cardinal",
        description="How temperature and humidity bear on growth: by each species' cardinal temperatures, water "
        "activity and lag, or by Eq. 6 as printed, which damps motility alone and knows no frost",
        json_schema_extra={"units": "1"},
    )
    open_transpiration: float = Field(
        3.0,
        ge=0,
        le=50,
        description="Mass transfer coefficient of rotten or wounded skin; a choice; the paper's climate knows none",
        json_schema_extra={"units": "g m-2 s-1 MPa-1"},
    )
    growth_rate: float = Field(
        50.0,
        ge=0,
        le=100,
        description="The clock of all organisms: 50 is as quick as they were measured, or in the paper's climate their "
        "own pace (Table 2)",
        json_schema_extra={"units": "1"},
    )
    propagation_rate: float = Field(
        5.0,
        ge=0,
        le=9,
        description="Propagation rate of Table 2: a colony seeds 1 / (10 - rate) new ones per spawning",
        json_schema_extra={"units": "1"},
    )
    spawning: float = Field(
        0.5, ge=0, le=24, description="Spawnings of every colony in a day", json_schema_extra={"units": "1/day"}
    )
    spawn_reach: float = Field(
        0.5, ge=0.01, le=3.2, description="How far a new colony may land", json_schema_extra={"units": "radian"}
    )
    rot_spawning: float = Field(
        2.0,
        ge=0,
        le=100,
        description="Mould spores that land on the fruit in a day; one takes root with the probability of the rot map",
        json_schema_extra={"units": "1/day"},
    )
    nutrient: float = Field(
        1.0, gt=0, le=1, description="Mean nutrient of the fresh fruit, n0 of Table 3", json_schema_extra={"units": "1"}
    )
    unevenness: float = Field(
        0.3,
        ge=0,
        le=1,
        description="Largest random deviation of the fresh nutrient from its mean, over the mean",
        json_schema_extra={"units": "1"},
    )
    patch_size: float = Field(
        0.25,
        ge=0.05,
        le=3,
        description="Size of the patches of nutrient and of motility (Eq. 5)",
        json_schema_extra={"units": "r1"},
    )
    noise: float = Field(
        0.5,
        ge=0,
        le=0.9,
        description="Largest random deviation of motility, delta of Eq. 5; frozen in space",
        json_schema_extra={"units": "1"},
    )
    mould: Colony = Field(
        MOULDS["penicillium-expansum"],
        description="Kinetics of the mould",
        json_schema_extra={"units": "1"},
    )
    rot: Colony = Field(
        ROTS["penicillium-expansum"],
        description="Kinetics of the rot in the flesh: a mould's own lesion, or bacteria",
        json_schema_extra={"units": "1"},
    )
    hyphae: Hyphae = Field(
        FURS["penicillium-expansum"],
        description="Threads and spore heads of the mould in files and pictures; no field depends on them",
        json_schema_extra={"units": "1"},
    )
    peel: Peel = Field(
        PEELS["apple"],
        description="Skin, stem and calyx in files and pictures; no field depends on them",
        json_schema_extra={"units": "1"},
    )
    lesion: Lesion = Field(
        LESIONS["penicillium-expansum"],
        description="Skin over rot in files and pictures; no field depends on it",
        json_schema_extra={"units": "1"},
    )
    wounds: tuple[Wound, ...] = Field(
        (Wound(colatitude=0), Wound(colatitude=180)),
        max_length=64,
        description="Where rot and mould enter on day 0, to grow after their lag; by default the stem and the point "
        "the fruit rests on",
        json_schema_extra={"units": "1"},
    )
    wound_map: Painted = Field(
        (),
        description="Painted wounds: n rows of 2 n values, 1 where rot and mould enter on day 0",
        json_schema_extra={"units": "1"},
    )
    wound_photo: Photo | None = Field(
        None,
        description="Wounds in a photograph that the fruit fills: white where rot and mould enter on day 0",
        json_schema_extra={"units": "1"},
    )
    nutrient_map: Painted = Field(
        (),
        description="Painted nutrients: n rows of 2 n values that the fresh nutrient is multiplied by, skin and flesh",
        json_schema_extra={"units": "1"},
    )
    nutrient_photo: Photo | None = Field(
        None,
        description="Nutrients by a photograph's brightness, over the mean one, on the half that it shows; a choice",
        json_schema_extra={"units": "1"},
    )
    seeds: Literal["wounds", "contacts"] = Field(
        "wounds",
        description="Where decay enters: the wounds, or the stem, the floor and the neighbours that are touched",
        json_schema_extra={"units": "1"},
    )
    neighbours: tuple[Neighbour, ...] = Field(
        (),
        max_length=64,
        description="Round fruits beside this one, which a body that moves leans on",
        json_schema_extra={"units": "1"},
    )
    mesh: Mesh | None = Field(
        None,
        description="A triangle mesh in place of the fruit's surface, closed or open; fields are those of its vertices",
        json_schema_extra={"units": "r1"},
    )
    cuts: tuple[Cut, ...] = Field(
        (),
        max_length=8,
        description="Planes that each take a part of the fruit away: a half, a slice, a wedge, with its cut faces bare",
        json_schema_extra={"units": "1"},
    )
    heap: Heap | None = Field(
        None,
        description="Many such fruits in one run, that lie on each other and infect each other; without, one alone",
        json_schema_extra={"units": "1"},
    )
    within: Within | None = Field(
        None,
        description="Rot, nutrient and water as fields in the flesh, coupled to the skin's; without, rot and nutrient "
        "are those of the skin, fade out below it, and all flesh dries alike",
        json_schema_extra={"units": "1"},
    )
    oven: Oven | None = Field(
        None,
        description="Hot air that the fruit is cooked in from day 0 on (stages are small parts of a day); nothing rots "
        "in it. Its flesh has fields of its own",
        json_schema_extra={"units": "1"},
    )
    pressure: tuple[Pressure, ...] = Field(
        (),
        max_length=64,
        description="Pressure points: where the body's flesh is stiffer or softer, longer or shorter",
        json_schema_extra={"units": "1"},
    )
    pressure_map: PressureMap | None = Field(
        None, description="Painted pressure map of the body", json_schema_extra={"units": "1"}
    )
    body: Literal["none", "quasi-static", "paper", "table"] = Field(
        "none",
        description="How the body moves: not at all, from equilibrium to equilibrium, as the paper's springs, or as "
        "the dehydration table says of a fruit that shrank so far (rot and weight do not bear on it)",
        json_schema_extra={"units": "1"},
    )
    swing: Swing = Field(
        Swing(), description="Step and damping of the paper's springs", json_schema_extra={"units": "1"}
    )
    march: float | None = Field(
        None,
        ge=0.01,
        le=120,
        description="Days between the shapes that later ones are settled from; without, each from the fresh fruit",
        json_schema_extra={"units": "day"},
    )
    firmness: float = Field(
        80.0, ge=0.01, le=1000, description="Firmness of the fresh flesh (Table 2)", json_schema_extra={"units": "1"}
    )
    flesh: Flesh = Field(Flesh(), description="What water and rot do to the flesh", json_schema_extra={"units": "1"})
    skin: Skin | None = Field(
        None,
        description="A skin that wrinkles on the body that moves; without one the surface follows the body",
        json_schema_extra={"units": "1"},
    )
    skin_colour: tuple[Share, Share, Share] = Field(
        (0.62, 0.10, 0.06), description="Fresh skin, linear red, green, blue", json_schema_extra={"units": "1"}
    )
    mould_colour: tuple[Share, Share, Share] = Field(
        (0.22, 0.33, 0.30),
        description="Mould that is no longer active, linear red, green, blue; its active rim is white",
        json_schema_extra={"units": "1"},
    )

    @property
    def keeps_shape(self) -> bool:
        """Whether the surface stays where it is fresh."""
        return self.body == "none"

    @model_validator(mode="after")
    def _together(self) -> Self:
        why = contradiction(self)
        if why:
            raise ValueError(why)
        return self

    @field_validator("weather")
    @classmethod
    def _rising(cls, value: tuple[Weather, ...]) -> tuple[Weather, ...]:
        if any(a.day >= b.day for a, b in pairwise(value)):
            raise ValueError("the days of the weather must rise: sort them, and give each day once")
        return value
