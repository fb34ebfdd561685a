from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr
from conftest import Solves, until

from store.ledger.ledger import MAX_LOST
from store.store import Store
from sweeps.planning.plan import Plan
from sweeps.running import executors
from sweeps.running.place import Place
from sweeps.running.report import Event
from sweeps.running.runner import run_jobs, run_plan

Write = Callable[..., Path]

ROOT = Path(__file__).parents[2]


def digests(store: Store) -> dict[str, str]:
    return dict(sorted((key, store.get(key).attrs["digest"]) for key in iter(store.keys())))


def test_a_plan_runs_once(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan, seen = Plan.load(write_plan()), list[Event]()
    with executors.serial() as workers:
        first = run_plan(plan, store, workers, seen.append)
        second = run_plan(plan, store, workers)
    assert (first.solved, first.reused, first.complete) == (6, 0, True)
    assert (second.solved, second.reused, second.complete) == (0, 6, True)
    assert len(shrinking) == 6
    assert store.ledger.counts("six")["done"] == 6
    assert [event.finished for event in seen if event.kind == "done"] == [1, 2, 3, 4, 5, 6]
    assert [event.kind for event in seen].count("started") == 6


def test_two_plans_share_results(shrinking: Solves, store: Store, write_plan: Write) -> None:
    with executors.serial() as workers:
        run_plan(Plan.load(write_plan()), store, workers)
        more = run_plan(Plan.load(write_plan(te="[0.04, 0.05]", name="more")), store, workers)
    assert (more.solved, more.reused) == (2, 2)
    assert len(shrinking) == 8


def test_a_lost_ledger_costs_nothing(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan = Plan.load(write_plan())
    with executors.serial() as workers:
        run_plan(plan, store, workers)
        for path in store.root.glob("ledger.sqlite*"):
            path.unlink()
        fresh = Store.open(store.root)
        report = run_plan(plan, fresh, workers)
    assert (report.solved, report.reused) == (0, 6)
    assert len(shrinking) == 6


def test_a_ledger_that_is_deleted_meanwhile_costs_nothing(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan, deleted, stop = Plan.load(write_plan()), list[str](), threading.Event()

    def observe(event: Event) -> None:
        if event.kind == "done" and not deleted:
            deleted.append(event.key)
            for path in store.root.glob("ledger.sqlite*"):
                path.unlink()

    late = threading.Timer(60, stop.set)  # else it would go on for ever
    late.start()
    with executors.serial() as workers:
        report = run_plan(plan, store, workers, observe, stop=stop)
    late.cancel()
    assert report.complete
    assert report.solved + report.reused == 6
    assert report.reused >= 0
    assert len(list(store.keys())) == 6
    assert Store.open(store.root).ledger.counts()["done"] == 6


def test_a_deleted_or_damaged_shard_is_solved_again(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan = Plan.load(write_plan())
    keys = [job.key for job in plan.jobs()]
    with executors.serial() as workers:
        run_plan(plan, store, workers)
        store.shard_path(keys[0]).unlink()
        store.shard_path(keys[1]).write_bytes(b"rubbish")
        report = run_plan(plan, store, workers)
    assert report.complete
    assert report.solved == 2
    assert set(digests(store)) == set(keys)


def test_what_fails_is_tried_twice_and_put_aside(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan, seen = Plan.load(write_plan("[0.03]", "[10]", 'trouble = "diverges"')), list[Event]()
    with executors.serial() as workers:
        report = run_plan(plan, store, workers, seen.append)
        once_more = run_plan(plan, store, workers)
        assert len(shrinking) == 2
        run_plan(plan, store, workers, again=True)
    assert len(shrinking) == 4
    (failure,) = report.failed
    assert once_more.failed == report.failed
    assert failure.error["code"] == "not-converged"
    assert failure.error["advice"] == "Take care."
    assert failure.error["last_stage"] == 0.1
    assert [event.kind for event in seen if event.kind != "progress"] == ["started", "retry", "started", "failed"]
    # what did converge is kept where no table looks for it
    assert list(store.keys()) == []
    with xr.open_dataset(store.root / failure.error["partial"], engine="h5netcdf") as partial:
        assert partial.sizes["stage"] == 1
        assert "it diverged" in partial.attrs["reason"]
        assert partial["displacement"].attrs["units"] == "1"


def test_a_plan_runs_with_its_pattern_and_its_controls(shrinking: Solves, store: Store, write_plan: Write) -> None:
    parts = [
        write_plan(te, "[10]", name=name) for name, te in (("p", "[0.02]"), ("s", "[0.03, 0.04]"), ("c", "[0.05]"))
    ]
    first, samples, controls = map(Plan.load, parts)
    plan = replace(samples, first=first, controls=controls)
    with executors.serial() as workers:
        report = run_plan(plan, store, workers)
    assert (report.plan, report.total, report.solved, report.complete) == ("s", 4, 4, True)
    assert [line.split()[0] for line in shrinking.lines()] == ["0.02", "0.03", "0.04", "0.05"]
    assert {name: store.ledger.counts(name)["done"] for name in "psc"} == {"p": 1, "s": 2, "c": 1}


def test_samples_wait_for_their_pattern(shrinking: Solves, store: Store, write_plan: Write) -> None:
    first = Plan.load(write_plan("[0.02]", "[10]", more='trouble = "refuses"', name="p"))
    plan = replace(Plan.load(write_plan("[0.03, 0.04]", "[10]", name="s")), first=first)
    with executors.serial() as workers:
        report = run_plan(plan, store, workers)
    assert (report.total, report.solved, len(report.failed), report.waiting) == (3, 0, 1, 2)
    assert not report.complete
    assert len(shrinking) == 1


@pytest.mark.parametrize(
    ("trouble", "code", "solves"), [("refuses", "invalid-input", 1), ("crashes", "internal-error", 2)]
)
def test_errors_are_typed(
    shrinking: Solves, store: Store, write_plan: Write, trouble: str, code: str, solves: int
) -> None:
    with executors.serial() as workers:
        report = run_plan(Plan.load(write_plan("[0.03]", "[10]", f'trouble = "{trouble}"')), store, workers)
    assert report.failed[0].error["code"] == code
    assert len(shrinking) == solves


def test_what_was_given_up_and_came_from_elsewhere_counts(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan = Plan.load(write_plan("[0.03]", "[10]"))
    (job,) = plan.jobs()
    store.ledger.want([job])
    held = store.ledger.claim("w", 60.0)
    assert held is not None
    assert store.ledger.failed(held, {"code": "x", "message": "x", "advice": ""}, 1) == "failed"
    store.put(job.key, plan.solver.solve(plan.samples[0], plan.need))
    before = len(shrinking)
    with executors.serial() as workers:
        report = run_plan(plan, store, workers)
    assert (report.complete, report.reused, len(shrinking)) == (True, 1, before)


def test_the_second_try_may_succeed(shrinking: Solves, store: Store, write_plan: Write) -> None:
    with executors.serial() as workers:
        report = run_plan(Plan.load(write_plan("[0.03]", "[10]", 'trouble = "once"')), store, workers)
    assert report.complete
    assert len(shrinking) == 2


def test_a_worker_that_dies_takes_only_its_own_job(shrinking: Solves, store: Store, write_plan: Write) -> None:
    good, bad = Plan.load(write_plan()), Plan.load(write_plan("[0.03]", "[20]", 'trouble = "kills"', name="bad"))
    with executors.processes(2) as workers:
        report = run_jobs([*bad.jobs(), *good.jobs()], store, workers)
    assert report.solved == 6
    assert [failure.error["code"] for failure in report.failed] == ["worker-lost"]


def test_cancelling_gives_jobs_back(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan, stop = Plan.load(write_plan(more="pause = 120")), threading.Event()

    def observe(event: Event) -> None:
        if event.kind == "progress":
            stop.set()

    for opened in (executors.serial(), executors.processes(2)):
        start = time.monotonic()
        with opened as workers:
            report = run_plan(plan, store, workers, observe, stop=stop)
        assert time.monotonic() - start < 100
        assert report.stopped
        assert report.waiting == 6
        assert store.ledger.counts()["wanted"] == 6
        assert all(job.attempts == 0 for job in store.ledger.jobs())
        stop.clear()
    assert list(store.keys()) == []


def test_a_job_cancelled_in_the_ledger_stops(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan = Plan.load(write_plan("[0.03]", "[10]", "pause = 120"))

    def observe(event: Event) -> None:
        if event.kind == "progress":
            store.ledger.cancel([event.key])

    with executors.serial() as workers:
        report = run_plan(plan, store, workers, observe)
    assert report.cancelled == 1
    assert report.seconds < 100


def test_workers_that_must_not_open_the_ledger(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan, slow, stop = Plan.load(write_plan()), Plan.load(write_plan(more="pause = 120")), threading.Event()
    with executors.serial() as workers:
        workers.shares_ledger = False
        assert run_plan(plan, store, workers).solved == 6
        assert store.ledger.counts()["done"] == 6
        report = run_plan(slow, store, workers, lambda event: stop.set(), stop=stop)
    assert report.waiting == 6
    assert not list((store.root / "stopping").iterdir())


def test_a_dead_runner_is_noticed_at_once(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan = Plan.load(write_plan())
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    store.ledger.want(plan.jobs())
    store.ledger.claim(Place.here().sign(gone.pid), lease=3600)
    with executors.serial() as workers:
        assert run_plan(plan, store, workers).complete


def test_a_job_that_takes_its_runners_down_is_given_up(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan = Plan.load(write_plan())
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    deadly = plan.jobs()[0]
    store.ledger.want([deadly])
    stopped = threading.Event()
    stopped.set()
    with executors.serial() as workers:
        for _ in range(MAX_LOST):
            assert store.ledger.claim(Place.here().sign(gone.pid), 3600, [deadly.key]) is not None
            run_jobs([deadly], store, workers, stop=stopped)
        report = run_plan(plan, store, workers)
    assert (report.solved, [failure.key for failure in report.failed]) == (5, [deadly.key])
    assert report.failed[0].error["code"] == "worker-lost"


def test_nothing_is_guessed_of_processes_elsewhere() -> None:
    here, nobody = Place.here(), 2**22 + 1  # Linux numbers processes up to 2^22
    assert here.knows_dead(here.sign(nobody))
    assert not here.knows_dead(here.sign())
    for elsewhere in (replace(here, namespace="4026532000"), replace(here, boot="another")):
        assert not here.knows_dead(elsewhere.sign(nobody))
    for name in (None, "", "tester", f"{here.host}:{nobody}:0123"):
        assert not here.knows_dead(name)


def test_a_lease_that_ran_out_is_taken_over(shrinking: Solves, store: Store, write_plan: Write) -> None:
    plan = Plan.load(write_plan())
    store.ledger.want(plan.jobs())
    store.ledger.claim("elsewhere:1:0", lease=1.0)
    with executors.serial() as workers:
        assert run_plan(plan, store, workers).solved == 6


def sweep_script(folder: Path) -> Path:
    script = folder / "run.py"
    script.write_text(
        "import sys\n"
        "from store.store import Store\n"
        "from sweeps.planning.plan import Plan\n"
        "from sweeps.running import executors, runner\n"
        "if __name__ == '__main__':\n"
        "    with executors.processes(2) as workers:\n"
        "        runner.run_plan(Plan.load(sys.argv[1]), Store.open(sys.argv[2]), workers)\n"
    )
    return script


def start(script: Path, plan: Path, store: Store) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"}
    command = [sys.executable, str(script), str(plan), str(store.root)]
    return subprocess.Popen(command, env=environment, start_new_session=True)


def test_killing_everything_loses_nothing_reported(
    shrinking: Solves, tmp_path: Path, write_plan: Write, store: Store
) -> None:
    """Kill the sweep and all its workers in the middle; no shard that was reported is computed again."""
    path = write_plan("[0.01, 0.02, 0.03, 0.04, 0.05]", more='trouble = "waits"')
    shrinking.hold(5)
    running = start(sweep_script(tmp_path), path, store)
    until(lambda: store.ledger.counts()["done"] >= 3)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    reported, before = {job.key for job in store.ledger.jobs("done")}, len(shrinking)
    assert 3 <= len(reported) < 10
    shrinking.let_go()
    with executors.serial() as workers:
        report = run_plan(Plan.load(path), store, workers)
    assert report.complete
    # what was reported is there and was not solved again; the kill interrupted at most one solve per worker
    assert len(digests(store)) == 10
    assert len(shrinking) - before <= 10 - len(reported)
    assert len(shrinking) <= 10 + 2


def test_workers_end_with_a_killed_parent(shrinking: Solves, tmp_path: Path, write_plan: Write, store: Store) -> None:
    """Kill only the sweep: its workers end by themselves, and hold no job."""
    running = start(sweep_script(tmp_path), write_plan(more="pause = 30"), store)
    until(lambda: len(shrinking) >= 2)
    running.kill()
    running.wait()

    def gone() -> bool:
        try:
            os.killpg(running.pid, 0)
        except ProcessLookupError:
            return True
        return False

    until(gone)


@pytest.mark.slow
def test_the_paper_s_fruit(tmp_path: Path) -> None:
    """A real dehydration run is the same in this process and in another, whatever the number of threads."""
    plan = Plan.parse(
        {"solver": "dehydration", "preset": "sphere", "need": {"stages": [0.05], "quality": "preview"}}, "sphere"
    )
    found = []
    for name, opened in {"serial": executors.serial(), "processes": executors.processes(2)}.items():
        store = Store.open(tmp_path / name, create=True)
        with opened as workers:
            assert run_plan(plan, store, workers).complete
        found.append(digests(store))
    assert found[0] == found[1]
