"""The service under load, beside xpublish in the same run: python -m benchmarks.service [--peer PYTHON].

Parts: `start` (until the first answer; with --before, another checkout's in turns), `load` (requests per second and
latencies of 200 kB bodies at 16 clients, one worker each, in turns), `batch` (one request against many), `memory` (four
workers over one table), `swaps` (a new generation 200 times under load). The peer needs a Python with xpublish and its
plugin for zarr: python -m venv peers/xpublish && peers/xpublish/bin/pip install 'xpublish>=0.5' xpublish-zarr uvicorn.

`start` serves the table in the package; the others the synthetic one of `benchmarks.service.lookup`: 30 samples, 5
stages, 96 waves, 34 MB.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.figures import keep
from solver.dehydration import SOLVER
from store import seal, starter, tables
from store.store import Store

from .http_load import drive
from .lookup import fill

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("start", "load", "batch", "memory", "swaps")
#: Its points take as many bytes as the peer's chunk of 50000 numbers.
RESOLUTION = 90
#: Load before the first round [s]: on busy cores it takes so long until the compiled code is loaded aside.
_WARM_S = 10.0
#: A shape of the table in the package, as long as there has been one.
STARTER = "/v1/shapes/dehydration?te=0.035&gamma=20&s=0.2&resolution=64&format=points"
QUERY = "/v1/shapes/dehydration?te={te:.6f}&gamma={gamma:.4f}&s=0.17&resolution={n}&format=points"

PEER = """
import sys, numpy as np, xarray as xr, xpublish, uvicorn
values = np.random.default_rng(0).standard_normal((200, 50000), dtype=np.float32)
data = xr.Dataset({f"v{i}": ("point", row) for i, row in enumerate(values)})  # numpy arrays are one chunk each
if "raw" in sys.argv:
    for name in data:
        data[name].encoding["compressors"] = None
uvicorn.run(xpublish.Rest({"d": data}).app, host="127.0.0.1", port=int(sys.argv[1]), log_level="error")
"""


def ours(i: int, n: int = RESOLUTION) -> str:
    """Return the address of a shape between the samples; no two are the same."""
    return QUERY.format(te=0.02 + 0.04 * (i * 0.6180339887 % 1), gamma=10 + 50 * (i * 0.3819660113 % 1), n=n)


def again(i: int) -> str:
    """Return the address of one of 40 shapes, in turn: what a slider that goes to and fro asks for."""
    return ours(i % 40)


LIMIT = """
import sys, uvicorn
body = bytes(196000)
async def app(scope, receive, send):
    if scope["type"] == "http":
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"196000")]})
        await send({"type": "http.response.body", "body": body})
