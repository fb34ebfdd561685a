"""A scheduler that dies under a sweep: one sentence, and everything that was stored stays."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Solves

from store.store import Store
from sweeps.planning.plan import Plan
from sweeps.running import executors
from sweeps.running.executors import SchedulerLost
from sweeps.running.report import Event
from sweeps.running.runner import run_plan

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::ResourceWarning")

ROOT = Path(__file__).parents[2]


def start(log: Path, *words: str) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"}
    with log.open("wb") as said:
        return subprocess.Popen([sys.executable, "-m", *words], stdout=said, stderr=said, env=environment)


def address_in(log: Path) -> str:
    until = time.monotonic() + 120
    while time.monotonic() < until:
        lines = [line for line in log.read_text().splitlines() if "Scheduler at:" in line]
        if lines:
            return lines[0].split()[-1]
        time.sleep(0.05)
    raise AssertionError(log.read_text())


def test_a_scheduler_that_dies(
    shrinking: Solves, store: Store, write_plan: Callable[..., Path], tmp_path: Path
) -> None:
    pytest.importorskip("distributed")
    log = tmp_path / "scheduler.log"
    scheduler = start(log, "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1")
    worker = None
    try:
        address = address_in(log)
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
        worker = start(tmp_path / "worker.log", "distributed.cli.dask_worker", address, *options)
        plan = Plan.load(write_plan(more="pause = 0.2"))

        def observe(event: Event) -> None:
            if event.kind == "done":
                scheduler.kill()

        with (
            pytest.raises(SchedulerLost, match="does not answer any more") as raised,
            executors.dask_cluster(address) as workers,
        ):
            run_plan(plan, store, workers, observe)
        assert "TCP" not in str(raised.value)
    finally:
        for process in (scheduler, worker):
            if process is not None:
                process.kill()
                process.wait()
    # the same sweep goes on without it
    stored = len(list(store.keys()))
    assert stored >= 1
    with executors.serial() as here:
        report = run_plan(plan, store, here)
    assert report.complete
    assert report.solved <= 6 - stored + 1
