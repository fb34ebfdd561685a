"""One question over all tables of a solver: which family answers it.

What is said must fit, a preset's values like the asker's own. What nobody said is the solver's default, but what lone
tables and those called `default` or like the solver hold fixed, as these stand for themselves; a lone one asks for all
of its axes. Of several families that hold a fruit that of the best quality answers, of these the one called so, then
the one whose samples lie closest, then that of the finer waves. None of it hangs on where in a family a fruit lies:
each has a pattern of its own, and to go from one to the other within what both hold would be a jump.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array

from ..manifest import TableInfo
from .match import STAGE, Fit, compare, flat

__all__ = ["Base", "Families"]

_QUALITIES = ("fine", "default", "preview")


class Base(NamedTuple):
    """What questions start from: the solver's name, its defaults, what only says how a run is done, and its presets."""

    solver: str
    defaults: Mapping[str, Any]
    incidental: Collection[str]
    presets: Mapping[str, Mapping[str, Any]]


class _Still(NamedTuple):
    """What of a fit does not depend on the numbers of a question, only on their names."""

    fit: Fit
    known: Mapping[str, Any]
    tied: tuple[str, ...]


class Families:
    """The tables of one solver. `places` returns the samples (sample, axes) of one of them, on its own axes."""

    def __init__(self, infos: Sequence[TableInfo], base: Base, places: Callable[[TableInfo], Array | None]) -> None:
        self.infos = tuple(infos)
        self._count = len(self.infos)
        self._base = base
        self._places = places
        self._axes = infos[0].places if infos else {}
        self._usual = flat(base.defaults, self._axes)
        self._presets = {name: flat(values, self._axes) for name, values in base.presets.items()}
        self._still = lru_cache(maxsize=256)(self._stand)
        self._spacings: dict[str, float] = {}

    def only(self, name: str) -> Families:
        """Return these families with that one alone; what nobody says is still the solver's default."""
        found = Families([info for info in self.infos if info.name == name], self._base, self._places)
        found._count = self._count
        return found

    def values(self, said: Mapping[str, Any], preset: str | None = None) -> dict[str, Any]:
        """Return what is said, by the names that tables use: a preset's values, and over them the asker's."""
        return {**(self._presets[preset] if preset is not None else {}), **flat(said, self._axes)}

    def presets_of(self, info: TableInfo) -> list[str]:
        """Return the presets that lie in a table, whatever else is said."""
        return [
            name
            for name, values in self._presets.items()
            if not compare(info, values, self._counting(values), self._usual)
        ]

    def choose(self, said: Mapping[str, Any], stage: float | None, preset: str | None = None) -> Fit | None:
        """Return the fit of the family that answers, None if there is none; its `missing` axes have no value yet."""
        own = said if said.keys() <= self._axes.keys() else flat(said, self._axes)
        values = {**self._presets[preset], **own} if preset is not None else dict(own)
        if stage is not None:
            values[STAGE] = stage
        names = [*own, STAGE] if stage is not None else list(own)
        holding = [
            still.fit
            for still in self._still(preset, frozenset(own))
            if not compare(still.fit.info, {**still.known, **values}, [*names, *still.tied], self._usual)
        ]
        if len(holding) < 2:
            return holding[0] if holding else None
        least = min(len(fit.missing) for fit in holding)
        fits = [fit for fit in holding if len(fit.missing) == least]
        return fits[0] if len(fits) == 1 else min(fits, key=lambda fit: self._rank(fit.info))

    def filled(self, info: TableInfo, preset: str | None = None) -> dict[str, Any]:
        """Return the values for what an asker does not say of a table chosen among several: a preset's, and where there
        is none the solver's defaults on its axes.
        """
        return {**self._fills(info), **(self._presets[preset] if preset is not None else {})}

    def nearest(self, said: Mapping[str, Any], stage: float | None, preset: str | None = None) -> list[Fit]:
        """Return all families with what each misses, the nearest first: for a question that none of them holds.

        Who names a preset wants that fruit: families that hold all of it but what was said over it come before others.
        """
        values = self.values(said, preset) | ({STAGE: stage} if stage is not None else {})
        named = flat(said, self._axes).keys()
        fits = (self.fit(info, values, named) for info in self.infos)
        over = {*named, STAGE} if preset is not None else set()
        return sorted(fits, key=lambda fit: (not _misses_only(fit, over), fit.distance, fit.info.name))

    def fit(self, info: TableInfo, values: Mapping[str, Any], named: Collection[str] = ()) -> Fit:
        """Return how a table fits all that is said; what is incidental counts where it is `named`."""
        counting = [name for name in values if name in named or name not in self._base.incidental]
        rest = {} if self._is_own(info) else {k: v for k, v in self._usual.items() if k not in values}
        unsaid = [name for name in self._counting(rest) if name not in info.axes]
        return Fit(
            info,
            tuple(compare(info, values, counting, self._usual)),
            tuple(compare(info, {**rest, **values}, unsaid, self._usual)),
            tuple(name for name in info.axes if name not in values and name not in self._fills(info)),
        )

    def _stand(self, preset: str | None, names: frozenset[str]) -> tuple[_Still, ...]:
        """Return the families that fit as far as the preset and the defaults go, where `names` have other values."""
        found = []
        given = {k: v for k, v in (self._presets[preset] if preset is not None else {}).items() if k not in names}
        for info in self.infos:
            rest = {k: v for k, v in self._usual.items() if k not in names and k not in given}
            known = given if self._is_own(info) else {**rest, **given}
            counting = [k for k in self._counting(known) if k not in info.axes or k in given]
            tied = tuple(k for k in counting if k in info.tied and info.tied[k].leader in names)
            misses = compare(info, known, [k for k in counting if k not in tied], self._usual)
            if not misses:
                missing = tuple(k for k in info.axes if k not in {*given, *names, *self._fills(info)})
                found.append(_Still(Fit(info, (), (), missing), known, tied))
        return tuple(found)

    def _counting(self, values: Mapping[str, Any]) -> list[str]:
        """Return the names that count where nobody named them: all but the incidental ones."""
        return [name for name in values if name not in self._base.incidental]

    def _is_own(self, info: TableInfo) -> bool:
        return self._count == 1 or info.name in ("default", self._base.solver)

    def _fills(self, info: TableInfo) -> dict[str, Any]:
        """Return the defaults of a table's axes that lie on them; none of a lone table."""
        usual = {name: self._usual[name] for name in info.axes if name in self._usual}
        return {name: value for name, value in usual.items() if self._count > 1 and not compare(info, usual, [name])}

    def _rank(self, info: TableInfo) -> tuple[int, bool, float, int, str]:
        place = _QUALITIES.index(info.quality) if info.quality in _QUALITIES else len(_QUALITIES)
        return place, not self._is_own(info), round(self._spacing(info), 9), -info.resolution, info.name

    def _spacing(self, info: TableInfo) -> float:
        """Return the mean distance of a table's samples from the nearest other one; 0 of a single one."""
        if info.name not in self._spacings:
            samples = self._places(info)
            self._spacings[info.name] = 0.0 if samples is None else _spacing(samples)
        return self._spacings[info.name]


def _misses_only(fit: Fit, names: Collection[str]) -> bool:
    return all(miss.name in names for miss in (*fit.misses, *fit.unusual))


def _spacing(samples: Array) -> float:
    if len(samples) < 2:
        return 0.0
    is_ratio = (samples > 0).all(axis=0)
    points = np.where(is_ratio, np.log(np.where(is_ratio, samples, 1.0)), samples)
    nearest = [np.sort(np.square(points - point).sum(axis=1))[1] for point in points]
    return float(np.sqrt(nearest).mean())
