"""Whatever a solver sits in, a signal, a cancellation and a lost claim end it within seconds, and nobody else."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from conftest import Solves, until

from store.store import Store
from sweeps.planning.plan import Plan
from sweeps.running import executors
from sweeps.running.report import Event
from sweeps.running.runner import run_jobs, run_plan

Write = Callable[..., Path]

ROOT = Path(__file__).parents[2]
#: Far less than the ten minutes that a hanging solver takes, far more than the two seconds of a machine at rest.
SOON = 20.0


def command(*words: object, within: Sequence[str] = ()) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*within, sys.executable, "-m", "service.cli", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"},
        cwd=ROOT,
        start_new_session=True,
    )


def gone(session: int) -> bool:
    try:
        os.killpg(session, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_solve_that_hangs_ends_with_its_command(shrinking: Solves, number: signal.Signals) -> None:
    running = command("solve", "shrinking", "--set", "trouble=hangs")
    until(lambda: len(shrinking) == 1)
    running.send_signal(number)
    _, said = running.communicate(timeout=SOON)
    assert running.returncode == 130
    assert said.strip().splitlines()[-1] == "stopped."
    assert "given back" not in said


def test_a_sweep_of_jobs_that_hang_gives_them_back(shrinking: Solves, tmp_path: Path, write_plan: Write) -> None:
    root = tmp_path / "store"
    running = command("sweep", write_plan(more='trouble = "hangs"'), "--store", root, "--workers", 2)
    until(lambda: len(shrinking) == 2)
    running.send_signal(signal.SIGTERM)
    _, said = running.communicate(timeout=SOON)
    assert running.returncode == 130
    assert "given back" in said
    until(lambda: gone(running.pid), SOON)
    assert Store.open(root).ledger.counts()["wanted"] == 6


@pytest.mark.parametrize("lost", ["cancelled", "taken over"])
def test_a_job_that_hangs_is_killed_alone(shrinking: Solves, store: Store, write_plan: Write, lost: str) -> None:
    stuck = Plan.load(write_plan("[0.03]", "[20]", 'trouble = "hangs"', name="stuck"))
    others = Plan.load(write_plan(more="pause = 0.3"))
    (key,) = (job.key for job in stuck.jobs())

    def take() -> None:
        until(lambda: len(shrinking) >= 3)
        if lost == "cancelled":
            store.ledger.cancel([key])
            return
        with store.ledger.database.write() as connection:  # as if its lease had run out
            connection.execute("UPDATE jobs SET lease_until = -1 WHERE key = ?", (key,))
        taken = store.ledger.claim("another", 3600, [key])
        assert taken is not None
        until(lambda: "lost" in seen)
        store.ledger.cancel([key])

    seen: list[str] = []

    def observe(event: Event) -> None:
        if event.kind != "progress":
            seen.append(event.kind)

    taking = threading.Thread(target=take)
    with executors.processes(2) as workers:
        taking.start()
        report = run_jobs([*stuck.jobs(), *others.jobs()], store, workers, observe=observe)
        taking.join()
    assert (report.solved, report.cancelled, report.failed) == (6, 1, ())
    assert seen.count("lost") == 1
    assert "retry" not in seen
    assert report.seconds < 120


def test_what_was_suspended_past_its_lease_comes_too_late(
    shrinking: Solves, tmp_path: Path, store: Store, write_plan: Write
) -> None:
    """Two runners, one of them stopped by SIGSTOP until its lease has run out, and woken: one result, no strife."""
    path = write_plan("[0.03]", "[10]", 'trouble = "waits"')
    shrinking.hold(0)
    script = tmp_path / "run.py"
    script.write_text(
        "import sys\nfrom store.store import Store\nfrom sweeps.running import executors, runner\n"
        "from sweeps.planning.plan import Plan\nif __name__ == '__main__':\n    with executors.serial() as workers:\n"
        "        report = runner.run_plan(Plan.load(sys.argv[1]), Store.open(sys.argv[2]), workers, lease=5.0)\n"
        "    print(report.solved, report.reused)\n"
    )
    first = subprocess.Popen(
        [sys.executable, str(script), str(path), str(store.root)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"},
    )
    until(lambda: len(shrinking) == 1)
    first.send_signal(signal.SIGSTOP)

    def wake(event: Event) -> None:
        shrinking.let_go()
        first.send_signal(signal.SIGCONT)  # the job is ours by now: the first one's lease has run out

    with executors.serial() as workers:
        report = run_plan(Plan.load(path), store, workers, wake, lease=5.0)
    assert first.communicate(timeout=60)[0].split() == ["0", "1"]
    assert (report.solved, report.reused) == (1, 0)
    assert len(shrinking) == 2
    assert store.ledger.get(next(iter(store.keys()))).claims == 2


def test_two_process_id_namespaces_under_one_host_name(shrinking: Solves, store: Store, write_plan: Write) -> None:
    """Two containers that share a store: neither sees the other's processes, and neither takes it for dead."""
    apart = ["unshare", "--pid", "--fork", "--kill-child", "--mount-proc"]
    try:
        subprocess.run([*apart, "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no namespaces here: {error}")
    sweep = ("sweep", write_plan("[0.03]", "[10]", "pause = 4"), "--store", store.root, "--json")
    first = command(*sweep)
    until(lambda: len(shrinking) == 1)
    second = command(*sweep, within=apart)
    said = [json.loads(each.communicate(timeout=300)[0]) for each in (first, second)]
    assert [one["solved"] for one in said] == [1, 0]
    assert len(shrinking) == 1
    assert store.ledger.get(next(iter(store.keys()))).claims == 1
