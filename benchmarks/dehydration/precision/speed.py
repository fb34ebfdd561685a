"""How long dehydration runs take, and where: python -m benchmarks.dehydration.precision.speed [--rounds 5].

`--budget` keeps another record: CPU seconds of each part of runs on one thread. What contact takes in the march is
told by calls that are made again without it, on copies, one in so many; a search, by a step made again after all pairs
are forgotten.

gamma 10, four stages to s = 0.3, each on two threads and on one, for the gain of the second (thin skins on two only).
Whatever else a machine or its host does makes runs slower and none faster: of so many rounds, those of under 30 s in
turns, the fastest is kept, with the seconds of all. Parts are told apart by a profile: calls of the march's kernel,
which holds forces, contact and masses, and what a stage's lattice and descriptors take. Kept after each run, a record
of this version goes on.
"""

from __future__ import annotations

import argparse
import copy
import cProfile
import pstats
import time
from typing import Any

import numba
import numpy as np

from benchmarks.figures import RESULTS, Sheet, keep, load
from solver.contract import Context, Need
from solver.dehydration import SOLVER, motion
from solver.dehydration.contact.data import SEARCHES
from solver.dehydration.kernel import Layout
from solver.dehydration.kernel.layout import aligned_copy
from solver.dehydration.kernel.skin import Skin, forget

NAME = "dehydration-speed"
STAGES = (0.1, 0.15, 0.2, 0.3)
#: Quality, te, mirrors and threads, the cheapest first.
CASES = (
    ("preview", 0.04, "xyz", 2),
    ("preview", 0.04, "xyz", 1),
    ("default", 0.04, "xyz", 2),
    ("default", 0.04, "xyz", 1),
    ("preview", 0.02, "xyz", 2),
    ("preview", 0.02, "xyz", 1),
    ("preview", 0.04, "", 2),
    ("preview", 0.04, "", 1),
    ("default", 0.02, "xyz", 2),
    ("default", 0.04, "", 2),
    ("preview", 0.01, "xyz", 2),
    ("default", 0.01, "xyz", 2),
)
KEYS = ("quality", "te", "mirrors", "threads")
#: Seconds up to which a run is made in every round.
SHORT = 30.0
#: Parts by file and function.
PARTS = {"march and settling steps": ("march.py", "advance"), "lattice and descriptors": ("run.py", "add")}
#: Runs of the budget, one march call in how many is made again, and what each part is.
BUDGET, EVERY = (("preview", 0.04, "xyz"), ("default", 0.04, "xyz"), ("preview", 0.04, "")), 20
BUDGET_HEAD = ("run", "part", "times", "CPU s", "share", "ns per element and step", "on all threads")
OTHERS = {
    "masses follow": ("reweigh.py", "reweigh", "mostly"),
    "rest volumes follow": ("motion.py", "rests", "mostly"),
    "stages measured and written": ("run.py", "add", "no"),
    "mesh and layout": ("motion.py", "__init__", "no"),
}


def _measured(quality: str, te: float, mirrors: str, threads: int) -> dict[str, Any]:
    numba.set_num_threads(threads)
    params = SOLVER.parse({"te": te, "gamma": 10.0, "mirrors": mirrors}, "sphere")
    need = Need(stages=STAGES, quality=quality, resolution=64)
    profile = cProfile.Profile()
    begin, cpu = time.perf_counter(), time.process_time()
    profile.enable()
    found = SOLVER.solve(params, need, Context())
    profile.disable()
    cpu = time.process_time() - cpu
    calls = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    parts = {
        name: sum(row[3] for (file, _, called), row in calls.items() if file.endswith(path) and called == function)
        for name, (path, function) in PARTS.items()
    }
    return {
        "quality": quality, "te": te, "mirrors": mirrors, "threads": threads, "cpu": cpu,
        "seconds": time.perf_counter() - begin,
        "steps": int(found["iterations"].values[-1]), "elements": int(found.attrs["elements"]),
        "converged": found["converged"].values.tolist(), "parts": parts,
    }  # fmt: skip


class _Budget:
    """Stands in for the march: CPU seconds of all calls, and of some of them what contact adds."""

    def __init__(self) -> None:
        self.march, self.seconds, self.steps, self.searches, self.calls = motion.march, 0.0, 0, 0, 0
        self.bare: list[tuple[float, float]] = []
        self.search: list[float] = []

    def _again(self, layout: Layout, state: Any, steps: int, skin: Skin | None, **words: Any) -> float:
        moved, speed = (aligned_copy(part, part.dtype) for part in state)
        begin = time.process_time()
        self.march(layout, moved, speed, steps, skin=skin, **words)
        return time.process_time() - begin

    def __call__(self, layout: Layout, state: Any, velocity: Any, steps: int, skin: Any = None, **words: Any) -> Any:
        self.calls += 1
        looked_at = skin is not None and self.calls % EVERY == 0
        held = (aligned_copy(state, np.int32), aligned_copy(velocity, np.float32)) if looked_at else None
        before = int(skin.contact.counts[SEARCHES]) if skin is not None else 0
        begin = time.process_time()
        found = self.march(layout, state, velocity, steps, skin=skin, **words)
        spent = time.process_time() - begin
        self.seconds, self.steps = self.seconds + spent, self.steps + steps
        if found is not None:
            self.searches += int(found.contact.counts[SEARCHES]) - before
        if held is not None:
            self.bare.append((spent, self._again(layout, held, steps, None, **words)))
            spare, step = copy.deepcopy(found), min(self._again(layout, held, 1, None, **words) for _ in range(3))
            looked = []
            for _ in range(3):
                forget(spare, layout)
                looked.append(self._again(layout, held, 1, spare, **words))
            if spare.contact.counts[SEARCHES]:
                self.search.append(max(min(looked) - step, 0.0))
        return found


