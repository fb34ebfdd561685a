"""Which table a command is about: the one that is named, or the one that holds what is asked."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import InvalidOption
from .console import note

if TYPE_CHECKING:
    from solver.contract import Solver
    from store.lookup import ShapeTable
    from store.manifest import TableInfo
    from store.store import Store

__all__ = ["asked_table", "begin_store", "open_store", "run_command", "solver_of"]


def open_store(root: Path | None) -> Store:
    """Open the store that a command names, or the one in the package.

    Raises:
        MissingStore: there is none.

    """
    from store import starter
    from store.store import Store

    return Store.open(root or starter.ROOT)


def begin_store(root: Path) -> Store:
    """Open a store, or begin one, and say so: a name may be mistyped.

    Raises:
        ReadOnlyStore: it cannot be made there.

    """
    from store.store import Store

    new = not (root / "shards").is_dir()
    opened = Store.open(root, create=True)
    if new:
        note(f"a new store in {root.absolute()}")
    return opened


def asked_table(
    root: Path | None,
    name: str | None,
    solver: str | None,
    said: Mapping[str, Any],
    stage: float | None,
    preset: str | None,
) -> tuple[ShapeTable, dict[str, Any]]:
    """Return the table that a question is for, and the question's values as that table names them.

    Raises:
        InvalidOption: tables of several solvers are there, and none is chosen.
        InvalidInput: there is no such preset, no fruit can be like that, what is said is no value or said twice, or no
            run has that stage.
        OutsideTable: no table holds what is asked; which is the nearest, and what differs.
        StaleTable: the table is of another version of the solver.
        UnknownTable, CorruptTable, MissingStore: there is no such table, it is damaged, or there is no store.

    """
    from solver import registry
    from solver.contract import Need
    from store.errors import OutsideTable
    from store.families import stored
    from store.lookup import ShapeTable

    opened = open_store(root)
    chosen = solver_of(opened, name, solver)
    chosen.params.check_given(said)
    if preset is not None and preset not in chosen.presets:
        chosen.parse({}, preset)  # says which there are
    families, filled = stored.families(opened, chosen), {}
    if name is None:
        fit = families.choose(said, stage, preset)
        if fit is None and (preset is not None or len(families.infos) > 1):
            # what no fruit can be is said before what no table holds
            values, near = chosen.parse(said, preset), families.nearest(said, stage, preset)
            _check_stage(chosen, stage, near[0].info)
            chosen.settle(Need.parse({} if stage is None else {"stages": (stage,)}), preset, (values,))
            error = stored.refusal(near)
            raise OutsideTable(
                error.message, f"{error.advice} To run it: {run_command(chosen.name, preset, said, stage)}"
            )
        # a lone table says itself what it does not hold
        info = families.infos[0] if fit is None else fit.info
        name, filled = info.name, families.filled(info)
    table = ShapeTable.open(opened, name, surfaces=registry.surface)
    stored.check_version(table.info, chosen)
    asked = {**filled, **families.values(said, preset)}
    # entries that no axis reaches are no names to ask by
    quiet = {key for key in asked if key not in said and (key in chosen.incidental or not key.isidentifier())}
    return table, {key: value for key, value in asked.items() if key not in quiet}


def _check_stage(solver: Solver, stage: float | None, near: TableInfo) -> None:
    """Refuse a stage that no run has, with what the nearest table holds: far less than runs have.

    Raises:
        InvalidInput: it is one.

    """
    from solver.contract import InvalidInput

    axis = solver.stages
    if stage is None or axis.lowest <= stage <= axis.highest:
        return
    low, high = near.reach
    raise InvalidInput(
        f"stage {stage:g} lies outside {axis.symbol} = {axis.lowest:g} to {axis.highest:g}, where runs are.",
        advice=f"The nearest table, {near.name!r}, holds {low:g} to {high:g}.",
    )


def solver_of(store: Store, name: str | None, solver: str | None) -> Solver:
    """Return the solver that is named, or that of the table that is, or the only one with tables.

    Raises:
        InvalidOption: tables of several solvers are there, and none is chosen.
        InvalidInput, UnknownTable: there is no such solver or table.

    """
    from solver import registry
    from store.tables import info

    return registry.get(solver or (_only_solver(store) if name is None else info(store, name).solver))


def run_command(solver: str, preset: str | None, said: Mapping[str, Any], stage: float | None) -> str:
    """Return what to type to have a shape solved."""
    words = ["wizen", "solve", solver, *(["--preset", preset] if preset else [])]
    for name, value in said.items():
        shown = ",".join(map(str, value)) if isinstance(value, list | tuple) else value
        words += ["--set", f"{name}={f'{value:.15g}' if isinstance(value, float) else shown}"]
    return shlex.join([*words, *([] if stage is None else ["--stages", f"{stage:.15g}"]), "--out", "shape.h5"])


def _only_solver(store: Store) -> str:
    from store.tables import info

    found = sorted({info(store, name).solver for name in store.table_names()})
    if len(found) != 1:
        raise InvalidOption(
            f"the store has tables of {', '.join(found)}." if found else "the store has no table of shapes.",
            "Choose with --solver or --name." if found else "Build one: `wizen table build`.",
        )
    return found[0]
