"""What a store holds, as a table: one row per stage of a run, with its parameters and its numbers.

    from store.store import Store
    from sweeps import results

    rows = results.find(Store.open("demo"), where=["te<0.03"], sort="-roughness")
    results.dataset(rows).to_dataframe()

Rows come from the shards themselves, so that results of any solver, installed or not, with a ledger or without, are
listed. They never change; each is read once in a process.
"""

from __future__ import annotations

import json
import operator
import re
from collections.abc import Callable, Iterable, Mapping, MutableMapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from solver import quantities, registry
from solver.contract import SolverError
from store import seal
from store.errors import NO_DAMAGE, CorruptShard
from store.store import Store

from .errors import InvalidOption

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Row", "columns", "dataset", "find", "resolve"]

Value = float | int | bool | str

_OPERATORS: Mapping[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le, ">=": operator.ge, "!=": operator.ne, "==": operator.eq, "=": operator.eq, "<": operator.lt,
    ">": operator.gt,
}  # fmt: skip
_CONDITION = re.compile(rf"\s*(\w+)\s*({'|'.join(_OPERATORS)})\s*(.+?)\s*")
#: Fewest characters of a key that stand for it.
_SHORTEST = 4


class Row(NamedTuple):
    """One stage of a run: its key, its parameters (scalar axes by name, seed, quality) and its numbers by name."""

    key: str
    solver: str
    version: str
    params: Mapping[str, Value]
    stage: float
    numbers: Mapping[str, Value]

    @property
    def values(self) -> dict[str, Value]:
        """Everything by name; what is asked for by `where` and `sort`."""
        said = {"key": self.key, "solver": self.solver, "version": self.version}
        return {**said, **self.params, "stage": self.stage, **self.numbers}


def find(
    store: Store,
    solver: str | None = None,
    where: Iterable[str] = (),
    sort: str | None = None,
    last: bool = False,
    damaged: MutableMapping[str, CorruptShard] | None = None,
) -> list[Row]:
    """Return the rows that meet all conditions, sorted.

    Args:
        store: where to look.
        solver: only its results.
        where: NAME<VALUE and the like; several in one may be joined by commas.
        sort: a name; with a minus sign before it, the largest first. Rows without it come last.
        last: of each run, the last stage alone.
        damaged: takes what is wrong with results that cannot be read, by key; the others are listed.

    Raises:
        InvalidOption: a condition that cannot be read, or a name that no result has.
        CorruptShard: a result is damaged, and `damaged` is not given.

    """
    conditions = [_condition(part) for text in where for part in text.split(",")]
    found: list[Row] = []
    for key in iter(store.keys()):
        path = store.shard_path(key)
        try:
            rows = _rows(path, path.stat().st_mtime_ns)  # one that was damaged may have been replaced
        except CorruptShard as error:
            if damaged is None:
                raise
            damaged[key] = error
            continue
        found += rows[-1:] if last else rows
    _check([name for name, _, _ in conditions] + ([sort.removeprefix("-")] if sort else []), found)
    if solver is not None:
        found = [row for row in found if row.solver == solver]
    kept = [row for row in found if all(_meets(row.values, *condition) for condition in conditions)]
    if sort is None:
        return kept
    name = sort.removeprefix("-")
    # words and numbers do not compare: each kind among its own
    having = [row for row in kept if name in row.values]
    having.sort(key=lambda row: _order(row.values[name]), reverse=sort.startswith("-"))
    return having + [row for row in kept if name not in row.values]


def columns(rows: Sequence[Row]) -> list[str]:
    """Return the names that the rows have, in the order in which they are best read."""
    names: dict[str, None] = dict.fromkeys(("key", "solver", "version"))
    for row in rows:
        names |= dict.fromkeys(row.params)
    names["stage"] = None
    for row in rows:
        names |= dict.fromkeys(row.numbers)
    return list(names)


def dataset(rows: Sequence[Row]) -> xr.Dataset:
    """Return the rows as a dataset over `row`, with units; numbers that a row lacks are NaN, words empty."""
    import numpy as np
    import xarray as xr

    values = [row.values for row in rows]
    variables = {}
    for name in columns(rows):
        column = [each.get(name) for each in values]
        words = any(isinstance(value, str) for value in column)
        data = [str(v or "") for v in column] if words else [np.nan if v is None else float(v) for v in column]
        known = quantities.QUANTITIES.get(name)
        attrs = {} if words or known is None else {"units": known.units, "long_name": known.long_name}
        variables[name] = ("row", np.array(data, dtype=str if words else float), attrs)
    return xr.Dataset(variables)


