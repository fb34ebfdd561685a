"""Name -> solver. A solver's module is imported when it is first asked for; heavy numerics only when it runs."""

from __future__ import annotations

import difflib
from functools import cache
from importlib import import_module
from pathlib import Path

from .contract import InvalidInput, Solver, Surface

__all__ = ["get", "names", "surface"]


@cache
def _ours() -> dict[str, str]:
    """Return name -> "module:attribute": of each folder beside this file that has a `run.py`, whose package offers
    SOLVER.
    """
    return {path.parent.name: f"solver.{path.parent.name}:SOLVER" for path in Path(__file__).parent.glob("*/run.py")}


@cache
def _places() -> dict[str, str]:
    """Return those and what joins through the entry-point group `wizen.solvers`."""
    # it reads a file of every installed distribution, which who asks for one of ours by name need not wait for
    from importlib.metadata import entry_points

    return {**{e.name: e.value for e in entry_points(group="wizen.solvers")}, **_ours()}


def names() -> tuple[str, ...]:
    """Return the names of all solvers, sorted."""
    return tuple(sorted(_places()))


@cache
def get(name: str) -> Solver:
    """Return the solver called `name`.

    Raises:
        InvalidInput: there is none of that name.

    """
    places = _ours() if name in _ours() else _places()
    if name not in places:
        near = difflib.get_close_matches(name, list(places), n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise InvalidInput(f"there is no solver {name!r}.", advice=f"{hint}Known: {', '.join(sorted(places))}.")
    module, _, attribute = places[name].partition(":")
    found: Solver = getattr(import_module(module), attribute)
    return found


def surface(name: str) -> Surface | None:
    """Return the fresh surface of the solver called `name`, as tables ask for it; None where it has none.

    A table outlives its solver: one that is no longer here has none either.
    """
    return get(name).surface if name in _ours() or name in _places() else None
