"""Honest clients of a service that slow connections hold: `benchmarks.service.overload --slow` runs it."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from benchmarks.figures import keep

from .__main__ import ROOT, cpu
from .asking import closed_loop, open_loop, run
from .served import CLIENTS, KINDS, path, quantile, said

__all__ = ["beside_slow", "report_slow"]

#: What honest clients are measured with; how long slow connections are there before [s]: they take five to come, and
#: their first ten seconds are over then; and how long a turn is [s].
TURNS = ("alone", "elsewhere", "beside")
SETTLED, TURN = 12.0, 5.0


@contextmanager
def slow(port: int, count: int) -> Iterator[Callable[[], float]]:
    """Hold slow connections from another process, of lowest priority; yield what it has spent [s]."""
    command = [sys.executable, "-m", "benchmarks.service.holding", str(port), str(count)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield lambda: cpu(process.pid)
        finally:
            process.terminate()


def beside_slow(servers: list[tuple[int, int]], seconds: float, rounds: int, count: int) -> list[dict[str, Any]]:
    """Measure honest clients at half the peak with two servers of which one, in turns, is held by slow connections.

    Both are asked the same at the same moments, for five seconds each, and again: the machine's other work meets both.
    """
    kind = next(iter(KINDS))
    rate = run(closed_loop(servers[0][1], path(kind, 9 * 10**8), CLIENTS, seconds / 3)).rate / 2
    rows = []
    for turn in range(rounds):
        row: dict[str, Any] = {"slow": count, "rate": rate}
        held, free = servers[turn % 2], servers[1 - turn % 2]
        turns = max(round(seconds / TURN), 1)
        row["alone"] = _asked([(free, rate, turn * 10**8 + i * 10**5) for i in range(turns)])
        with slow(held[1], count) as generator:
            time.sleep(SETTLED)
            theirs, begin = generator(), time.monotonic()
            pairs = []
            for i in range(turns):
                seed = turn * 10**8 + (turns + i) * 10**5
                pair = {
                    name: _asked([(who, rate, seed)])
                    for name, who in (("elsewhere", free), ("beside", held))[:: 1 - 2 * (i % 2)]
                }
                pairs.append(pair)
            row["generator"] = (generator() - theirs) / (time.monotonic() - begin)
        for name in ("elsewhere", "beside"):
            row[name] = [one for pair in pairs for one in pair[name]]
        rows.append(row)
        print(_line(_summed(row)), flush=True)
    return rows


def _asked(turns: list[tuple[tuple[int, int], float, int]]) -> list[dict[str, Any]]:
    """Ask each server (pid, port) at a rate for one turn, by a seed."""
    kind, found = next(iter(KINDS)), []
    for (pid, port), rate, seed in turns:
        before = cpu(pid)
        came = run(open_loop(port, path(kind, seed), rate, TURN, seed))
        found.append({**said(came), "seconds": came.good, "server": (cpu(pid) - before) / TURN})
    return found


def _summed(row: dict[str, Any]) -> dict[str, Any]:
    """Return a round, or several, with the times of all its turns together."""
    out = {key: row[key] for key in ("slow", "rate", "generator")}
    for name in TURNS:
        times = sorted(t for one in row[name] for t in one["seconds"])
        out[name] = {"p50_ms": quantile(times, 0.5), "p99_ms": quantile(times, 0.99)}
        out[name]["server"] = statistics.mean(one["server"] for one in row[name])
        out[name]["turned_away"] = sum(one["refused"] + one["broken"] for one in row[name])
    out["ratio"] = out["beside"]["p99_ms"] / out["elsewhere"]["p99_ms"]
    return out


def _line(row: dict[str, Any]) -> str:
    each = (
        f"{name} p50 {row[name]['p50_ms']:.1f}, p99 {row[name]['p99_ms']:.0f} ms, server {row[name]['server']:.1%}"
        for name in TURNS
    )
    return f"{row['slow']} slow ({row['generator']:.1%}): {'; '.join(each)}: p99 {row['ratio']:.2f} times"


def report_slow(rows: list[dict[str, Any]]) -> None:
    """Keep the record of slow connections; the last row of its table is of all rounds together."""
    together = {**rows[0], **{name: [one for row in rows for one in row[name]] for name in TURNS}}
    together["generator"] = statistics.mean(row["generator"] for row in rows)
    whole = _summed(together)
    print("all rounds: " + _line(whole))
    head = ["round", "honest requests", *(f"p50, p99 {name}" for name in TURNS), "ratio of p99"]
    head += ["the server's processor elsewhere, beside", "that of the slow", "turned away"]
    cells = [
        [
            str(i + 1) if i < len(rows) else "all", f"{row['rate']:.0f} /s",
            *(f"{row[name]['p50_ms']:.1f}, {row[name]['p99_ms']:.0f} ms" for name in TURNS), f"{row['ratio']:.2f}",
            f"{row['elsewhere']['server']:.1%}, {row['beside']['server']:.1%}", f"{row['generator']:.1%}",
            str(row["beside"]["turned_away"]),
        ]
        for i, row in enumerate([*map(_summed, rows), whole])
    ]  # fmt: skip
    for row in rows:
        for one in (one for name in TURNS for one in row[name]):
            one.pop("seconds")
    keep("service-slow", rows, table={"head": head, "rows": cells}, together=whole)
