"""How far the march is from what this machine can do: python -m benchmarks.dehydration.precision.roofline.

Preview at te 0.04, an eighth and the whole fruit, without contact, which is no matter of elements. Counted: operations
of the element algebra, and bytes that every array read and written takes. Measured, on one core in CPU seconds: a step
per element, multiply-adds alone, and copies over a working set like the march's. Then two threads against one, by the
clock, in turns; of short bursts the least, as other work on the machine only adds.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable

os.environ["NUMBA_NUM_THREADS"] = str(min(os.cpu_count() or 1, 2))

import numba
import numpy as np

from benchmarks.figures import Sheet
from solver.contract import Context
from solver.dehydration import SOLVER, DehydrationParams
from solver.dehydration.kernel import march
from solver.dehydration.kernel.elements import core_forces, exocarp_forces, one_point_forces
from solver.dehydration.kernel.layout import Layout
from solver.dehydration.motion import Motion
from solver.dehydration.settings import choose

from ..kernel import operations_of
from ..machine_limits import machine_limits

HEAD = (
    *("fruit", "elements", "operations", "bytes", "ns", "of multiply-adds", "of copies", "ns, least by arithmetic"),
    "ns, least by bytes", "two threads over one",
)  # fmt: skip
_AT, _STEPS = 0.1, 40
_THREADS = int(os.environ["NUMBA_NUM_THREADS"])


def _counted(layout: Layout) -> tuple[float, float]:
    """Return operations and bytes per element and step."""
    kinds = [0, 0, 0]
    for _, _, cores, _, exocarps in layout.strips.tolist():
        deep = max(cores - layout.full_levels, 0)
        kinds = [k + n for k, n in zip(kinds, (deep, cores - deep, exocarps), strict=True)]
    blocks = sum(kinds)
    forces = one_point_forces, core_forces, exocarp_forces
    operations = sum(operations_of(f) * n for f, n in zip(forces, kinds, strict=True)) / blocks
    sizes = (layout.one_point_planes, layout.core_planes, layout.exocarp_planes)
    planes = sum(4 * 16 * planes.shape[1] * n for planes, n in zip(sizes, kinds, strict=True))
    rest = sum(part.nbytes for part in (layout.face_offsets, layout.rows, layout.row_start, layout.inverse_mass))
    # a store of a force row fetches its line first; the state is gathered, then it and the velocity read and written
    moved = planes + rest + 3 * 4 * layout.force_rows + 5 * 16 * layout.nodes
    return operations, moved / layout.elements


def _measured(sheet: Sheet, name: str, mirrors: str, turns: int) -> None:
    params = SOLVER.parse({"te": 0.04, "gamma": 10.0, "mirrors": mirrors}, "sphere")
    assert isinstance(params, DehydrationParams)
    motion = Motion(params, choose(params, "preview", 0.3), Context())
    layout, (state, velocity) = motion.layout, motion.smooth(_AT)
    operations, moved = _counted(layout)
    limits = machine_limits(int(layout.nbytes()))

    def spent(threads: int, clock: Callable[[], float]) -> float:
        numba.set_num_threads(threads)
        begin = clock()
        march(layout, state, velocity, _STEPS, theta=(1 - _AT, 1 - _AT), damping=0.1, one_point=True)
        return clock() - begin

    # a second thread that waits takes processor time as well: not before the first has been measured alone
    ns = 1e9 * min(spent(1, time.process_time) for _ in range(turns)) / _STEPS / layout.elements
    both = [[spent(threads, time.perf_counter) for threads in (1, _THREADS)] for _ in range(turns)]
    one, two = (min(times) for times in zip(*both, strict=True))
    by_flops, by_bytes = operations / limits["gflops"], moved / limits["copy_GBps_working_set"]
    sheet.add(
        (
            name, layout.elements, f"{operations:.0f}", f"{moved:.0f}", f"{ns:.1f}", f"{by_flops / ns:.0%}",
            f"{by_bytes / ns:.0%}", f"{by_flops:.1f}", f"{by_bytes:.1f}", f"{one / two:.2f}",
        ),
        fruit=name, elements=layout.elements, operations=operations, bytes=moved, ns=ns, limits=limits,
        seconds={"one": one, "two": two}, bytes_held=float(layout.nbytes()),
        finite=bool(np.isfinite(velocity).all()),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--turns", type=int, default=60)
    asked = parser.parse_args()
    sheet = Sheet("dehydration-roofline", HEAD, "dehydration")
    numba.set_num_threads(1)
    for name, mirrors in (("eighth", "xyz"), ("whole", "")):
        _measured(sheet, name, mirrors, asked.turns)
    sheet.keep()


if __name__ == "__main__":
    main()
