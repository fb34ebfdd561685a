"""A service that is asked twice as often as it can answer, and one that is held by slow connections.

    python -m benchmarks.service.overload [--seconds 60] [--rounds 3] [--slow 5000] [--flat 300]

`wizen serve` runs over the table in the package, with its default settings. In turns: the peak rate (sixteen clients,
each waiting for its answer), then twice that rate at random moments, whoever waits for what. Then honest clients at
half the peak rate, in turns without and with slow connections: each sends a header byte by byte, from one of many
addresses, and comes back when it is let go.

Machines are noisy, and shared ones give a process less from one minute to the next: what counts are ratios of
neighbours in time. Beside them stand answers per second of the server's own processor time, and by how much the asker
itself was late, which says whether it had a processor when it wanted one.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import uvloop

from benchmarks.figures import keep
from store import starter

from .__main__ import ROOT, free_port
from .asking import Found, closed_loop, hold, open_loop, run

#: What is asked for: of the size that a page shows, and computed in the event loop; and one that a thread computes.
KINDS = {"points, 64": "resolution=64&format=points", "GLB, 192": "resolution=192&format=glb"}
CLIENTS = 16


def path(kind: str, seed: int) -> Any:
    """Return the addresses of shapes, no two of which are the same, within the axes of the table in the package."""

    def of(i: int) -> str:
        te, gamma = 0.03 + 0.01 * ((i + seed) * 0.6180339887 % 1), 10 + 40 * ((i + seed) * 0.7548776662 % 1)
        return f"/v1/shapes/dehydration?te={te:.7f}&gamma={gamma:.5f}&s=0.17&{KINDS[kind]}"

    return of


@contextmanager
def serving() -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run `wizen serve`; yield its process and port once it answers."""
    port = free_port()
    command = [sys.executable, "-m", "service.cli", "serve", "--store", str(starter.ROOT), "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "WIZEN_JOBS_WORKERS": "0"}
    with (
        tempfile.TemporaryFile("w+") as said,
        subprocess.Popen(command, env=environment, stderr=said, text=True) as process,
    ):
        try:
            for kind in KINDS:
                for _ in range(600):
                    if run(closed_loop(port, path(kind, 0), 1, 0.2)).good:
                        break
                    time.sleep(0.1)
            yield process, port
        except BaseException:
            said.seek(0)
            print(f"the server's exit code: {process.poll()}; its last words: {said.read()[-2000:]}", file=sys.stderr)
            raise
        finally:
            process.send_signal(signal.SIGTERM)


def memory(pid: int) -> float:
    """Return what a process holds [MB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return float(next(line.split()[1] for line in lines if line.startswith("VmRSS:"))) / 1e3


def spent(pid: int) -> float:
    """Return the processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


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


def quantile(times: list[float], q: float) -> float:
    """Return a quantile [ms] of sorted times."""
    return 1e3 * times[min(int(q * len(times)), len(times) - 1)] if times else 0.0


def said(found: Found) -> dict[str, Any]:
    return {
        "rate": found.rate,
        "good": len(found.good),
        "refused": len(found.refused),
        "broken": found.broken,
        "p50_ms": quantile(found.good, 0.5),
        "p99_ms": quantile(found.good, 0.99),
        "refused_p50_ms": quantile(found.refused, 0.5),
        "refused_p99_ms": quantile(found.refused, 0.99),
        "late_p99_ms": quantile(found.late, 0.99),
        "refused_in_100_ms": sum(t <= 0.1 for t in found.refused) / max(len(found.refused), 1),
    }


def twice(process: subprocess.Popen[str], port: int, kind: str, seconds: float, turn: int) -> dict[str, Any]:
    """Measure the peak rate, then ask twice as often, then the peak again: the rate of a shared machine drifts."""
    seed = 10**7 * (turn + 1)
    moments = [spent(process.pid)]
    before = run(closed_loop(port, path(kind, seed), CLIENTS, seconds / 3))
    if not before.good:
        raise SystemExit(f"nothing was answered in {seconds / 3:.0f} s of {kind}: ask for longer")
    moments.append(spent(process.pid))
    watch = Watch(process.pid)
    watch.start()
    over = run(open_loop(port, path(kind, seed + 10**6), 2 * before.rate, seconds, turn))
    seen = watch.stop()
    moments.append(spent(process.pid))
    after = run(closed_loop(port, path(kind, seed + 2 * 10**6), CLIENTS, seconds / 3))
    moments.append(spent(process.pid))
    peak = (before.rate + after.rate) / 2
    # of what the server got: answers per second of its processor time
    each = [len(part.good) / (b - a) for part, a, b in zip((before, over, after), moments, moments[1:], strict=False)]
    row = {"kind": kind, "seconds": seconds, "peak": peak, "before": before.rate, "after": after.rate, **said(over)}
    row |= {"goodput": over.rate / peak, "goodput_by_processor": 2 * each[1] / (each[0] + each[2])}
    row |= {"asked": 2 * before.rate / peak, "memory_mb": [seen[0], max(seen), seen[-1]]}
    print(
        f"{kind}: peak {peak:.0f} /s ({before.rate:.0f}, {after.rate:.0f}); at {row['asked']:.1f} times that goodput "
        f"{row['goodput']:.0%}, by processor time {row['goodput_by_processor']:.0%}, p99 {row['p99_ms']:.0f} ms; "
        f"{row['refused']} refused, {row['refused_in_100_ms']:.1%} "
        f"within 100 ms (p99 {row['refused_p99_ms']:.0f} ms); {row['broken']} broken; the asker late by "
        f"{row['late_p99_ms']:.0f} ms; {seen[0]:.0f} -> {seen[-1]:.0f} MB",
        flush=True,
    )
    return row


@contextmanager
def slow(port: int, count: int) -> Iterator[None]:
    """Hold slow connections from another process."""
    command = [sys.executable, "-m", "benchmarks.service.overload", "--hold", str(port), str(count)]
    with subprocess.Popen(command, cwd=ROOT) as process:
        try:
            time.sleep(8)
            yield
        finally:
            process.terminate()


def beside_slow(port: int, seconds: float, rounds: int, count: int) -> list[dict[str, Any]]:
    """Measure honest clients at half the peak, in turns without and with slow connections."""
    kind = next(iter(KINDS))
    rate = run(closed_loop(port, path(kind, 9 * 10**8), CLIENTS, seconds / 3)).rate / 2
    rows = []
    for turn in range(rounds):
        seed = 10**8 * (turn + 1)
        alone = said(run(open_loop(port, path(kind, seed), rate, seconds, turn)))
        with slow(port, count):
            held = said(run(open_loop(port, path(kind, seed + 10**7), rate, seconds, turn)))
        rows.append({"slow": count, "rate": rate, "alone": alone, "beside": held})
        print(
            f"{count} slow: p99 {alone['p99_ms']:.0f} ms alone, {held['p99_ms']:.0f} ms beside them "
            f"({held['p99_ms'] / alone['p99_ms']:.2f}); p50 {alone['p50_ms']:.1f}, {held['p50_ms']:.1f} ms; "
            f"{held['refused']} refused, {held['broken']} broken",
            flush=True,
        )
        time.sleep(2)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of overload in each round")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--slow", type=int, default=5000, help="slow connections")
    parser.add_argument("--flat", type=float, default=300.0, help="of overload in the last round, watched for memory")
    parser.add_argument("--hold", type=int, nargs=2, metavar=("PORT", "COUNT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    if options.hold:
        uvloop.run(hold(*options.hold))
        return
    with serving() as (process, port):
        rows = [twice(process, port, kind, options.seconds, i) for i in range(options.rounds) for kind in KINDS]
        rows += [twice(process, port, next(iter(KINDS)), options.flat, options.rounds)] if options.flat else []
    with serving() as (_, port):
        held = beside_slow(port, options.seconds / 2, options.rounds, options.slow) if options.slow else []
    report(rows, held)


def report(rows: list[dict[str, Any]], held: list[dict[str, Any]]) -> None:
    """Keep the records."""
    head = ["asked for", "for", "peak", "asked over peak", "goodput over peak", "by processor time", "p99 of answers"]
    head += ["refused", "of them within 100 ms", "broken", "asker late, p99", "memory at first, most, at last"]
    cells = [
        [
            row["kind"], f"{row['seconds']:.0f} s", f"{row['peak']:.0f} /s", f"{row['asked']:.1f}",
            f"{row['goodput']:.2f}", f"{row['goodput_by_processor']:.2f}",
            f"{row['p99_ms']:.0f} ms", str(row["refused"]), f"{100 * row['refused_in_100_ms']:.1f} %",
            str(row["broken"]), f"{row['late_p99_ms']:.0f} ms", ", ".join(f"{m:.0f}" for m in row["memory_mb"]) + " MB",
        ]
        for row in rows
    ]  # fmt: skip
    keep("service-overload", rows, table={"head": head, "rows": cells})
    if not held:
        return
    head = ["slow connections", "honest requests", "p50 alone", "beside", "p99 alone", "beside", "ratio", "turned away"]
    cells = [
        [
            str(row["slow"]), f"{row['rate']:.0f} /s", f"{row['alone']['p50_ms']:.1f} ms",
            f"{row['beside']['p50_ms']:.1f} ms", f"{row['alone']['p99_ms']:.0f} ms",
            f"{row['beside']['p99_ms']:.0f} ms", f"{row['beside']['p99_ms'] / row['alone']['p99_ms']:.2f}",
            str(row["beside"]["refused"] + row["beside"]["broken"]),
        ]
        for row in held
    ]  # fmt: skip
    ratios = [row["beside"]["p99_ms"] / row["alone"]["p99_ms"] for row in held]
    keep("service-slow", held, table={"head": head, "rows": cells}, median_ratio=statistics.median(ratios))


if __name__ == "__main__":
    main()
