"""What is to be matched: a mesh, the mask of a photograph, or numbers; and how shapes of tables are read to compare."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from solver.arrays import Array, Floats
from solver.lattice import closed_lattice, lattice
from store.lookup import ShapeTable

from ..errors import InvalidQuery, Unavailable, Wrong
from ..formats.sent import MESHES
from . import outline
from .signature import COARSE, FINE, Signature, Unreadable, signature

__all__ = ["KINDS", "Target", "read"]

#: Suffix -> media types of what may be matched.
KINDS: Mapping[str, tuple[str, ...]] = {
    **MESHES,
    ".png": ("image/png",),
    ".json": ("application/json",),
}
#: Descriptors that follow from the size alone, and the scatter of these and of others, as shares.
_SIZES, _TIGHT, _LOOSE = ("volume", "mean_radius"), 0.005, 0.05


class Look(NamedTuple):
    """What is compared of a shape of a table: values (k,) and scatter (k,); some may be unknown (nan)."""

    values: Floats
    scatter: Floats


class Target(Protocol):
    """Something to be matched."""

    kind: str
    parts: tuple[str, ...]
    about: dict[str, Any]

    @property
    def like(self) -> tuple[object, ...]:
        """What targets share that see shapes of tables alike."""

    def seen(self, coarse: bool) -> Look:
        """Return what it is like, for the first look at a table or for the search."""

    def of(self, table: ShapeTable, point: Mapping[str, float], stage: float, coarse: bool) -> Look:
        """Return the same of a shape of a table."""


def read(data: bytes, suffix: str, unit: float | None) -> Target:
    """Return the target in a file's bytes; `unit` is the length of r1 in its unit, None: unknown.

    Raises:
        InvalidQuery: it cannot be read, or holds nothing that can be matched.
        Unavailable: what reads such files is not installed.

    """
    if suffix not in KINDS:
        raise InvalidQuery.of([Wrong("target", f"{suffix or 'no suffix'} is not matched", f"Take {', '.join(KINDS)}.")])
    if unit is not None and not (math.isfinite(unit) and unit > 0):
        raise InvalidQuery.of(
            [Wrong("size", f"{unit:g} is no length", "Give r1 in the target's unit, or leave it out.")]
        )
    if suffix == ".json":
        if unit is not None:
            advice = "Leave it out: descriptors are in units of r1."
            raise InvalidQuery.of([Wrong("size", "means nothing for descriptors", advice)])
        return _Numbers(data)
    try:
        return _Mask(data, unit) if suffix == ".png" else _Mesh(*_mesh(data, suffix), unit)
    except Unreadable as error:
        advice = {
            True: "Cut the shape out: white on black, or on a transparent ground, whole and in the middle.",
            False: "Give a closed mesh of triangles around its middle, wound one way.",
        }[suffix == ".png"]
        raise InvalidQuery.of([Wrong("target", str(error), advice)]) from None


def _mesh(data: bytes, suffix: str) -> tuple[Array, Array]:
    from ..sequences.imported import load

    # readers of meshes look at files
    with tempfile.TemporaryDirectory(prefix="wizen-") as folder:
        path = Path(folder) / f"target{suffix}"
        path.write_bytes(data)
        try:
            return load(path)
        except InvalidQuery as error:
            raise InvalidQuery.of([Wrong("target", one.detail, one.advice) for one in error.wrong]) from None
        except Unavailable as error:
            raise Unavailable(error.message, advice=f"{error.advice} Or send an OBJ.") from None


def _points(table: ShapeTable, point: Mapping[str, float], stage: float, n: int) -> Array:
    """Return a shape's points and poles (2 n^2 + 2, 3) [r1] as they are blended: not put out of contact, which takes
    longer than all the rest and moves them by less than is compared here.
    """
    shape = table.at(point, stage, resolution=n, fields=("displacement",), apart=False)
    position = table.fresh(point).points(*lattice(n)) + shape.displacement
    found: Array = np.concatenate([position.reshape(-1, 3), position[[0, -1]].mean(axis=1)])
    return found


#: Lattices on which candidates are looked up: the one with about as many points as the target, which smooths as much.
_LATTICES = np.array([32, 48, 64, 80, 96, 112, 128])


class _Mesh:
    kind = "mesh"

    def __init__(self, points: Array, triangles: Array, unit: float | None) -> None:
        self._unit = unit
        used, inverse = np.unique(triangles, return_inverse=True)
        points, triangles = points[used], inverse.reshape(triangles.shape)
        self._seen: dict[bool, Signature] = {
            True: signature(points, triangles, unit, COARSE),
            False: signature(points, triangles, unit, FINE),
        }
        self.parts = self._seen[False].parts
        self._n = int(_LATTICES[np.argmin(abs(np.log(_LATTICES / np.sqrt(0.5 * len(points)))))])
        self.like: tuple[object, ...] = self.kind, unit is None, min(self._n, COARSE)
        self.about = {"vertices": len(points), "triangles": len(triangles), "radius": self._seen[False].radius}

    def seen(self, coarse: bool) -> Look:
        return Look(self._seen[coarse].values, self._seen[coarse].scatter)

    def of(self, table: ShapeTable, point: Mapping[str, float], stage: float, coarse: bool) -> Look:
        n = min(self._n, COARSE) if coarse else self._n
        known = None if self._unit is None else 1.0
        found = signature(_points(table, point, stage, n), closed_lattice(n), known, COARSE if coarse else FINE)
        return Look(found.values, found.scatter)


class _Mask:
    kind = "mask"

    def __init__(self, data: bytes, unit: float | None) -> None:
        self._unit = unit
        mask = outline.read(data)
        found = outline.of_mask(mask, unit)
        self._seen, self.parts = Look(found.values, found.scatter), found.parts
        self.like: tuple[object, ...] = self.kind, unit is None
        self.about = {"pixels": int(mask.sum()), "radius": found.radius}

    def seen(self, coarse: bool) -> Look:
        return self._seen

    def of(self, table: ShapeTable, point: Mapping[str, float], stage: float, coarse: bool) -> Look:
        n = COARSE if coarse or table.resolution <= COARSE else FINE
        found = outline.of_surface(_points(table, point, stage, n), None if self._unit is None else 1.0)
        return Look(found.values, found.scatter)


class _Numbers:
    kind = "descriptors"

    def __init__(self, data: bytes) -> None:
        try:
            found = json.loads(data)
        except (ValueError, RecursionError):
            raise InvalidQuery.of([Wrong("target", "is no JSON", _EXAMPLE)]) from None
        said = found.get("descriptors", found) if isinstance(found, dict) else None
        if not isinstance(said, dict) or not said:
            raise InvalidQuery.of([Wrong("target", "holds no descriptors", _EXAMPLE)])
        wrong, numbers = [], {}
        for name, value in said.items():
            pair = _pair(name, value)
            if pair is None:
                wrong.append(Wrong(str(name)[:40], "is neither a number nor a number with its scatter", _EXAMPLE))
            else:
                numbers[str(name)] = pair
        if wrong:
            raise InvalidQuery.of(wrong)
        self.parts = tuple(numbers)
        self.like: tuple[object, ...] = self.kind, *numbers
        self._seen = Look(*np.array(list(numbers.values())).T)
        self.about = {name: value for name, (value, _) in numbers.items()}

    def seen(self, coarse: bool) -> Look:
        return self._seen

    def of(self, table: ShapeTable, point: Mapping[str, float], stage: float, coarse: bool) -> Look:
        told = table.at(point, stage, fields=()).descriptors
        values = np.array([told.get(name, np.nan) for name in self.parts])
        return Look(values, self._seen.scatter)


_EXAMPLE = 'Write it like {"roughness": 0.04, "volume": [0.62, 0.01]}; GET /v1/shapes/SOLVER/info names descriptors.'


def _pair(name: str, value: Any) -> tuple[float, float] | None:
    """Return a number and its scatter, the usual one where none is given."""
    if isinstance(value, dict):  # as a shape's own page has it
        value = value.get("value")
    given = value if isinstance(value, list) else [value]
    if not all(isinstance(one, int | float) and not isinstance(one, bool) for one in given):
        return None
    try:
        numbers = [float(one) for one in given]
    except OverflowError:  # more digits than any number has
        return None
    if not all(map(math.isfinite, numbers)):
        return None
    if len(numbers) == 2 and numbers[1] > 0:
        return numbers[0], numbers[1]
    if len(numbers) != 1:
        return None
    share = _TIGHT if name in _SIZES else _LOOSE
    return numbers[0], max(share * abs(numbers[0]), 1e-6)
