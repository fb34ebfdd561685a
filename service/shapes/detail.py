"""Level of detail: from what a scene can show to the lattice that is computed, and which part of it.

`resolution` names the lattice; `screen_px` says how large the picture is and leaves the choice to us. `region` takes a
part of the surface, `fields` and `components` some of its numbers. The answer says what was chosen.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from store.surfaces.window import WHOLE, Window

from ..errors import Wrong
from ..formats import Format

__all__ = ["NAMES", "PIXELS_PER_CELL", "Detail", "parameters", "read"]

#: What this module reads of a query.
NAMES = ("screen_px", "distance", "fov", "region", "fields", "components")

#: Pixels that a cell of the lattice covers, at most, where it faces the eye; shading hides smaller ones. So it is on a
#: sphere: over the package's presets cells are up to 5 pixels long where fruits are fresh, and 7 in folds.
PIXELS_PER_CELL = 4.0
#: Vertical angle of view [degree] of a camera whose distance is given without one.
_FOV = 40.0
#: Fewest colatitude samples that are chosen: what is small on the screen still has a silhouette.
_FEWEST = 8

#: Formats of numbers, which need no closed mesh.
_PARTIAL = ("npz",)
_FIELDS = ("position", "displacement")
_NUMBER = r"(-?[0-9]{1,4}(?:\.[0-9]{0,9})?)"
_REGION = re.compile(f"{_NUMBER}:{_NUMBER},{_NUMBER}:{_NUMBER}")


class Detail(NamedTuple):
    """How much of a shape is wanted. `cells` is the resolution that the screen asks for, None where none does."""

    cells: int | None = None
    window: Window = WHOLE
    fields: tuple[str, ...] | None = None
    region: str = ""
    wrong: tuple[Wrong, ...] = ()

    @property
    def key(self) -> tuple[str, ...]:
        """What tells two answers of one resolution apart."""
        return (repr((self.window, self.fields, self.cells)),) if self != _ALL else ()

    def of(self, chosen: Format) -> tuple[str, ...]:
        """Return the fields to look up for a format: its own, or those asked for; JSON is measured on them."""
        return chosen.fields if self.fields is None else self.fields

    def refused(self, chosen: Format) -> tuple[Wrong, ...]:
        """Return what is wrong, with the parts that a format cannot hold."""
        if not chosen.fields or chosen.name in _PARTIAL:
            return self.wrong
        named = {"region": bool(self.region), "fields": self.fields is not None}
        named["components"] = self.window.components != WHOLE.components
        advice = f"Ask for format={' or '.join(_PARTIAL)}, or leave it out."
        more = [name for name, is_it in named.items() if is_it]
        return (*self.wrong, *(Wrong(name, f"{chosen.title} holds a closed mesh only", advice) for name in more))

    def resolution(self, named: int | None, own: int, highest: int) -> int:
        """Return the one named, else the one for the screen, else the table's own."""
        return min(self.cells or own, highest) if named is None else named

    def _pixels(self, resolution: int) -> float:
        """Return how many pixels a sphere's cell facing the eye covers at most: more where a limit cut it short."""
        return round(PIXELS_PER_CELL * max((self.cells or 0) / resolution, 1), 3)

    def said(self, resolution: int, band: int) -> dict[str, Any]:
        """Return what was chosen, as plain JSON values, of a table whose waves reach to `band`."""
        if self == _ALL:
            return {}
        said: dict[str, Any] = {"resolution": resolution, "waves": min(band, resolution)}
        if self.cells is not None:
            said |= {"chosen_by": "screen_px", "pixels_per_cell": self._pixels(resolution), "wanted": self.cells}
        if self.region:
            patch = self.window.on(resolution)
            said["region"] = {"degrees": self.region, "rows": [patch.top, patch.height]}
            said["region"]["columns"] = [patch.left, patch.width]
        if self.fields is not None:
            said["fields"] = list(self.fields)
        if self.window.components != WHOLE.components:
            said["components"] = ["xyz"[i] for i in self.window.components]
        return said


#: Where nothing is asked for.
_ALL = Detail()


