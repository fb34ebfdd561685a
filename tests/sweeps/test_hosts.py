"""Several hosts, for real: a scheduler and workers in network namespaces of their own, with own process ids and names.

One worker shares the store's files; the other does not see them and hands its results back as bytes. The sweep's own
process alone has the ledger.
"""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import pytest
from conftest import Solves

from store.store import Store
from sweeps.planning.plan import Plan
from sweeps.running import executors
from sweeps.running.runner import run_plan

ROOT = Path(__file__).parents[2]
NAMES = ("wizen-a", "wizen-b", "wizen-c")
ADDRESS = "10.77.31.{}"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::ResourceWarning"),
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="network namespaces are Linux's"),
    pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="namespaces are made by root alone"),
    pytest.mark.skipif(None in map(shutil.which, ("ip", "unshare", "mount")), reason="iproute2, util-linux missing"),
]


def ip(*words: str) -> None:
    done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"no namespaces here: {done.stderr.strip()}")


@pytest.fixture
def hosts() -> Iterator[None]:
    """Three hosts on one wire that leads nowhere else."""
    with ExitStack() as stack:
        for name in NAMES:
            ip("netns", "add", name)
            stack.callback(subprocess.run, ["ip", "netns", "del", name], check=False)
            ip("-n", name, "link", "set", "lo", "up")
        ip("-n", NAMES[0], "link", "add", "wire", "type", "bridge")
        ip("-n", NAMES[0], "addr", "add", f"{ADDRESS.format(1)}/24", "dev", "wire")
        ip("-n", NAMES[0], "link", "set", "wire", "up")
        for i, name in enumerate(NAMES[1:], 2):
            ip("link", "add", f"wire{i}", "netns", NAMES[0], "type", "veth", "peer", "name", "wire", "netns", name)
            ip("-n", NAMES[0], "link", "set", f"wire{i}", "master", "wire", "up")
            ip("-n", name, "addr", "add", f"{ADDRESS.format(i)}/24", "dev", "wire")
            ip("-n", name, "link", "set", "wire", "up")
        yield


def start(host: str, log: Path, *words: str, before: str = "true") -> subprocess.Popen[bytes]:
    """Run a Python module on a host, under its own name and process ids, after a command that prepares it."""
    script = f'hostname {host}; {before}; exec "$@"'
    inside = ["unshare", "-m", "-p", "-u", "-f", "--kill-child", "--mount-proc", "sh", "-c", script, "sh"]
    command = ["ip", "netns", "exec", host, *inside, sys.executable, "-m", *words]
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"}
    environment["SHRINKING_LOG"] = str(log.with_name(f"solves-{host}"))
    with log.open("wb") as said:
        return subprocess.Popen(command, stdout=said, stderr=said, env=environment, cwd=ROOT)


def wait_for(log: Path, word: str) -> None:
    until = time.monotonic() + 180
    while word not in log.read_text():
        assert time.monotonic() < until, log.read_text()
        time.sleep(0.1)


def workers_of(process: subprocess.Popen[bytes]) -> list[int]:
    """Return the process ids of Dask workers below their nanny, as our namespace has them."""
    import psutil

    below = psutil.Process(process.pid).children(recursive=True)
    return [child.pid for child in below if "spawn_main" in " ".join(child.cmdline())]


