"""Lists of what is meant to break a solver, tried one by one and printed as a table."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence

from .figures import Sheet

__all__ = ["Broken", "demand", "show"]


class Broken(AssertionError):
    """A try ended as none may."""


def demand(fine: bool, what: str) -> None:
    """End the try where it is not `fine`.

    Raises:
        Broken: saying what.

    """
    if not fine:
        raise Broken(what)


def show(tries: Mapping[str, Callable[[], str]], chosen: Sequence[str], solver: str) -> None:
    """Print how each try ends, of those whose name holds a chosen word if any is; exit with 1 if one is broken.

    The first is tried twice, as the first time compiles; what only others need is compiled in their seconds.

    A whole list is kept as the record SOLVER-stress, broken tries and all.
    """
    broken = 0
    sheet = Sheet(f"{solver}-stress", ("try", "end", "CPU s"), solver)
    for name, case in tries.items():
        if chosen and not any(word in name for word in chosen):
            continue
        if not sheet.rows:
            with contextlib.suppress(Broken):
                case()
        begun = time.process_time()
        try:
            end = case()
        except Broken as error:
            end, broken = f"BROKEN: {error}", broken + 1
        seconds = time.process_time() - begun
        sheet.add((name, end, f"{seconds:.1f}"), **{"try": name, "end": end, "cpu": seconds})
    if not chosen:
        sheet.keep()
    if broken:
        raise SystemExit(1)
