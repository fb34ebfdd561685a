"""Lists of what is meant to break a solver, tried one by one and printed as a table."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

__all__ = ["Broken", "show"]


class Broken(AssertionError):
    """A try ended as none may."""


def show(tries: Mapping[str, Callable[[], str]], chosen: Sequence[str]) -> None:
    """Print how each try ends, of those whose name holds a chosen word if any is; exit with 1 if one is broken."""
    broken = 0
    print("| try | end | CPU s |\n|---|---|---|")
    for name, case in tries.items():
        if chosen and not any(word in name for word in chosen):
            continue
        begun = time.process_time()
        try:
            end = case()
        except Broken as error:
            end, broken = f"BROKEN: {error}", broken + 1
        print(f"| {name} | {end} | {time.process_time() - begun:.1f} |", flush=True)
    if broken:
        raise SystemExit(1)
