"""The families in a store, and what to say to whom none of them can answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from solver.arrays import Array
from solver.contract import Solver

from ..errors import CorruptTable, OutsideTable, StaleTable, UnknownTable
from ..generations import generation
from ..manifest import TableInfo, directory, read_manifest
from ..store import Store
from .choose import Base, Families
from .match import STAGE, Fit, Miss, same

__all__ = [
    "base",
    "called",
    "check_version",
    "describe",
    "document",
    "families",
    "made",
    "refusal",
    "samples",
    "values",
]


def base(solver: Solver) -> Base:
    """Return what questions about shapes of a solver start from."""
    return Base(solver.name, solver.params.usual(), solver.incidental, solver.presets)


def families(store: Store, solver: Solver, read: Callable[[str], TableInfo] | None = None) -> Families:
    """Return the tables of a solver in a store; damaged ones do not hide the others. `read` returns a table's manifest.

    Raises:
        UnknownTable: it has none.

    """
    infos, broken = [], None
    for name in store.table_names():
        try:
            infos.append(read(name) if read is not None else read_manifest(store.tables_dir, name))
        except CorruptTable as error:
            broken = error
        except UnknownTable:
            continue  # deleted since the names were read
    own = [info for info in infos if info.solver == solver.name]
    if not own and broken is not None:
        raise broken
    if not own:
        raise UnknownTable(f"there is no table of {solver.name!r} yet.", "Run a sweep and build a table.")
    return Families(own, base(solver), lambda info: samples(store, info))


def samples(store: Store, info: TableInfo) -> Array | None:
    """Return the samples (sample, axes) of a table on its axes; None for a single one.

    Raises:
        CorruptTable, FileNotFoundError: its generation cannot be read.

    """
    return _samples(directory(store.tables_dir, info.name) / info.file, tuple(info.axes))


def values(store: Store, info: TableInfo) -> dict[str, list[float]]:
    """Return the values that a table's samples take on each of its axes, in ascending order."""
    found = samples(store, info)
    columns = [] if found is None else [np.unique(column).tolist() for column in found.T]
    return dict(zip(info.axes, columns, strict=True)) if columns else {}


@lru_cache(maxsize=256)
def _samples(path: Path, axes: tuple[str, ...]) -> Array | None:
    if not axes:
        return None
    opened = generation.read(path, axes)  # a generation's file never changes
    return np.stack([opened[name].values for name in axes], axis=-1)


def check_version(info: TableInfo, solver: Solver) -> None:
    """Refuse to answer from a table whose version solved something else than its solver does now.

    Raises:
        StaleTable: it is one; what to rebuild.

    """
    if not solver.answers_from(info.version):
        raise StaleTable(
            f"table {info.name!r} is of version {info.version} of {solver.name}, and this is {solver.version}.",
            f"Make it anew: `wizen table plan {info.name} > plan.toml`, `wizen sweep plan.toml`, "
            f"`wizen table build --plan plan.toml --name {info.name}`; or install the wizen that made it.",
        )


def made(info: TableInfo, solver: Solver) -> dict[str, Any]:
    """Return how a table's runs were done, where that is not the solver's default: what is incidental to the fruit."""
    usual = {name: field.default for name, field in solver.params.model_fields.items()}
    return {
        name: info.fixed[name]
        for name in solver.incidental
        if name in info.fixed and not same(info.fixed[name], usual.get(name))
    }


def describe(miss: Miss, info: TableInfo) -> tuple[str, str]:
    """Return what is wrong with a parameter that a table does not hold, and what to change."""
    if miss.reach is not None:
        span = _span(miss.reach)
        return f"{_said(miss.asked, 9)} is off the table's {span}", f"Take {miss.name} from {span}."
    if miss.name in info.tied:
        lead = info.tied[miss.name].leader
        detail = f"goes with {lead} in this table: {_said(miss.held)} there, not {_said(miss.asked)}"
    else:
        detail = f"this table holds {miss.name} = {_said(miss.held)} only"
    return detail, _changes([miss], info)


def _instead(fit: Fit) -> str:
    """Return what to say instead, all of it, so that a family that was not near enough holds the fruit."""
    more = [f"Give {name} from {_span(fit.info.axes[name])}." for name in fit.missing]
    return " ".join(["The nearest fruit that it holds:", _changes([*fit.misses, *fit.unusual], fit.info), *more])


def _changes(misses: Sequence[Miss], info: TableInfo) -> str:
    """Return what to say of parameters, so that a table holds them."""
    values, out, stages = [], [], []
    for miss in misses:
        if miss.name == STAGE:
            stages.append(f"Ask for the stage {_said(miss.held, 15)}.")
        elif miss.held in ("", None) or isinstance(miss.held, Mapping):
            out.append(miss.name)
        else:
            entries = miss.held if isinstance(miss.held, list | tuple) else (miss.held,)
            # between samples a follower lies on a curve, and may be a little off it
            written = (_said(entry, 6 if miss.name in info.tied else 15) for entry in entries)
            values.append(f"{miss.name}={','.join(written)}")
    told = [f"Set {', '.join(values)}."] if values else []
    return " ".join([*told, *([f"Leave {', '.join(out)} out."] if out else []), *stages])


def refusal(fits: Sequence[Fit]) -> OutsideTable:
    """Return the refusal of a question that no family holds; `fits` are as `Families.nearest` orders them."""
    near = fits[0]
    said = [
        f"{miss.name} = {_said(miss.asked, 9)} (holds {_span(miss.reach) if miss.reach else _said(miss.held)})"
        for miss in (*near.misses, *near.unusual)
    ]
    more = f" and {len(said) - 4} more" if len(said) > 4 else ""
    others = ", ".join(f"{fit.info.name} {fit.distance:.3g}" for fit in fits[1:4])
    return OutsideTable(
        f"no table holds this; {called(fits)} is {near.info.name!r}, {near.distance:.3g} away in "
        f"{', '.join(said[:4])}{more}.",
        _instead(near) + (f" Others: {others}." if others else ""),
    )


def called(fits: Sequence[Fit]) -> str:
    """Return what the first of `Families.nearest` is called: of a preset's fruit, another one may be nearer."""
    return "the nearest" if fits[0].distance <= min(fit.distance for fit in fits) else "the preset's own"


def document(fit: Fit) -> dict[str, Any]:
    """Return a family that was not near enough as JSON values."""
    return {
        "table": fit.info.name,
        "distance": round(fit.distance, 6),
        "parameters": {
            miss.name: {"asked": miss.asked, "nearest": miss.held, "distance": round(miss.distance, 6)}
            for miss in (*fit.misses, *fit.unusual)
        },
    }


def _span(reach: tuple[float, float]) -> str:
    # a bound that is rounded would be refused when it is typed
    return f"{_said(reach[0], 15)} to {_said(reach[1], 15)}"


def _said(value: Any, digits: int = 4) -> str:
    # what was asked for is told as it was: off by the last of few digits, it would read like what is held
    return f"{value:.{digits}g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)