def parameters() -> dict[str, tuple[str, Mapping[str, Any]]]:
    """Return what each name means, and its JSON schema as a query parameter."""
    positive: dict[str, Any] = {"type": "number", "exclusiveMinimum": 0}
    return {
        "screen_px": (
            "Chooses the resolution, in place of `resolution`: pixels that 2 r1 fill, or with `distance` the picture's "
            f"height. Cells of a sphere of radius r1 that face the eye then cover {PIXELS_PER_CELL:g} pixels at most; "
            "more where the service allows no finer lattice, as `pixels_per_cell` of the answer's `detail` says. "
            "Those of longer fruits are up to a quarter longer, and where a skin is folded three quarters.",
            {**positive, "examples": [600]},
        ),
        "distance": ("From the eye to the fruit's nearest point [r1]; needs screen_px", {**positive, "examples": [3]}),
        "fov": (
            f"Vertical angle of view [degree], {_FOV:g} if not given; needs distance",
            {**positive, "exclusiveMaximum": 180},
        ),
        "region": (
            "Part of the surface: colatitude,azimuth from:to in degrees. The azimuth may pass 0. npz only.",
            {"type": "string", "pattern": f"^{_REGION.pattern}$", "examples": ["45:90,350:20"]},
        ),
        "fields": (
            "Fields with commas between them. npz holds them; with json, position measures the closed mesh.",
            {"type": "string", "pattern": "^(position|displacement)(,(position|displacement))?$"},
        ),
        "components": (
            "Components with commas between them, sent in the order x, y, z however they are named (`detail` says "
            "which); the others are not computed. npz only.",
            {"type": "string", "pattern": "^[xyz](,[xyz]){0,2}$", "examples": ["y", "x,z"]},
        ),
    }


def read(given: Mapping[str, str]) -> Detail:
    """Return the detail that the parameters ask for; what is wrong with them is in `wrong`."""
    if given.keys().isdisjoint(NAMES):
        return _ALL
    wrong: list[Wrong] = []
    cells = _cells(given, wrong)
    ranges = _region(given.get("region"), wrong)
    fields = _some("fields", given.get("fields"), _FIELDS, wrong)
    components = _some("components", given.get("components"), ("x", "y", "z"), wrong)
    numbers = WHOLE.components if components is None else tuple("xyz".index(name) for name in components)
    window = Window(*ranges, numbers) if ranges else Window(components=numbers)
    return Detail(cells, window, fields, given.get("region", "") if ranges else "", tuple(wrong))


def _cells(given: Mapping[str, str], wrong: list[Wrong]) -> int | None:
    """Return the resolution at which a cell of a sphere of radius r1 that faces the eye covers `PIXELS_PER_CELL`.

    Without a distance, the sphere's diameter of 2 r1 fills `screen_px`; with one, `screen_px` is the height of a
    picture taken with the angle of view `fov`, from `distance` r1 away from the nearest point of the fruit.
    """
    names = ("screen_px", "distance", "fov")
    numbers = {name: _positive(name, given[name], wrong) for name in names if name in given}
    if "screen_px" not in numbers:
        wrong += [Wrong(name, "means nothing without screen_px", "Add screen_px=") for name in numbers]
        return None
    if "resolution" in given:
        wrong.append(Wrong("screen_px", "chooses the resolution, and one is named", "Leave out one of the two."))
    if "fov" in numbers and "distance" not in numbers:
        wrong.append(Wrong("fov", "means nothing without distance", "Add distance="))
    pixels, distance, fov = (numbers.get(name, 0.0) for name in names)
    fov = fov if "fov" in numbers else _FOV
    if fov is not None and fov >= 180:
        wrong.append(Wrong("fov", f"{fov:g} degrees see backwards", "Take less than 180."))
    if wrong or pixels is None or distance is None or fov is None:
        return None
    height = 2 * distance * math.tan(math.radians(fov) / 2) if distance else 2.0  # of what the picture shows [r1]
    shown = math.pi * pixels / PIXELS_PER_CELL
    cells = min(shown / height, 1e6) if height > shown * 1e-6 else 1e6  # as near as one may come
    return max(_FEWEST, math.ceil(cells / 8) * 8)  # multiples of 8: fast transforms, and few lattices to keep


def _region(text: str | None, wrong: list[Wrong]) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return ranges of colatitude and azimuth [radian] of a text like 45:90,350:20 [degree]."""
    if text is None:
        return None
    match = _REGION.fullmatch(text)
    advice = "Write colatitude,azimuth in degrees, like 45:90,0:120: 0 to 180, and -360 to 360."
    if match is None:
        wrong.append(Wrong("region", f"{text[:40]!r} is not a region", advice))
        return None
    top, bottom, left, right = map(float, match.groups())
    if not 0 <= top < bottom <= 180 or not -360 <= left <= 360 or not -360 <= right <= 360 or left == right:
        wrong.append(Wrong("region", f"{text[:40]!r} is empty, or not on the surface", advice))
        return None
    return (math.radians(top), math.radians(bottom)), (math.radians(left), math.radians(right))


def _some(name: str, text: str | None, known: tuple[str, ...], wrong: list[Wrong]) -> tuple[str, ...] | None:
    """Return the names in a list with commas, in their own order."""
    if text is None:
        return None
    asked = text.split(",")
    if not set(asked) <= set(known) or len(set(asked)) < len(asked):
        wrong.append(Wrong(name, f"{text[:40]!r} is not a list of some of them", f"Known: {', '.join(known)}."))
        return None
    return tuple(part for part in known if part in asked)


def _positive(name: str, text: str, wrong: list[Wrong]) -> float | None:
    try:
        number = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        wrong.append(Wrong(name, f"{text[:40]!r} is not a positive number", "Write it like 600 or 2.5."))
        return None
    return number
