"""How long commands take to end: twenty of them, each sent SIGTERM or SIGINT at a random moment.

    python -m benchmarks.service.stopping [--seed 0] [--commands 20] [--term]

A command has ended when every process of its session is gone. What is stopped: solves and onsets in this process,
sweeps with one and two workers, a service with a job under way. Prints one row per command, and the longest time.
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
import time
from pathlib import Path

import httpx

from benchmarks.figures import Sheet
from store.store import Store
from store.tokens import Tokens

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
#: Latest moment of the signal [s].
LATEST = 40.0


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


def alive(session: int) -> list[int]:
    """Return the processes of a session that have not ended."""
    found = []
    for path in Path("/proc").iterdir():
        if path.name.isdigit():
            try:
                fields = (path / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == session and fields[0] not in "ZX":
                found.append(int(path.name))
    return found


def ask_for_a_job(running: subprocess.Popen[str], store: Path) -> None:
    """Ask a service, once it listens, for a run that takes minutes."""
    assert running.stderr is not None
    address = next(line for line in running.stderr if "serving" in line).split()[-1]
    token = Tokens(Store.open(store, create=True).root).create(os.urandom(4).hex(), ["run"], None)[1]
    body = {"solver": "dehydration", "preset": "plum1", "params": {"seed": random.randrange(10**6)}}
    for _ in range(100):
        try:
            httpx.post(f"{address}/v1/jobs", json=body, headers={"Authorization": f"Bearer {token}"}, timeout=30)
            return
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
        ask_for_a_job(running, Path(words[2]))
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", type=int, default=20)
    parser.add_argument("--term", action="store_true", help="send SIGTERM alone")
    chosen = parser.parse_args()
    chance = random.Random(chosen.seed)
    head = ["command", "signal", "after", "until all of it had ended", "exit", "it said"]
    sheet = Sheet("service-stopping", head)
    with tempfile.TemporaryDirectory() as folder:
        Store.open(Path(folder) / "served", create=True)
        for words in itertools.islice(itertools.cycle(commands(Path(folder))), chosen.commands):
            moment, number = (
                chance.uniform(0.5, LATEST),
                signal.SIGTERM if chosen.term else chance.choice([signal.SIGTERM, signal.SIGINT]),
            )
            seconds, code, said = stop(words, moment, number)
            called = " ".join(word.replace(folder, "").lstrip("/") for word in words[:4])
            cells = [
                f"`wizen {called}`",
                number.name,
                f"{moment:.1f} s",
                f"{seconds:.2f} s",
                code,
                said.replace("|", "/"),
            ]
            run = {"command": called, "signal": number.name, "after_s": moment, "ended_s": seconds, "exit": code}
            sheet.add(cells, **run, said=said)
    times = sorted(run["ended_s"] for run in sheet.runs)
    print(f"longest {times[-1]:.2f} s, median {times[len(times) // 2]:.2f} s of {len(times)}")
    sheet.keep(seed=chosen.seed)


if __name__ == "__main__":
    main()
