"""Methods of look-up: a weighting of samples, then corrections of what their weighted mean has lost.

A method is named by its parts, 'linear+LL+env': the weighting first, then the corrections in the order in which they
act. Weightings: `idw` (the paper's Eq. 13-14), `nearest`, `linear`, `scattered`, `thin`, `lean`. Corrections: `LL`
(power by degree) and `env` (local amplitude).
"""

from __future__ import annotations

import difflib
from functools import lru_cache
from typing import NamedTuple

from ...errors import OutsideTable

__all__ = ["CORRECTIONS", "DEFAULT", "NAMED", "OFFERED", "SPLINED", "WEIGHTINGS", "Method", "parse"]

WEIGHTINGS = ("idw", "nearest", "linear", "scattered", "thin", "lean")
#: Those that pass splines through samples that share their pattern.
SPLINED = ("thin", "lean")
CORRECTIONS = ("LL", "env")

#: What a query gets that names no method: splines where neighbours share their pattern, to s = 0.1 or 0.15, which are
#: half as far off as linear weights there; past it the nearest sample's pattern, from which the solver moves away least
#: (records dehydration-held-out and -score); and it is continuous, as `idw` and `nearest` are not.
DEFAULT = "lean+LL+env"

#: The methods that are scored against each other; others can be composed from the same parts.
NAMED = (
    *("nearest", "idw", "idw+LL", "idw+LL+env", "linear", "linear+LL", "linear+LL+env"),
    *("thin", "thin+LL+env", "lean", DEFAULT),
)
#: Those that are named to askers: what nobody scores is there, too.
OFFERED = (*NAMED, "scattered", "scattered+LL+env")


class Method(NamedTuple):
    """A weighting and the corrections after it."""

    weighting: str
    corrections: tuple[str, ...]

    def __str__(self) -> str:
        return "+".join((self.weighting, *self.corrections))


@lru_cache(maxsize=64)
def parse(name: str) -> Method:
    """Return the method of a name; corrections come out in the order in which they act.

    Raises:
        OutsideTable: a part of it is unknown or repeated.

    """
    first, *rest = name.split("+")
    for part, known in ((first, WEIGHTINGS), *((part, CORRECTIONS) for part in rest)):
        if part not in known:
            near = difflib.get_close_matches(part, known, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise OutsideTable(f"there is no look-up method {name!r}.", f"{hint}Known: {', '.join(OFFERED)}.")
    if len(set(rest)) < len(rest):
        raise OutsideTable(f"the method {name!r} names a correction twice.", "Name it once.")
    return Method(first, tuple(part for part in CORRECTIONS if part in rest))
