"""A service that is asked twice as often as it can answer, and one that is held by slow connections.

    python -m benchmarks.service.overload [--seconds 60] [--rounds 3] [--slow 5000] [--flat 300]

`wizen serve` runs over the table in the package, with its default settings. In turns: the peak rate (sixteen clients,
each waiting for its answer), then twice that rate at random moments, whoever waits for what. Then honest clients at
half the peak rate: alone, and in turns of a server that slow connections hold (beside) and of one that they do not
(elsewhere). Each of these sends a header byte by byte, from one of many addresses, and comes back when it is let go.

Machines are noisy, and shared ones give a process less from one minute to the next: what counts are ratios of
neighbours in time. Beside them stand answers per second of the server's own processor time, and by how much the asker
itself was late, which says whether it had a processor when it wanted one.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import threading
from pathlib import Path
from typing import Any

from benchmarks.figures import keep

from .__main__ import cpu
from .asking import closed_loop, open_loop, run
from .served import CLIENTS, KINDS, path, said, serving
from .slow import beside_slow, report_slow

#: Longest time for which a peak rate is measured [s].
_PEAK = 20.0


def memory(pid: int) -> float:
    """Return what a process holds [MB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return float(next(line.split()[1] for line in lines if line.startswith("VmRSS:"))) / 1e3


class Watch(threading.Thread):
    """Looks at the memory of a process every second."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.pid, self.seen, self.over = pid, [memory(pid)], threading.Event()

    def run(self) -> None:
        """Look until stopped."""
        while not self.over.wait(1.0):
            self.seen.append(memory(self.pid))

    def stop(self) -> list[float]:
        """Return what was seen [MB]."""
        self.over.set()
        self.join()
        return self.seen


def twice(process: subprocess.Popen[str], port: int, kind: str, seconds: float, turn: int) -> dict[str, Any]:
    """Measure the peak rate, then ask twice as often, then the peak again: the rate of a shared machine drifts."""
    seed, short = 10**7 * (turn + 1), min(seconds / 3, _PEAK)
    moments = [cpu(process.pid)]
    before = run(closed_loop(port, path(kind, seed), CLIENTS, short))
    if not before.good:
        raise SystemExit(f"nothing was answered in {short:.0f} s of {kind}: ask for longer")
    moments.append(cpu(process.pid))
    watch = Watch(process.pid)
    watch.start()
    over = run(open_loop(port, path(kind, seed + 10**6), 2 * before.rate, seconds, turn))
    seen = watch.stop()
    moments.append(cpu(process.pid))
    after = run(closed_loop(port, path(kind, seed + 2 * 10**6), CLIENTS, short))
    moments.append(cpu(process.pid))
    peak = (before.rate + after.rate) / 2
    # of what the server got: answers per second of its processor time
    each = [len(part.good) / (b - a) for part, a, b in zip((before, over, after), moments, moments[1:], strict=False)]
    row = {"kind": kind, "seconds": seconds, "peak": peak, "before": before.rate, "after": after.rate, **said(over)}
    row |= {"goodput": over.rate / peak, "goodput_by_processor": 2 * each[1] / (each[0] + each[2])}
    row |= {"asked": 2 * before.rate / peak, "memory_mb": [seen[0], max(seen), seen[-1]]}
    # every half minute; and what it grew by from the middle on, of means over a tenth of the time
    part = max(len(seen) // 10, 1)
    grown = statistics.mean(seen[-part:]) - statistics.mean(seen[len(seen) // 2 :][:part])
    row |= {"memory_series_mb": seen[::30], "grown_mb": grown}
    print(
        f"{kind}: peak {peak:.0f} /s ({before.rate:.0f}, {after.rate:.0f}); at {row['asked']:.1f} times that goodput "
        f"{row['goodput']:.0%}, by processor time {row['goodput_by_processor']:.0%}, p99 {row['p99_ms']:.0f} ms; "
        f"{row['refused']} refused, {row['refused_in_100_ms']:.1%} "
        f"within 100 ms (p99 {row['refused_p99_ms']:.0f} ms); {row['broken']} broken; the asker late by "
        f"{row['late_p99_ms']:.0f} ms; {seen[0]:.0f} -> {seen[-1]:.0f} MB",
        flush=True,
    )
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of overload in each round")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--slow", type=int, default=5000, help="slow connections")
    parser.add_argument("--flat", type=float, default=300.0, help="of overload in the last round, watched for memory")
    parser.add_argument("--only-slow", action="store_true", help="leave the rest out")
    options = parser.parse_args()
    if not options.only_slow:
        overloaded([(kind, options.seconds, i) for i in range(options.rounds) for kind in KINDS], "service-overload")
    if options.slow:
        with serving() as (process, port), serving() as (other, second):
            servers = [(process.pid, port), (other.pid, second)]
            report_slow(beside_slow(servers, options.seconds, options.rounds, options.slow))
    if options.flat and not options.only_slow:
        overloaded([(next(iter(KINDS)), options.flat, options.rounds)], "service-overload-long")


def overloaded(rounds: list[tuple[str, float, int]], name: str) -> None:
    """Measure overload of a server, and keep what came of it."""
    rows: list[dict[str, Any]] = []
    with serving() as (process, port):
        for kind, seconds, turn in rounds:
            rows.append(twice(process, port, kind, seconds, turn))
            report(name, rows)  # after each: whatever ends a long run, what was measured is kept


def report(name: str, rows: list[dict[str, Any]]) -> None:
    """Keep the record."""
    head = ["asked for", "for", "peak", "asked over peak", "goodput over peak", "by processor time", "p99 of answers"]
    head += [
        "refused",
        "of them within 100 ms",
        "broken",
        "asker late, p99",
        "memory at first, most, at last",
        "grown in the second half",
    ]
    cells = [
        [
            row["kind"], f"{row['seconds']:.0f} s", f"{row['peak']:.0f} /s", f"{row['asked']:.1f}",
            f"{row['goodput']:.2f}", f"{row['goodput_by_processor']:.2f}",
            f"{row['p99_ms']:.0f} ms", str(row["refused"]), f"{100 * row['refused_in_100_ms']:.1f} %",
            str(row["broken"]), f"{row['late_p99_ms']:.0f} ms", ", ".join(f"{m:.0f}" for m in row["memory_mb"]) + " MB",
            f"{row['grown_mb']:+.1f} MB" if "grown_mb" in row else "",
        ]
        for row in rows
    ]  # fmt: skip
    keep(name, rows, table={"head": head, "rows": cells})


if __name__ == "__main__":
    main()
