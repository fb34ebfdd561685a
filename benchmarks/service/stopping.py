"""How long commands take to end: twenty of them, each sent SIGTERM or SIGINT at a random moment.

    python -m benchmarks.service.stopping [--seed 0] [--commands 20] [--term] [--growth]

A command has ended when every process of its session is gone. What is stopped: solves and onsets in this process,
sweeps with one and two workers, a service with a job under way. Prints one row per command, and the longest time.
--growth: what takes growth longest between two looks: a mesh of 98,000 vertices that buckles, fine sheets whose parts
touch; and jobs of these, cancelled over HTTP: such a job has ended when no process of the service works any more.
"""

from __future__ import annotations

import argparse
import itertools
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from typing import Any

import httpx

from benchmarks.figures import Sheet
from solver.growth.shapes import start
from store.store import Store
from store.tokens import Tokens
from sweeps.commands.terminal.options import parameters

PLAN = """
solver = "dehydration"
preset = "sphere"
[axes]
te = [0.025, 0.03]
[set]
mirrors = "xyz"
[need]
stages = [0.1, 0.2, 0.3]
quality = "default"
"""
RIM = """
thickness = 0.02
curved = false
[[tools]]
kind = "surface"
where = {{kind = "band", along = "radius", low = 0.6, high = 1.0}}
stretch = [{grows}, 1.0]
"""
CURL = """
shape = "strip"
aspect = 8.0
[[tools]]
kind = "surface"
where = {kind = "everywhere"}
frame = [1, 0, 0]
stretch = [1, 1]
curl = [6.0, 0.0]
"""
#: Latest moment of the signal [s].
LATEST, LATEST_OF_GROWTH = 40.0, 90.0
#: Seconds without work after which nobody works on a job that was cancelled.
_IDLE = 1.5


def commands(folder: Path) -> list[list[str]]:
    plan = folder / "plan.toml"
    plan.write_text(PLAN)
    return [
        ["solve", "dehydration", "--preset", "plum1"],
        ["solve", "wood", "--preset", "press"],
        ["onset", "--preset", "plum2"],
        ["sweep", str(plan), "--store", str(folder / "one")],
        ["sweep", str(plan), "--store", str(folder / "two"), "--workers", "2"],
        ["solve", "growth", "--preset", "cabbage"],
        ["serve", "--store", str(folder / "served"), "--port", "0"],
    ]


def of_growth(folder: Path) -> list[list[str]]:
    """Write what is hard for growth, and return the commands that are stopped, and jobs that are cancelled."""
    mesh = start("disc", 98_000, 1.0)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.x.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.triangles + 1).tolist()]
    (folder / "large.obj").write_text("\n".join(lines))
    (folder / "large.toml").write_text('mesh = "@large.obj"\n' + RIM.format(grows=1.5))
    (folder / "rim.toml").write_text('shape = "disc"\n' + RIM.format(grows=10.0))
    (folder / "curl.toml").write_text(CURL)
    found = []
    for name in ("large", "rim", "curl"):
        asked = ["growth", "--params", str(folder / f"{name}.toml"), "--quality", "fine", "--stages", "0.05,1"]
        found += [["solve", *asked], ["cancel", *asked]]
    return found


def alive(session: int) -> list[int]:
    """Return the processes of a session that have not ended."""
    return [number for number, _ in _processes(session)]


def working(session: int, workers: Collection[int]) -> int:
    """Return the clock ticks that those of a session's processes that have not ended have spent."""
    return sum(ticks for number, ticks in _processes(session) if number in workers)


