"""Seconds of body and skin by mesh, and the body's error against a finer one: one stage, fields already there.

    python -m benchmarks.decay.body [preset] [day]

Milliseconds are CPU time of one thread, the least of three.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.figures import Sheet
from solver.contract import Context
from solver.decay import SOLVER
from solver.decay.body.body import Body
from solver.decay.body.flesh import Skin
from solver.decay.body.wrinkles import Wrinkles
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.settings import choose

_CELLS = 32


def least(work: Callable[[], Any], times: int = 3) -> tuple[Any, float]:
    seconds = []
    for _ in range(times):
        begun = time.process_time()
        found = work()
        seconds.append(time.process_time() - begun)
    return found, round(1e3 * min(seconds), 1)


def main(preset: str = "apple", day: float = 20.0) -> None:
    params = SOLVER.parse({"body": "quasi-static", "te": 0.03}, preset)
    system = System(params, _CELLS, False)
    (reached,) = march(system, (day,), 1e-4, choose(params, "preview").longest, Context())
    rot, water = system.rot.share(reached.state.rot), reached.state.water

    def body(layers: int, tolerance: float) -> Body:
        return Body(params, system.surface, _CELLS, layers, tolerance)

    fine = body(12, 1e-6)
    there = fine.on_surface(fine.settled(fine.state(water, rot)))
    head = ("quality", "tetrahedra", "body", "Newton steps", "error", "skin's points", "skin")
    sheet = Sheet("decay-body", head, "decay")
    for quality in ("preview", "default"):
        settings = dataclasses.replace(choose(params, quality), cells=_CELLS)
        ours = body(settings.layers, settings.balance)
        state = ours.state(water, rot)
        balance, took = least(lambda ours=ours, state=state: ours.settled(state))  # type: ignore[misc]
        gap = ours.on_surface(balance) - there
        row = {"layers": settings.layers, "tetrahedra": len(ours.solid.tets), "body_ms": took, "newton": balance.steps}
        row["error"] = float(np.sqrt(np.sum(gap**2) / np.sum(there**2)))
        shell = Wrinkles(params, Skin(shrinkage=0.5), ours, settings)
        found, row["skin_ms"] = least(lambda shell=shell, balance=balance: shell.at(balance), 1)  # type: ignore[misc]
        row |= {"skin_vertices": len(found[0]), "skin_steps": found[2]}
        sheet.add(
            (quality, row["tetrahedra"], f"{took:.0f} ms", row["newton"], f"{row['error']:.1e}", row["skin_vertices"],
             f"{row['skin_ms'] / 1e3:.2g} s"),
            preset=preset, day=day, quality=quality, **row,
        )  # fmt: skip
    sheet.keep(reference_layers=12)


if __name__ == "__main__":
    given = sys.argv[1:]
    main(*(kind(text) for kind, text in zip((str, float), given, strict=False)))
