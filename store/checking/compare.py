"""How two generations of tables differ: in their samples, their displacements and their descriptors."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from solver import quantities
from solver.arrays import Array

from .. import seal
from ..blending.blend import complex_view
from ..canonical import canonical
from ..errors import CorruptTable, MixedSamples
from ..generations import generation
from ..surfaces import harmonics, spectra

__all__ = ["Comparison", "Difference", "Side", "compare"]

#: Digits in which two samples' parameters must agree to be one place.
_DIGITS = 9


class Side(NamedTuple):
    """One generation in numbers; `size` is the file's [byte]."""

    path: str
    digest: str
    solver: str
    version: str
    samples: int
    stages: tuple[float, ...]
    resolution: int
    dtype: str
    size: int


class Difference(NamedTuple):
    """B against A at one stage, over the samples of both: root mean square, and largest. `of` names a quantity."""

    of: str
    stage: float
    rms: float
    max: float
    units: str


class Comparison(NamedTuple):
    """Two sides, how many samples are in both and in one alone (by parameters), and what differs.

    `fixed` are parameters that each side holds constant but at another value; `differences` the displacement on the
    surface and every descriptor of both, at every stage of both.
    """

    a: Side
    b: Side
    common: int
    only_a: tuple[dict[str, float], ...]
    only_b: tuple[dict[str, float], ...]
    fixed: dict[str, tuple[Any, Any]]
    differences: tuple[Difference, ...]

    @property
    def equal(self) -> bool:
        """Whether both hold the same content to the last bit."""
        return self.a.digest == self.b.digest

    def to_json(self) -> dict[str, Any]:
        """Return the comparison as JSON values."""
        rows = [row._asdict() for row in self.differences]
        return {**self._asdict(), "a": self.a._asdict(), "b": self.b._asdict(), "differences": rows} | {
            "equal": self.equal
        }


def compare(a: Path, b: Path) -> Comparison:
    """Compare two generation files.

    Raises:
        FileNotFoundError: one is not there.
        CorruptTable: one is damaged.
        MixedSamples: they are of different solvers' surfaces, or have no axis in common.

    """
    with _opened(a) as left, _opened(b) as right:
        places = _places(left), _places(right)
        axes = [name for name in places[0] if name in places[1]]
        if not axes:
            raise MixedSamples("the tables have no parameter in common.", "Compare tables of one solver.")
        found = [_points(side, axes) for side in (left, right)]
        both = [point for point in found[0] if point in found[1]]
        pairs = [(found[0][point], found[1][point]) for point in both]
        stages = _stages(left["stage"].values, right["stage"].values)
        rows = list(_displacements(a, b, pairs, stages)) if pairs else []
        rows += _descriptors(left, right, pairs, stages) if pairs else []
        return Comparison(
            a=_side(a, left),
            b=_side(b, right),
            common=len(both),
            only_a=tuple(dict(zip(axes, p, strict=True)) for p in found[0] if p not in found[1]),
            only_b=tuple(dict(zip(axes, p, strict=True)) for p in found[1] if p not in found[0]),
            fixed=_fixed(left, right),
            differences=tuple(rows),
        )


@contextmanager
def _opened(path: Path) -> Iterator[xr.Dataset]:
    if not seal.is_whole(path):
        raise CorruptTable(f"{path} is damaged.", "Rebuild the table from the shards.")
    with generation.open(path) as opened:
        yield opened


def _side(path: Path, opened: xr.Dataset) -> Side:
    return Side(
        path=str(path),
        digest=str(opened.attrs["digest"]),
        solver=str(opened.attrs["solver"]),
        version=str(opened.attrs["solver_version"]),
        samples=opened.sizes["sample"],
        stages=tuple(opened["stage"].values.tolist()),
        resolution=opened.sizes["m"] - 1,
        dtype=str(opened["spectrum"].dtype),
        size=path.stat().st_size,
    )


def _places(opened: xr.Dataset) -> list[str]:
    """Return the names of the scalar parameters that a generation knows of each sample."""
    coords = opened.coords
    return [str(name) for name in coords if coords[name].dims == ("sample",) and name != "key"]


def _points(opened: xr.Dataset, axes: list[str]) -> dict[tuple[float, ...], int]:
    rows = zip(*(opened[name].values.tolist() for name in axes), strict=True)
    return {tuple(float(f"{value:.{_DIGITS}g}") for value in row): i for i, row in enumerate(rows)}


def _stages(a: Array, b: Array) -> list[tuple[float, int, int]]:
    """Return the common stages, with their place on both sides."""
    near = [(float(stage), i, int(np.abs(b - stage).argmin())) for i, stage in enumerate(a)]
    return [(stage, i, j) for stage, i, j in near if abs(b[j] - stage) < 1e-9]


def _fixed(left: xr.Dataset, right: xr.Dataset) -> dict[str, tuple[Any, Any]]:

    a, b = (json.loads(side.attrs["fixed"]) for side in (left, right))
    return {name: (a[name], b[name]) for name in a if name in b and canonical(a[name]) != canonical(b[name])}


def _displacements(
    a: Path, b: Path, pairs: list[tuple[int, int]], stages: list[tuple[float, int, int]]
) -> Iterator[Difference]:
    left, right = generation.map_spectra(a), generation.map_spectra(b)
    n = max(left.shape[-2], right.shape[-2]) - 1
    area = harmonics.area(n)
    for stage, i, j in stages:
        mean, worst = 0.0, 0.0
        for p, q in pairs:
            fields = [
                spectra.synthesize(complex_view(np.asarray(block)).astype(complex), n)
                for block in (left[p, i], right[q, j])
            ]
            square = ((fields[1] - fields[0]) ** 2).sum(axis=0)
            mean += float((area * square).sum()) / len(pairs)
            worst = max(worst, float(square.max()))
        yield Difference("displacement", stage, mean**0.5, worst**0.5, "r1")


def _descriptors(
    left: xr.Dataset, right: xr.Dataset, pairs: list[tuple[int, int]], stages: list[tuple[float, int, int]]
) -> list[Difference]:
    rows = []
    for name in map(str, left.data_vars):
        both = name in right and left[name].dims == right[name].dims == ("sample", "stage")
        if not both or name in generation.CONVERGENCE:
            continue
        values, others = left[name].values.astype(float), right[name].values.astype(float)
        for stage, i, j in stages:
            apart = np.array([others[q, j] - values[p, i] for p, q in pairs])
            rms, most = float(np.sqrt((apart**2).mean())), float(np.abs(apart).max())
            rows.append(Difference(name, stage, rms, most, quantities.in_words(left[name].attrs)))
    return rows
