"""What a solver's results look like besides their shape, and what pages and pictures call them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array

__all__ = ["Fur", "Label", "Looks", "Matter", "Part", "Place", "Shade", "Skin", "Worn", "dryness", "linear"]

#: Share of the furrows' colour where a surface is neither ridge nor furrow.
FURROW = 0.2


class Skin(NamedTuple):
    """Colours (..., 3), linear light, and microfacet roughness (...), both 0 to 1.

    height: (...), of what is too fine for the mesh over it, in the result's unit of length; None where nobody knows.
    """

    colour: Array
    roughness: Array
    height: Array | None = None


class Matter(NamedTuple):
    """What one number says of a whole surface's material, 0 to 1 but for lengths.

    subsurface: share of the light that goes on below it, so far by red, green and blue in the result's unit of length.
    sheen: of down or dust that catches light at grazing angles.
    """

    subsurface: float
    reach: tuple[float, float, float]
    sheen: float


class Part(NamedTuple):
    """A small mesh that stands on a surface: points (v, 3) about its foot, y along the normal; triangles (f, 3).

    pole: where it stands, 0 or 1; -1: at the origin, y upwards, and not on the surface. vertex: which it stands on,
    where a mesh has several such things. colour: (v, 3), linear light. roughness: 0 to 1.
    """

    name: str
    pole: int
    points: Array
    triangles: Array
    colour: Array
    roughness: float
    vertex: int | None = None


class Fur(NamedTuple):
    """Threads that stand on a surface, by vertex (v): how many on a unit of area, how long, and their colours.

    foot, tip: (v, 3), linear light. ripe: share of the threads that carry a head. peak: the largest density that there
    may be. width, head: of a thread's foot, and radius of a head, 0 for none. lean: how far it leans, over its length;
    these three of all threads, or by vertex (v).
    """

    density: Array
    length: Array
    foot: Array
    tip: Array
    ripe: Array
    peak: float
    width: float | Array
    head: float | Array
    lean: float | Array


class Label(NamedTuple):
    """A short word for a parameter or for the stage, beside its slider."""

    symbol: str
    name: str


def dryness(stage: float, reach: tuple[float, float]) -> float:
    """Return the share of the way from the fresh shape to the last of stages that reach so far, 0 to 1."""
    last = max(reach, key=abs)
    return round(min(abs(stage / last), 1.0), 3) if last else 0.0


def linear(colour: str) -> Array:
    """Return a colour #rrggbb (sRGB, IEC 61966-2-1) in linear light, (3,)."""
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    found: Array = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return found


class Worn(NamedTuple):
    """A shade on what is so dry: colours (3,) of ridges and furrows in linear light, roughness, coat, and the bloom's
    colour as far as it covers ridges.

    thin: it has an inner side that may be seen.
    """

    ridge: Array
    furrow: Array
    roughness: float
    coat: float
    bloom: Array
    thin: bool = False

    @property
    def base(self) -> Array:
        """The factor (3,) over colours of vertices: 8 bits of a dark colour would be few."""
        found: Array = np.maximum(np.maximum(self.ridge, self.furrow), 1e-3)
        return found

    @property
    def smooth(self) -> Array:
        """What is neither ridge nor furrow (3,): of a fruit one sees its ridges."""
        return self.ridge + FURROW * (self.furrow - self.ridge)


class Shade(NamedTuple):
    """A surface without fields of its own: colours as #rrggbb (sRGB), each fresh and at the last stage.

    coat: waxy gloss, 0 to 1. bloom: the dust that settles on ridges, and how much of it, 0 to 1.
    """

    ridge: tuple[str, str]
    furrow: tuple[str, str]
    roughness: tuple[float, float]
    coat: float = 0.0
    bloom: str = "#ffffff"
    bloom_amount: float = 0.0

    def worn(self, dryness: float) -> Worn:
        """Return what it is on something that is so dry: 0 fresh, 1 at the last stage."""

        def between(pair: tuple[str, str]) -> Array:
            return linear(pair[0]) * (1 - dryness) + linear(pair[1]) * dryness

        rough = self.roughness[0] * (1 - dryness) + self.roughness[1] * dryness
        bloom = linear(self.bloom) * self.bloom_amount
        return Worn(between(self.ridge), between(self.furrow), rough, self.coat, bloom)


class Place(NamedTuple):
    """A place in a table worth a visit: the share of each axis' range (logarithmic over wide ones), and the stage."""

    shares: Mapping[str, float]
    stage: float


@dataclass(frozen=True)
class Looks:
    """Colours by field, and words.

    layers: fields that `paint` makes colours of, given any of them by name (...) and the run's parameters; it returns
    None where these say no colours. scalars: of a stage, which `paint` is given too where a result has them. constants:
    variables without a stage that `parts` is given beside these. fresh: one, if any, that says where on its fresh
    surface each vertex (v, 3) is, for `grain`, which is given the layers of texels too. fur: what
    stands on it, by the same fields; None where nothing grows. inside: fields of a cut face, from those of the
    surface above it and the flesh's own at it, the depth below it and the parameters; None where nothing is known of
    what lies there. aside: a field that is 1 on what only took part in the run, as a press, and does not belong to what
    came of it. labels: by axis or stage symbol. advance: the word for going along the stage axis. shades and places: by
    their names on pages.
    """

    layers: tuple[str, ...] = ()
    paint: Callable[[Mapping[str, Array], Mapping[str, Any]], Skin | None] | None = None
    scalars: tuple[str, ...] = ()
    constants: tuple[str, ...] = ()
    fresh: str = ""
    fur: Callable[[Mapping[str, Array], Mapping[str, Any]], Fur | None] | None = None
    grain: Callable[[Array, float, Mapping[str, Any], Mapping[str, Array]], Mapping[str, Array]] | None = None
    parts: Callable[[Mapping[str, Array], Mapping[str, Any]], Sequence[Part]] | None = None
    matter: Callable[[Mapping[str, Any]], Matter | None] | None = None
    inside: Callable[[Mapping[str, Array], Array, Mapping[str, Any]], Mapping[str, Array]] | None = None
    aside: str | None = None
    labels: Mapping[str, Label] = field(default_factory=dict)
    advance: str = "Play"
    shades: Mapping[str, Shade] = field(default_factory=dict)
    places: Mapping[str, Place] = field(default_factory=dict)

    def shade_of(self, names: Iterable[str]) -> tuple[str, Shade] | None:
        """Return the shade that begins the first of `names` that one begins, with its own name."""
        return next(((own, shade) for one in names for own, shade in self.shades.items() if one.startswith(own)), None)

    def to_json(self) -> dict[str, Any]:
        """Return what a page wants to know, as JSON values."""
        named: dict[str, Mapping[str, Any]] = {"labels": self.labels, "shades": self.shades, "places": self.places}
        said = {key: {name: value._asdict() for name, value in values.items()} for key, values in named.items()}
        known = {"opens": self.inside is not None, "grows": self.fur is not None}
        return {"layers": list(self.layers), "advance": self.advance, **known, **said}
