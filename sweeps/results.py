"""What a store holds, as a table: one row per stage of a run, with its parameters and its numbers.

    from store.store import Store
    from sweeps import results

    rows = results.find(Store.open("demo"), where=["te<0.03"], sort="-roughness")
    results.dataset(rows).to_dataframe()

Rows come from the shards themselves, so that results of any solver, installed or not, with a ledger or without, are
listed. They never change; each is read once in a process.
"""

from __future__ import annotations

import hashlib
import json
import operator
import re
from collections.abc import Callable, Iterable, Mapping, MutableMapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from solver import quantities, registry
from solver.contract import SolverError
from store import seal
from store.canonical import canonical
from store.errors import NO_DAMAGE, CorruptShard
from store.store import Store

from .errors import InvalidOption

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Row", "columns", "dataset", "find", "named", "resolve"]

Value = float | int | bool | str

_OPERATORS: Mapping[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le, ">=": operator.ge, "!=": operator.ne, "==": operator.eq, "=": operator.eq, "<": operator.lt,
    ">": operator.gt,
}  # fmt: skip
_CONDITION = re.compile(rf"\s*(\w+)\s*({'|'.join(_OPERATORS)})\s*(.+?)\s*")
#: Fewest characters of a key that stand for it.
_SHORTEST = 4
#: Most characters of a parameter that is shown as it is; of larger ones (maps, meshes) letters of their hash.
_LONGEST = 80


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
        InvalidOption: a condition that cannot be read or met, or a name that no result has.
        CorruptShard: a result is damaged, and `damaged` is not given.

    """
    where = tuple(where)
    conditions = _conditions(where)
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
    _check(named(where, sort), found)
    _check_numbers(conditions, found)
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


def named(where: Iterable[str], sort: str | None) -> list[str]:
    """Return the names that conditions and an order are about, as they come.

    Raises:
        InvalidOption: a condition that cannot be read.

    """
    order = [sort.removeprefix("-")] if sort else []
    return list(dict.fromkeys([name for name, _, _ in _conditions(where)] + order))


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

    values, said = [row.values for row in rows], _said(rows)
    variables = {}
    for name in columns(rows):
        column = [each.get(name) for each in values]
        attrs = said.get(name, {"units": "1", "long_name": f"parameter {name}"})
        if any(isinstance(value, str) for value in column):
            words = ["" if value is None else str(value) for value in column]
            variables[name] = ("row", np.array(words), {"long_name": attrs["long_name"]})
            continue
        # a seed beyond 2^53 is no floating-point number
        whole = bool(column) and all(type(value) is int for value in column)
        data = column if whole else [np.nan if value is None else float(value) for value in column]
        variables[name] = ("row", np.array(data, dtype="int64" if whole else float), attrs)
    about = {"title": "results, one row per stage of each run", "Conventions": "CF-1.11"}
    return xr.Dataset(variables, attrs=about)


def _said(rows: Sequence[Row]) -> dict[str, dict[str, str]]:
    """Return unit and meaning of what the rows have, by name, as far as it is known: solvers may not be installed."""
    found = {name: {"long_name": name} for name in ("key", "solver", "version")}
    stages: list[dict[str, str]] = []
    for solver in dict.fromkeys(row.solver for row in rows):
        with suppress(SolverError):
            chosen = registry.get(solver)
            extras = {name: field.json_schema_extra for name, field in chosen.params.model_fields.items()}
            units = {name: str(extra.get("units", "1")) for name, extra in extras.items() if isinstance(extra, dict)}
            for name, unit in {**units, **chosen.axis_units()}.items():
                found.setdefault(name, {**quantities.unit_attrs(unit), "long_name": f"parameter {name}"})
            stages.append({"units": chosen.stages.units, "long_name": chosen.stages.long_name})
    for name in dict.fromkeys(["stage", *(name for row in rows for name in row.numbers)]):
        if known := quantities.QUANTITIES.get(name):
            found[name] = {"units": known.units, "long_name": known.long_name}
    if len(stages) == 1:  # of several solvers' stages there is no one meaning
        found["stage"] = stages[0]
    return found


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

    advice = "Delete the file and run the same sweep again; `wizen doctor --deep` looks at all there are."
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
    """Return the parameters by the names that they are swept by; what no such name reaches in words."""
    found = {name: value for name, value in params.items() if isinstance(value, int | float | str)}
    rest = {name: _words(value) for name, value in params.items() if isinstance(value, list | dict) and value}
    try:
        axes = registry.get(solver).params.axes
    except SolverError:
        return {**found, **rest}  # a solver that is not installed here
    for name, (field, index) in axes.items():
        value = params.get(field)
        if index is not None and isinstance(value, list) and index < len(value):
            value = value[index]
        if isinstance(value, int | float):
            found.pop(field, None)
            rest.pop(field, None)
            found[name] = value
    return {**found, **rest}


def _words(value: Any) -> str:
    """Return what tells a list or a map from another: as it is or, of what is long, some letters of its hash."""
    numbers = isinstance(value, list) and all(isinstance(one, int | float) for one in value)
    text = " ".join(f"{one:.12g}" for one in value) if numbers else json.dumps(value, sort_keys=True)
    if len(text) <= _LONGEST:
        return text
    return f"#{hashlib.sha256(canonical(value)).hexdigest()[:12]}"


def _conditions(where: Iterable[str]) -> list[tuple[str, str, str]]:
    return [_condition(part) for text in where for part in text.split(",")]


def _condition(text: str) -> tuple[str, str, str]:
    match = _CONDITION.fullmatch(text)
    if match is None:
        raise InvalidOption(
            f"--where {text.strip()!r} is no condition.", "Write for example te<0.03, or solver=growth."
        )
    name, sign, value = match.groups()
    if re.search("[<>=]", value):
        raise InvalidOption(
            f"--where {text.strip()!r} says more than one condition.", "Part them by commas: te<0.03,gamma>10."
        )
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


def _check_numbers(conditions: Iterable[tuple[str, str, str]], rows: Sequence[Row]) -> None:
    """Refuse words where all results have a number: no row would ever meet that."""
    for name, sign, wanted in conditions:
        values = [row.values[name] for row in rows if name in row.values]
        if _number(wanted) is None and values and not any(isinstance(value, str) for value in values):
            said = f"--where {f'{name}{sign}{wanted}'!r}: {name} is a number, and {wanted!r} is none."
            raise InvalidOption(said, f"Write for example {name}<0.03; several conditions are parted by commas.")


def _check(names: Iterable[str], rows: Sequence[Row]) -> None:
    known = columns(rows)
    for name in names:
        if rows and name not in known:
            raise InvalidOption(f"no result has {name!r}.", f"Known: {', '.join(known)}.")
