"""What a solver's results look like besides their shape, and what pages and pictures call them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..arrays import Array

__all__ = ["Fur", "Label", "Looks", "Matter", "Part", "Place", "Shade", "Skin"]


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


class Shade(NamedTuple):
    """A surface without fields of its own, for pages: colours as #rrggbb (sRGB), each fresh and at the last stage.

    coat: waxy gloss, 0 to 1. bloom: the dust that settles on ridges, and how much of it, 0 to 1.
    """

    ridge: tuple[str, str]
    furrow: tuple[str, str]
    roughness: tuple[float, float]
    coat: float = 0.0
    bloom: str = "#ffffff"
    bloom_amount: float = 0.0


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

    def to_json(self) -> dict[str, Any]:
        """Return what a page wants to know, as JSON values."""
        named: dict[str, Mapping[str, Any]] = {"labels": self.labels, "shades": self.shades, "places": self.places}
        said = {key: {name: value._asdict() for name, value in values.items()} for key, values in named.items()}
        known = {"opens": self.inside is not None, "grows": self.fur is not None}
        return {"layers": list(self.layers), "advance": self.advance, **known, **said}
