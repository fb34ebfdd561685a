"""Milliseconds of a frame by part: fields, body and skin of an animation, against the paper's 10 s.

    python -m benchmarks.decay.frames [preset] [day,day ...] [frames a day] [frames]

Default quality; each frame starts from the march's last shape, one a frame behind it. CPU time of one thread, means.
"""

from __future__ import annotations

import sys
import time

from benchmarks.figures import Sheet
from solver.contract import Context, SolverError
from solver.decay import SOLVER, DecayParams
from solver.decay.body.body import Body
from solver.decay.body.flesh import Skin
from solver.decay.body.wrinkles import Wrinkles
from solver.decay.fields.stepping import march
from solver.decay.fields.system import System
from solver.decay.settings import choose


def frames(preset: str, day: float, rate: float, count: int) -> dict[str, float]:
    """Return milliseconds of fields, body and skin of a frame."""
    params = SOLVER.parse({"body": "quasi-static", "te": 0.03, "skin": {"shrinkage": 0.5}}, preset)
    assert isinstance(params, DecayParams)
    settings = choose(params, "default")
    system = System(params, settings.cells, True)
    body = Body(params, system.surface, settings.cells, settings.layers, settings.balance)
    skin = Wrinkles(params, Skin(shrinkage=0.5), body, settings)
    # the first two frames compile and find the shape to start from
    days = tuple(day + k / rate for k in range(count + 2))
    balance, folds = None, None
    spent = {"fields": 0.0, "body": 0.0, "skin": 0.0}
    begun = time.process_time()
    for k, reached in enumerate(march(system, days, settings.tolerance, settings.longest, Context())):
        fields = time.process_time() - begun
        rot = system.rot.share(reached.state.rot)
        begun = time.process_time()
        balance = body.settled(body.state(reached.state.water, rot), balance)
        moved = time.process_time() - begun
        begun = time.process_time()
        folds = skin.at(balance, folds)
        wrinkled = time.process_time() - begun
        if k >= 2:
            for name, seconds in zip(spent, (fields, moved, wrinkled), strict=True):
                spent[name] += 1e3 * seconds / count
        begun = time.process_time()
    return spent


def main(preset: str = "apple", days: str = "10,25", rate: float = 24.0, count: int = 6) -> None:
    head = ("frames about day", "fields", "body", "skin", "sum", "against the paper's 10 s")
    sheet = Sheet("decay-frames", head, "decay")
    for day in map(float, days.split(",")):
        told = {"preset": preset, "day": day, "frames_a_day": rate, "frames": count}
        try:
            spent = frames(preset, day, rate, count)
        except SolverError as error:
            sheet.add((f"{preset}, {day:g}", str(error), *[""] * 4), **told, failed=str(error))
            continue
        whole = sum(spent.values())
        cells = [f"{took:.0f} ms" for took in (*spent.values(), whole)]
        sheet.add(
            (f"{preset}, {day:g}", *cells, f"{1e4 / whole:.0f} times"),
            **told, ms=spent,
        )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((str, str, float, int), sys.argv[1:], strict=False)))