def _budget() -> None:
    """Keep what each part of a run takes on one thread."""
    numba.set_num_threads(1)
    sheet = Sheet(f"{NAME}-budget", BUDGET_HEAD, "dehydration")
    for quality, te, mirrors in BUDGET:
        params = SOLVER.parse({"te": te, "gamma": 10.0, "mirrors": mirrors}, "sphere")
        need, profile = Need(stages=STAGES, quality=quality, resolution=64), cProfile.Profile(time.process_time)
        motion.march, said = (budget := _Budget()), motion.march
        try:
            profile.enable()
            begin = time.process_time()
            found = SOLVER.solve(params, need, Context())
            whole = time.process_time() - begin
            profile.disable()
        finally:
            motion.march = said
        calls = pstats.Stats(profile).stats  # type: ignore[attr-defined]
        again = sum(row[3] for (_, _, called), row in calls.items() if called in ("_again", "deepcopy"))
        whole, elements = whole - again, int(found.attrs["elements"])
        full, bare = (sum(part) for part in zip(*budget.bare, strict=True))
        contact = budget.seconds * max(1 - bare / full, 0.0)
        searching = min(budget.searches * float(np.mean(budget.search)), contact) if budget.search else 0.0
        parts = {
            "forces and nodes": (budget.steps, budget.seconds - contact, "yes"),
            "contact: searches": (budget.searches, searching, "most"),
            "contact: steps": (budget.steps, contact - searching, "but for pushes"),
        }
        for name, (file, function, threads) in OTHERS.items():
            rows = [r for (path, _, called), r in calls.items() if path.endswith(file) and called == function]
            parts[name] = sum(r[0] for r in rows), sum(r[3] for r in rows), threads
        parts["all else"] = 1, whole - sum(part[1] for part in parts.values()), "no"
        name = f"{quality}, te {te:g}, {'eighth' if mirrors else 'whole'}"
        for part, (times, seconds, threads) in parts.items():
            sheet.add(
                (
                    name, part, times, f"{seconds:.2f}", f"{seconds / whole:.0%}",
                    f"{1e9 * seconds / (budget.steps * elements):.1f}", threads,
                ),
                run=name, part=part, times=times, cpu=seconds, whole=whole, steps=budget.steps, elements=elements,
                threads=threads,
            )  # fmt: skip
    sheet.keep()


def _add(rows: list[dict[str, Any]], case: tuple[str, float, str, int], rounds: int) -> None:
    """Run a case once more, unless it had its rounds; its row is the fastest run's, with the seconds of all."""
    at = next((i for i, row in enumerate(rows) if tuple(row[name] for name in KEYS) == case), None)
    seconds = [] if at is None else rows[at]["rounds"]
    if len(seconds) >= rounds or (seconds and seconds[0] > SHORT):
        return
    row = _measured(*case)
    seconds = [*seconds, row["seconds"]]
    if at is None:
        rows.append({**row, "rounds": seconds})
    else:
        rows[at] = {**(row if row["seconds"] < rows[at]["seconds"] else rows[at]), "rounds": seconds}
    print({name: row[name] for name in (*KEYS, "seconds", "cpu")}, flush=True)
    keep(NAME, rows, "dehydration")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help='cases whose "quality te mirrors threads" contains this')
    parser.add_argument("--rounds", type=int, default=5, help="runs of each case that takes less than 30 s")
    parser.add_argument("--budget", action="store_true", help="what each part takes on one thread")
    asked = parser.parse_args()
    SOLVER.solve(
        SOLVER.parse({"te": 0.1, "mirrors": "xyz"}, "sphere"), Need(stages=(0.1,), quality="preview"), Context()
    )
    if asked.budget:
        _budget()
        return
    known = load(NAME) if (RESULTS / f"{NAME}.json").exists() else {}
    rows = known["runs"] if known.get("version") == SOLVER.version else []
    for turn in range(asked.rounds):
        for case in CASES:
            if asked.only in "{} {} {} {}".format(*case):
                _add(rows, case, turn + 1)


if __name__ == "__main__":
    main()