def resolve(store: Store, beginning: str) -> str:
    """Return the key of a stored result from its first characters.

    Raises:
        InvalidOption: no key begins so, or several do, or there are too few characters.

    """
    found = [key for key in iter(store.keys()) if key.startswith(beginning.lower())]
    if len(beginning) >= _SHORTEST and len(found) == 1:
        return found[0]
    if len(found) > 1:
        near = ", ".join(key[:12] for key in found[:5])
        raise InvalidOption(f"{len(found)} results have a key that begins with {beginning!r}.", f"Say more of {near}.")
    if found:
        raise InvalidOption(f"{beginning!r} is short for a key.", f"Give at least {_SHORTEST} characters.")
    raise InvalidOption(f"no result has a key that begins with {beginning[:80]!r}.", "`wizen results` lists them.")


@lru_cache(maxsize=1 << 16)
def _rows(path: Path, stamp: int) -> tuple[Row, ...]:
    """Return the rows of one shard, whose seal is checked first: on a damaged one HDF5 may hang."""
    import xarray as xr

    advice = "`wizen table verify` looks closer; delete the file and run the same sweep again."
    try:
        if not seal.is_whole(path):
            raise CorruptShard(f"{path} is damaged: its bytes are not those that were written.", advice)
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False, decode_timedelta=False) as opened:
            stages = [float(stage) for stage in opened["stage"].values]
            numbers = {
                str(name): variable.values.tolist()
                for name, variable in opened.data_vars.items()
                if variable.dims == ("stage",) and variable.dtype.kind in "fiubUS"
            }
            attrs = dict(opened.attrs)
            params, need = json.loads(attrs["params"]), json.loads(attrs["need"])
    except NO_DAMAGE:
        raise
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise CorruptShard(f"{path} cannot be read ({type(error).__name__}: {error}).", advice) from error
    solver, version = str(attrs["solver"]), str(attrs["solver_version"])
    said = {**_scalars(solver, params), "quality": str(need.get("quality", ""))}
    return tuple(
        Row(path.stem, solver, version, said, stage, {name: each[i] for name, each in numbers.items()})
        for i, stage in enumerate(stages)
    )


def _scalars(solver: str, params: Mapping[str, Any]) -> dict[str, Value]:
    """Return the parameters of one value each, by the names that they are swept by."""
    found = {name: value for name, value in params.items() if isinstance(value, int | float | str)}
    try:
        axes = registry.get(solver).params.axes
    except SolverError:
        return found  # a solver that is not installed here
    for name, (field, index) in axes.items():
        value = params.get(field)
        if index is not None and isinstance(value, list) and index < len(value):
            value = value[index]
        if isinstance(value, int | float):
            found.pop(field, None)
            found[name] = value
    return found


def _condition(text: str) -> tuple[str, str, str]:
    match = _CONDITION.fullmatch(text)
    if match is None:
        raise InvalidOption(
            f"--where {text.strip()!r} is no condition.", "Write for example te<0.03, or solver=growth."
        )
    name, sign, value = match.groups()
    return name, sign, value


def _meets(values: Mapping[str, Value], name: str, sign: str, wanted: str) -> bool:
    if name not in values:
        return False
    value, number = values[name], _number(wanted)
    if isinstance(value, str):
        # a version or a key may consist of digits; only what comes before what is then a question of numbers
        both = (_number(value), number) if sign in ("<", ">", "<=", ">=") else (None, None)
        return _OPERATORS[sign](value, wanted) if None in both else _OPERATORS[sign](*both)
    return sign == "!=" if number is None else _OPERATORS[sign](value, number)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return {"true": 1.0, "false": 0.0}.get(text.lower())


def _order(value: Value) -> tuple[bool, Any]:
    return isinstance(value, str), value


def _check(names: Iterable[str], rows: Sequence[Row]) -> None:
    known = columns(rows)
    for name in names:
        if rows and name not in known:
            raise InvalidOption(f"no result has {name!r}.", f"Known: {', '.join(known)}.")