class Partitions(threading.Thread):
    """Takes the wire of one host or another away and gives it back, most of the time soon; counts how often."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._over, self._chance, self.count = threading.Event(), random.Random(1), 0

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        self.join()

    def run(self) -> None:
        while not self._over.wait(self._chance.uniform(0.05, 0.2)):
            wire = f"wire{self._chance.choice([2, 3])}"
            self._set(wire, "down")
            time.sleep(3.0 if self.count % 25 == 24 else self._chance.uniform(0.02, 0.3))
            self._set(wire, "up")
            self.count += 1

    @staticmethod
    def _set(wire: str, state: str) -> None:
        subprocess.run(["ip", "-n", NAMES[0], "link", "set", wire, state], check=False)


Running = list[subprocess.Popen[bytes]]


def cluster(tmp_path: Path, store: Store, turn: int) -> Running:
    """Start a scheduler and two workers, of which the second does not see the store's files."""
    at, scheduler = tmp_path / f"scheduler{turn}.log", f"tcp://{ADDRESS.format(1)}:8786"
    words = ("distributed.cli.dask_scheduler", "--host", ADDRESS.format(1), "--port", "8786", "--no-dashboard")
    running = [start(NAMES[0], at, *words)]
    wait_for(at, "Scheduler at")
    worker = ("distributed.cli.dask_worker", scheduler, "--nthreads", "1", "--no-dashboard", "--local-directory")
    hidden = f"mount -t tmpfs none {store.root}"
    for i, before in ((1, "true"), (2, hidden)):
        local = tmp_path / f"local{turn}{i}"
        local.mkdir()
        log = tmp_path / f"worker{turn}{i}.log"
        running.append(start(NAMES[i], log, *worker, str(local), "--name", NAMES[i], before=before))
    for i in (1, 2):
        wait_for(tmp_path / f"worker{turn}{i}.log", "Registered to")
    return running


def end(running: Running) -> None:
    for process in reversed(running):
        process.kill()
        process.wait()


def wait_for_shards(store: Store, count: int) -> None:
    until = time.monotonic() + 400
    while len(list(store.keys())) < count:
        assert time.monotonic() < until, f"{len(list(store.keys()))} shards"
        time.sleep(0.1)


@pytest.mark.timeout(3000)
def test_two_hundred_jobs_over_hosts(
    hosts: None, shrinking: Solves, store: Store, write_plan: Callable[..., Path], tmp_path: Path
) -> None:
    """Wires fail all the time, workers of both hosts are killed, then the scheduler is: no job is lost, and nothing is
    told from a local run.
    """
    pytest.importorskip("distributed")
    thick = [round(0.02 + 0.001 * i, 3) for i in range(20)]
    many = write_plan(str(thick), str(list(range(10, 60, 5))), more="pause = 0.02")
    scheduler = f"tcp://{ADDRESS.format(1)}:8786"
    sweep = ("service.cli", "sweep", str(many), "--store", str(store.root), "--scheduler", scheduler, "--json")
    running = cluster(tmp_path, store, 1)
    partitions = Partitions()
    try:
        sweeping = start(NAMES[0], tmp_path / "sweep1.log", *sweep)
        running.append(sweeping)
        with partitions:
            # once each worker has had some, those of both hosts are killed; their nannies start others
            wait_for_shards(store, 20)
            for process in running[1:3]:
                for pid in workers_of(process):
                    os.kill(pid, 9)
            wait_for_shards(store, 60)
        running[0].kill()
        assert sweeping.wait(timeout=400) not in (0, -9)
        said = (tmp_path / "sweep1.log").read_text()
        assert "Traceback" not in said
        assert "scheduler" in said
    finally:
        end(running)
    assert len(list(store.keys())) < 200
    running = cluster(tmp_path, store, 2)
    try:
        sweeping = start(NAMES[0], tmp_path / "sweep2.log", *sweep)
        running.append(sweeping)
        with Partitions() as more:
            assert sweeping.wait(timeout=1200) == 0, (tmp_path / "sweep2.log").read_text()
    finally:
        end(running)
    print(f"{partitions.count} and {more.count} partitions")
    assert partitions.count > 5
    assert more.count > 5
    found = {run.attrs["key"]: run for run in store.results()}
    assert len(found) == 200
    assert store.ledger.counts() == {"wanted": 0, "running": 0, "done": 200, "failed": 0, "cancelled": 0}
    # both hosts took part
    assert all((tmp_path / f"solves-{name}").read_text() for name in NAMES[1:])
    local = Store.open(tmp_path / "here", create=True)
    with executors.serial() as here:
        run_plan(Plan.load(many), local, here)
    assert {key: run.attrs["digest"] for key, run in found.items()} == {
        run.attrs["key"]: run.attrs["digest"] for run in local.results()
    }
    assert not list((store.root / "stopping").glob("shared-*"))