uvicorn.run(app, host="127.0.0.1", port=int(sys.argv[1]), log_level="error")
"""


def theirs(i: int) -> str:
    return f"/datasets/d/zarr/v{i * 89 % 200}/c/0"


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


@contextmanager
def running(
    command: list[str], path: str, tree: Path = ROOT, **environment: str
) -> Iterator[tuple[subprocess.Popen[bytes], int, float]]:
    """Run a server ({port} in its command) until left; yield it, its port and the seconds until its first answer."""
    port = free_port()
    start = time.perf_counter()
    process = subprocess.Popen(
        [word.replace("{port}", str(port)) for word in command],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), **environment},
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        while True:
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=20) as answer:
                    answer.read()
                break
            except urllib.error.HTTPError:
                raise  # it is up, and has no such address
            except OSError:
                if process.poll() is not None or time.perf_counter() - start > 60:
                    raise
                time.sleep(0.01)
        yield process, port, time.perf_counter() - start
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def service(root: Path, workers: int = 1, **environment: str) -> Any:
    command = [sys.executable, "-m", "service.cli", "serve", "--port", "{port}", "--workers", str(workers)]
    path = ours(0) if root != starter.ROOT else ours(0).replace("te=0.02", "te=0.03")
    return running(command, path, WIZEN_STORE=str(root), WIZEN_JOBS_WORKERS="0", **environment)


def cpu(pid: int) -> float:
    """Return the processor time [s] of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def family(pid: int) -> float:
    """Return the processor time [s] of a process and its children."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return cpu(pid) + sum(cpu(int(child)) for child in children)


def start(before: Path | None, times: int = 7) -> list[dict[str, Any]]:
    """Time the start over the table in the package, until it answers; beside it, in turns, that of another checkout."""
    trees = {"this checkout": ROOT} | ({"before": before.resolve()} if before else {})
    walls: dict[str, list[float]] = {name: [] for name in trees}
    busy: dict[str, list[float]] = {name: [] for name in trees}
    command = [sys.executable, "-m", "service.cli", "serve", "--port", "{port}"]
    for _ in range(times):
        for name, tree in trees.items():
            own = str(tree / "store" / "starter")
            with running(command, STARTER, tree, WIZEN_STORE=own, WIZEN_JOBS_WORKERS="0") as (process, _, seconds):
                walls[name].append(seconds)
                busy[name].append(cpu(process.pid))
    return [
        {"tree": name, "first_answer_s": min(walls[name]), "of_it_processor_s": min(busy[name])}
        | {"all_s": walls[name], "all_processor_s": busy[name]}
        for name in trees
    ]


def load(root: Path, peer: str | None, seconds: float, rounds: int) -> list[dict[str, Any]]:
    """Drive ours and the peer's servers in turns; every row is the median of its rounds.

    The processor time of the server (with its workers) for an answer counts where the machine is shared.
    """
    with (
        service(root) as (one, port, _),
        service(root, 2) as (two, both, _),
        running([sys.executable, "-c", LIMIT, "{port}"], "/") as (bare, limit, _),
    ):
        sides: dict[str, Any] = {
            "wizen, all distinct": (port, ours, one.pid),
            "wizen, 40 repeated": (port, again, one.pid),
            "2 workers, all distinct": (both, ours, two.pid),
            "2 workers, 40 repeated": (both, again, two.pid),
            "uvicorn, constant bytes": (limit, lambda _: "/", bare.pid),
        }
        if peer is None:
            return _turns(sides, seconds, rounds)
        command = [peer, "-c", PEER, "{port}"]
        with running(command, theirs(0)) as (p, packed, _), running([*command, "raw"], theirs(0)) as (r, raw, _):
            sides |= {
                "xpublish, stored": (packed, theirs, p.pid),
                "xpublish, uncompressed": (raw, theirs, r.pid),
            }
            return _turns(sides, seconds, rounds)


def _turns(sides: dict[str, Any], seconds: float, rounds: int) -> list[dict[str, Any]]:
    found: dict[str, list[Any]] = {name: [] for name in sides}
    busy: dict[str, list[float]] = {name: [] for name in sides}
    asked = 0
    for port, path, _ in sides.values():  # what a server loads aside, once it answers, is no part of any round
        drive(port, path, 16, _WARM_S)
    for _ in range(rounds):
        for name, (port, path, pid) in sides.items():
            begun = family(pid)
            run = drive(port, lambda i, path=path, first=asked: path(first + i), 16, seconds)  # type: ignore[misc]
            asked += len(run.latencies) + 16
            found[name].append(run)
            busy[name].append(1e3 * (family(pid) - begun) / max(len(run.latencies), 1))
    return [
        {
            "server": name,
            "rate": statistics.median(one.rate for one in runs),
            "p50_ms": statistics.median(one.quantile(0.5) for one in runs),
            "p99_ms": statistics.median(one.quantile(0.99) for one in runs),
            "processor_ms": min(busy[name]),
            "rounds": [{"rate": one.rate, "p50_ms": one.quantile(0.5), "p99_ms": one.quantile(0.99)} for one in runs],
            "body": runs[0].body,
            "failed": sum(one.failed for one in runs),
        }
        for name, runs in found.items()
    ]


def batch(root: Path, count: int = 200, times: int = 4) -> list[dict[str, Any]]:
    """Time shapes one by one on one connection against the same in one request, in turns."""
    rows = []
    with service(root) as (_, port, _):
        for n in (32, 64, 128):
            points = {"te": [0.02 + 0.04 * (i * 0.618 % 1) for i in range(count)], "gamma": 23.0, "s": 0.17}
            body = json.dumps({"solver": "dehydration", "points": points, "resolution": n}).encode()
            request = urllib.request.Request(f"http://127.0.0.1:{port}/v1/shapes:batch", body)
            request.add_header("Content-Type", "application/json")
            one, all_ = [], []
            for _ in range(times):
                one.append(1e3 / drive(port, lambda i, n=n: ours(i, n).replace("points", "npz"), 1, 1.0).rate)  # type: ignore[misc]
                begin = time.perf_counter()
                with urllib.request.urlopen(request, timeout=60) as answer:
                    answer.read()
                all_.append(1e3 * (time.perf_counter() - begin) / count)
            rows.append({"resolution": n, "single_ms": min(one), "batch_ms": min(all_), "ratio": min(one) / min(all_)})
    return rows


def memory(root: Path, workers: int = 4) -> dict[str, Any]:
    """Sum the shares of memory (PSS) of workers that have read all of a table, and of as many over a tiny one."""
    size = sum(path.stat().st_size for path in (root / "tables" / "default").glob("*.h5"))
    return {"workers": workers, "table_mb": size / 1e6, "pss_mb": _pss(root, workers), "tiny_mb": _pss(None, workers)}


def _pss(root: Path | None, workers: int) -> float:
    with service(root or starter.ROOT, workers) as (process, port, _):
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        for _ in range(12):  # new connections, which any worker may take
            if root is None:
                drive(port, lambda i: ours(i).replace("te=0.0", "te=0.03"), 8, 0.3)
            else:
                drive(port, ours, 8, 0.6)
        total = 0.0
        for child in children:
            try:
                lines = Path(f"/proc/{child}/smaps_rollup").read_text().splitlines()
            except ProcessLookupError:  # it made what is compiled, and has ended
                continue
            total += float(next(line.split()[1] for line in lines if line.startswith("Pss:"))) / 1e3
    return total


def swaps(root: Path, times: int, resolution: int = 48) -> dict[str, Any]:
    """Swap two generations back and forth under load; every swap waits until an answer comes from the new one."""
    store = Store.open(root)
    manifest = root / "tables" / "default" / "current.json"
    first = manifest.read_bytes()
    tables.build(store, SOLVER, resolution=resolution)
    kinds = [first, manifest.read_bytes()]
    digests = [json.loads(text)["digest"] for text in kinds]
    done = 0
    with service(root, WIZEN_RELOAD_INTERVAL="0.01") as (_, port, _):

        def swap() -> bool:
            nonlocal done
            address = f"http://127.0.0.1:{port}{ours(done)}".replace("points", "json")
            with urllib.request.urlopen(address, timeout=20) as answer:
                if json.loads(answer.read())["digest"] == digests[(done + 1) % 2]:
                    done += 1
                    seal.publish(manifest, kinds[(done + 1) % 2])
            return done < times

        found = drive(port, ours, 16, 300.0, swap)
    return {"swaps": done, "requests": len(found.latencies), "failed": found.failed, "p99_ms": found.quantile(0.99)}


#: Of each part: the head of its table, and what it says of a run.
_TABLES: dict[str, tuple[list[str], Callable[[dict[str, Any]], list[str]]]] = {
    "start": (
        ["", "from the start to the first answer", "of it processor, least", "median"],
        lambda run: [
            run["tree"], f"{run['first_answer_s']:.2f} s", f"{run['of_it_processor_s']:.2f} s",
            f"{statistics.median(run['all_processor_s']):.2f} s",
        ],
    ),
    "load": (
        ["server, 16 clients", "requests/s", "p50", "p99", "processor", "body", "failed"],
        lambda run: [
            run["server"], f"{run['rate']:.0f}", f"{run['p50_ms']:.3g} ms", f"{run['p99_ms']:.3g} ms",
            f"{run['processor_ms']:.2f} ms", f"{run['body'] / 1e3:.0f} kB", str(run["failed"]),
        ],
    ),
    "batch": (
        ["resolution", "one by one [ms]", "in one request [ms a shape]", "ratio"],
        lambda run: [
            str(run["resolution"]), f"{run['single_ms']:.2f}", f"{run['batch_ms']:.2f}", f"{run['ratio']:.1f}",
        ],
    ),
    "memory": (
        ["processes", "table", "memory of all, which have read it", "over a tiny table", "more, over the table"],
        lambda run: [
            str(run["workers"]), f"{run['table_mb']:.0f} MB", f"{run['pss_mb']:.0f} MB", f"{run['tiny_mb']:.0f} MB",
            f"{(run['pss_mb'] - run['tiny_mb']) / run['table_mb']:.2f}",
        ],
    ),
    "swaps": (
        ["generations swapped under load", "requests", "failed", "p99"],
        lambda run: [str(run["swaps"]), str(run["requests"]), str(run["failed"]), f"{run['p99_ms']:.0f} ms"],
    ),
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all without")
    parser.add_argument("--peer", help="a Python that has xpublish")
    parser.add_argument("--before", type=Path, help="another checkout, whose start is timed in turns with this one's")
    parser.add_argument("--store", type=Path, help="keep the synthetic table there, and use it if it is")
    parser.add_argument("--seconds", type=float, default=4.0, help="of load per server and round")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--swaps", type=int, default=200)
    options = parser.parse_args()
    parts = options.parts or PARTS
    if not set(parts) <= set(PARTS):
        parser.error(f"parts are {', '.join(PARTS)}")
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as directory:
        root = options.store or Path(directory) / "store"
        if not (root / "tables" / "default").is_dir() and set(parts) != {"start"}:
            store = Store.open(root, create=True)
            fill(store)
            tables.build(store, SOLVER)
        if "start" in parts:
            found["start"] = start(options.before)
            for row in found["start"]:
                print(
                    "{tree}: first answer after {first_answer_s:.2f} s, processor {of_it_processor_s:.2f}".format(**row)
                )
        if "load" in parts:
            found["load"] = load(root, options.peer, options.seconds, options.rounds)
            for row in found["load"]:
                print(
                    f"{row['server']:<24}{row['rate']:7.0f} /s  p50 {row['p50_ms']:7.2f} ms  p99 {row['p99_ms']:7.2f} "
                    f"ms  processor {row['processor_ms']:5.2f} ms  {row['body'] / 1e3:.0f} kB  {row['failed']} failed"
                )
        if "batch" in parts:
            found["batch"] = batch(root)
            for row in found["batch"]:
                print(
                    f"n = {row['resolution']:<4} single {row['single_ms']:6.3f} ms  in a batch {row['batch_ms']:6.3f} "
                    f"ms  ratio {row['ratio']:.2f}"
                )
        if "memory" in parts:
            found["memory"] = row = memory(root)
            print(
                f"{row['workers']} workers over a table of {row['table_mb']:.0f} MB: {row['pss_mb']:.0f} MB together, "
                f"{row['pss_mb'] - row['tiny_mb']:.0f} MB more than over a tiny table "
                f"({(row['pss_mb'] - row['tiny_mb']) / row['table_mb']:.2f} of its size)"
            )
        if "swaps" in parts:
            found["swaps"] = row = swaps(root, options.swaps)
            print("{swaps} swaps under load: {requests} requests, {failed} failed, p99 {p99_ms:.1f} ms".format(**row))
    for part, rows in found.items():
        runs = rows if isinstance(rows, list) else [rows]
        head, cells = _TABLES[part]
        peer = {"peer": _version(options.peer)} if part == "load" and options.peer else {}
        keep(f"service-{part}", runs, table={"head": head, "rows": [cells(run) for run in runs]}, **peer)


def _version(python: str) -> str:
    words = "import importlib.metadata; print('xpublish', importlib.metadata.version('xpublish'))"
    return subprocess.run([python, "-c", words], check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    main()
