"""Milliseconds of a frame by part: fields, body, skin and output of an animation, against the paper's 10 s.

    python -m benchmarks.decay.frames [preset] [day,day ...] [frames a day] [frames] [cells]

Default quality on 41k vertices (64 cells); each frame starts from the march's last two shapes, one and two frames
behind. Output: places and maps of all vertices as 32-bit floats, laid on the floor, and the volume. CPU time of one
thread.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from statistics import median

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.figures import Sheet
from solver.contract import Context, SolverError
from solver.decay import SOLVER, DecayParams
from solver.decay.body.body import Body
from solver.decay.body.equilibrium import Balance
from solver.decay.body.flesh import Skin
from solver.decay.body.skin import Settled
from solver.decay.body.wrinkles import Wrinkles
from solver.decay.fields.stepping import Reached, march
from solver.decay.fields.system import System
from solver.decay.settings import choose

#: Frames before those that count: they compile, and find the shape to start from.
_FIRST = 2


def frames(preset: str, day: float, rate: float, count: int, cells: int) -> list[dict[str, float]]:
    """Return milliseconds of fields, body, skin and output of each frame."""
    params = SOLVER.parse({"body": "quasi-static", "skin": {"shrinkage": 0.5}}, preset)
    assert isinstance(params, DecayParams)
    settings = replace(choose(params, "default"), cells=cells)
    system = System(params, settings.cells, True)
    body = Body(params, system.surface, settings.cells, settings.layers, settings.balance)
    skin = Wrinkles(params, Skin(shrinkage=0.5), body, settings)
    days = tuple(day + k / rate for k in range(count + _FIRST))
    balance: Balance | None = None
    folds: Settled | None = None
    earlier: tuple[Balance | None, Settled | None] = (None, None)
    found = []
    begun = time.process_time()
    for reached in march(system, days, settings.tolerance, settings.longest, Context()):
        clock = [begun, time.process_time()]
        rot = system.rot.share(reached.state.rot)
        before = balance, folds
        balance = body.settled(body.state(reached.state.water, rot), balance, earlier=earlier[0])
        clock.append(time.process_time())
        folds = skin.at(balance, folds, earlier=earlier[1])
        earlier = before
        clock.append(time.process_time())
        points = system.surface.points + body.on_surface(balance) + skin.on_surface(folds.points)
        _handed(system, reached, body.obstacles.laid(points))
        clock.append(time.process_time())
        spent = 1e3 * np.diff(clock)
        found.append(dict(zip(("fields", "body", "skin", "output"), spent.tolist(), strict=True)))
        begun = time.process_time()
    return found[_FIRST:]


def _handed(system: System, reached: Reached, points: np.ndarray) -> tuple[bytes, float]:
    """Return a frame as bytes, and its volume [r1^3]."""
    assert system.mould is not None
    assert reached.state.mould is not None
    maps = [system.rot.share(reached.state.rot), system.mould.share(reached.state.mould), reached.state.mould.n]
    a, b, c = (points[system.surface.faces[:, k]] for k in range(3))
    volume = float(np.sum(a * np.cross(b, c))) / 6
    return b"".join(x.astype(np.float32).tobytes() for x in (points, *maps)), volume


def main(preset: str = "apple", days: str = "5,10,25", rate: float = 24.0, count: int = 12, cells: int = 64) -> None:
    head = ("frames about day", "fields", "body", "skin", "output", "sum: median", "worst", "against the paper's 10 s")
    sheet = Sheet("decay-frames", head, "decay")
    for day in map(float, days.split(",")):
        told = {"preset": preset, "day": day, "frames_a_day": rate, "frames": count, "vertices": 10 * cells**2 + 2}
        try:
            with threadpool_limits(1, user_api="blas"):  # as a run has it
                each = frames(preset, day, rate, count, cells)
        except SolverError as error:
            sheet.add((f"{preset}, {day:g}", str(error), *[""] * 6), **told, failed=str(error))
            continue
        whole = [sum(frame.values()) for frame in each]
        parts = {name: median(frame[name] for frame in each) for name in each[0]}
        cells_ = [f"{took:.0f} ms" for took in (*parts.values(), median(whole), max(whole))]
        sheet.add(
            (f"{preset}, {day:g}", *cells_, f"{1e4 / median(whole):.0f} times"),
            **told, ms=parts, median_ms=median(whole), worst_ms=max(whole),
        )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((str, str, float, int, int), sys.argv[1:], strict=False)))