def _processes(session: int) -> list[tuple[int, int]]:
    """Return the processes of a session that have not ended, and the clock ticks that each has spent."""
    found = []
    for path in Path("/proc").iterdir():
        if path.name.isdigit():
            try:
                fields = (path / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == session and fields[0] not in "ZX":
                found.append((int(path.name), int(fields[11]) + int(fields[12])))
    return found


def ask_for_a_job(running: subprocess.Popen[str], store: Path, body: dict[str, Any]) -> Callable[[], object]:
    """Ask a service, once it listens, for a run that takes minutes; return what cancels it."""
    assert running.stderr is not None
    address = next(line for line in running.stderr if "serving" in line).split()[-1]
    token = Tokens(Store.open(store, create=True).root).create(os.urandom(4).hex(), ["run"], None)[1]
    more: dict[str, Any] = {"headers": {"Authorization": f"Bearer {token}"}, "timeout": 30}
    for _ in range(100):
        try:
            job = httpx.post(f"{address}/v1/jobs", json=body, **more).raise_for_status().headers["location"]
            return partial(httpx.delete, address + job, **more)
        except httpx.TransportError:
            time.sleep(0.2)
    raise SystemExit("the service did not answer")


def stop(words: list[str], moment: float, number: signal.Signals) -> tuple[float, int | None, str]:
    """Start a command, stop it, and return the seconds until all of it was gone, its exit code and its last words."""
    command = [sys.executable, "-m", "service.cli", *words]
    running = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    if words[0] == "serve":
        body = {"solver": "dehydration", "preset": "plum1", "params": {"seed": random.randrange(10**6)}}
        ask_for_a_job(running, Path(words[2]), body)
    time.sleep(moment)
    if running.poll() is not None:
        return 0.0, running.returncode, "it had ended already"
    begin = time.monotonic()
    # a terminal sends Ctrl-C to all of them, `kill` sends SIGTERM to one
    (os.killpg if number == signal.SIGINT else os.kill)(running.pid, number)
    while alive(running.pid):
        time.sleep(0.01)
        if time.monotonic() - begin > 60:
            os.killpg(running.pid, signal.SIGKILL)
    seconds = time.monotonic() - begin
    said = running.communicate()[1].strip().splitlines()
    return seconds, running.returncode, said[-1] if said else ""


def cancel(words: list[str], moment: float, store: Path) -> tuple[float, int | None, str]:
    """Ask a service for a job, cancel it, and return the seconds until nobody works on it."""
    command = [sys.executable, "-m", "service.cli", "serve", "--store", str(store), "--port", "0"]
    # its processes' log goes on for as long as it runs, and nobody reads it
    # a mesh of 98,000 vertices is a body of ten megabytes
    own = {**os.environ, "WIZEN_MAX_BODY": str(1 << 25)}
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True, env=own)
    body = {"solver": words[1], "params": {**parameters(Path(words[3])), "seed": random.randrange(10**6)}}
    try:
        withdraw = ask_for_a_job(running, store, {**body, "need": {"quality": words[5], "stages": [0.05, 1]}})
        time.sleep(moment)
        workers = set(alive(running.pid)) - {running.pid}
        begun, spent = time.monotonic(), working(running.pid, workers)
        asking = threading.Thread(target=withdraw)
        asking.start()
        last = begun
        # the answer, with ten megabytes of mesh, may come later than the end
        while time.monotonic() - last < _IDLE or asking.is_alive():
            time.sleep(0.02)
            now = working(running.pid, workers)
            if now != spent:
                spent, last = now, time.monotonic()
        return last - begun, 0, "cancelled"
    finally:
        os.kill(running.pid, signal.SIGTERM)
        running.communicate()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", type=int, default=20)
    parser.add_argument("--term", action="store_true", help="send SIGTERM alone")
    parser.add_argument("--growth", action="store_true", help="what takes growth longest, and jobs of it")
    chosen = parser.parse_args()
    chance = random.Random(chosen.seed)
    head = ["command", "signal", "after", "until all of it had ended", "exit", "it said"]
    sheet = Sheet("service-stopping-growth", head, "growth") if chosen.growth else Sheet("service-stopping", head)
    with tempfile.TemporaryDirectory() as folder:
        Store.open(Path(folder) / "served", create=True)
        listed = (of_growth if chosen.growth else commands)(Path(folder))
        for words in itertools.islice(itertools.cycle(listed), chosen.commands):
            moment, number = (
                chance.uniform(0.5, LATEST_OF_GROWTH if chosen.growth else LATEST),
                signal.SIGTERM if chosen.term else chance.choice([signal.SIGTERM, signal.SIGINT]),
            )
            cancelled = words[0] == "cancel"
            if cancelled:
                seconds, code, said = cancel(words, moment, Path(folder) / "served")
            else:
                seconds, code, said = stop(words, moment, number)
            how = "DELETE" if cancelled else number.name
            called = " ".join(word.replace(folder, "").lstrip("/") for word in words[: 6 if chosen.growth else 4])
            called = called.replace("cancel", "solve")
            cells = [
                f"job of `wizen {called}`" if cancelled else f"`wizen {called}`",
                how,
                f"{moment:.1f} s",
                f"{seconds:.2f} s",
                code,
                said.replace("|", "/"),
            ]
            run = {"command": called, "signal": how, "after_s": moment, "ended_s": seconds, "exit": code}
            sheet.add(cells, **run, said=said)
    times = sorted(run["ended_s"] for run in sheet.runs)
    print(f"longest {times[-1]:.2f} s, median {times[len(times) // 2]:.2f} s of {len(times)}")
    sheet.keep(seed=chosen.seed)


if __name__ == "__main__":
    main()
