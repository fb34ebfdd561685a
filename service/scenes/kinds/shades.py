"""Skins of things that have no colours of their own."""

from __future__ import annotations

import difflib

from solver.contract import InvalidInput, Shade, Solver

__all__ = ["DUMMY", "PLAIN", "shade_of"]

#: What nobody says a skin of.
PLAIN = "plain", Shade(("#b8aea2", "#8d8278"), ("#b8aea2", "#8d8278"), (0.6, 0.7))
#: What stands in for something else, and shall not be taken for it.
DUMMY = "placeholder", Shade(("#8a97a8", "#8a97a8"), ("#8a97a8", "#8a97a8"), (0.9, 0.9))


def shade_of(solver: Solver, named: str | None, preset: str | None) -> tuple[str, Shade]:
    """Return the skin that is named, else the one whose name begins a preset's, else the plainest.

    Raises:
        InvalidInput: there is no skin of that name.

    """
    shades = solver.looks.shades
    if named is not None:
        if named not in shades:
            near = difflib.get_close_matches(named, list(shades), n=1)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            known = f"Known: {', '.join(shades)}." if shades else "Leave it out."
            raise InvalidInput(f"{solver.name} has no skin {named!r}.", advice=f"{hint}{known}")
        return named, shades[named]
    own = solver.looks.shade_of(() if preset is None else (preset,))
    return own or (list(shades.items())[-1] if shades else PLAIN)
