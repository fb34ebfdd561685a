from __future__ import annotations

import pickle
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr

from store.errors import QuotaSpent, UnknownJob
from store.ledger import clock, jobs
from store.ledger.asks import Asker, Spending
from store.ledger.clock import Clock
from store.ledger.jobs import Job, JobSpec
from store.ledger.ledger import MAX_LOST, Ledger
from store.ledger.queue import Queue, Quota
from store.store import Store

from .conftest import fill, make, python, spec

ERROR = {"code": "unstable", "message": "blew up.", "advice": "Smaller steps."}


def job(name: str) -> JobSpec:
    return JobSpec(name, "dehydration", "1", {"te": 0.04}, {"stages": [0.1]})


def claim(ledger: Ledger, lease: float = 60.0, worker: str = "w") -> Job:
    found = ledger.claim(worker, lease)
    assert found is not None
    return found


@pytest.fixture
def ledger(tmp_path: Path) -> Ledger:
    return Ledger(tmp_path / "ledger.sqlite")


def test_a_job_s_life(ledger: Ledger) -> None:
    assert ledger.want([job("a"), job("b")], plan="p") == 2
    assert ledger.want([job("a"), job("b")], plan="p") == 0
    first = ledger.claim("w1", 60.0)
    assert first is not None
    assert (first.key, first.state, first.worker, first.attempts) == ("a", "running", "w1", 1)
    assert (first.params, first.need) == ({"te": 0.04}, {"stages": [0.1]})
    assert ledger.renew(first, 60.0, progress=0.5)
    assert not ledger.renew(replace(first, worker="w2"), 60.0)
    assert ledger.get("a").progress == 0.5
    assert ledger.done(first, "digest", 2.5)
    done = ledger.get("a")
    assert (done.state, done.digest, done.seconds, done.progress, done.worker) == ("done", "digest", 2.5, 1.0, None)
    assert ledger.counts("p") == {"wanted": 1, "running": 0, "done": 1, "failed": 0, "cancelled": 0}
    assert [j.key for j in ledger.jobs("done")] == ["a"]
    assert ledger.want([job("a")], again=True) == 0
    assert ledger.get("a").state == "done"


def test_failures_are_tried_again_and_then_given_up(ledger: Ledger) -> None:
    ledger.want([job("a")])
    assert ledger.failed(claim(ledger), ERROR) == "wanted"
    assert ledger.failed(claim(ledger), ERROR) == "failed"
    assert ledger.claim("w", 60.0) is None
    assert ledger.get("a").error == ERROR
    assert ledger.want([job("a")]) == 0
    assert ledger.want([job("a")], again=True) == 1
    again = claim(ledger)
    assert (again.attempts, again.claims, again.error) == (1, 3, None)
    assert ledger.done(again, "d", 1.0)
    assert ledger.failed(again, ERROR) == "done"


def test_release_and_cancel(ledger: Ledger) -> None:
    ledger.want([job("a"), job("b")])
    assert ledger.release(claim(ledger))
    assert (ledger.get("a").state, ledger.get("a").attempts) == ("wanted", 0)
    again = claim(ledger)
    assert ledger.cancel(["a", "b", "unknown"]) == 2
    assert not ledger.renew(again, 60.0)
    assert not ledger.release(again)
    assert ledger.failed(again, ERROR) is None
    assert not ledger.done(again, "d", 1.0)
    assert ledger.get("a").state == "cancelled"
    assert ledger.claim("w", 60.0) is None
    assert ledger.want([job("a")]) == 1


def test_a_lost_claimant_is_no_failure(ledger: Ledger) -> None:
    ledger.want([job("a")])
    claim(ledger, 0.0)
    time.sleep(0.01)
    again = claim(ledger)
    assert again.attempts == 2
    assert ledger.failed(again, ERROR) == "wanted"
    assert ledger.failed(claim(ledger), ERROR) == "failed"


def test_what_was_given_back_and_then_finished_counts_unless_it_was_taken(ledger: Ledger) -> None:
    ledger.want([job("a"), job("b")])
    first, second = claim(ledger), claim(ledger)
    assert ledger.release(first)
    assert ledger.done(first, "d", 1.0)
    assert ledger.get("a").state == "done"
    assert ledger.release(second)
    third = claim(ledger)
    assert not ledger.done(second, "d", 1.0)
    assert ledger.get("b").worker == third.worker


def test_leases_run_out(ledger: Ledger) -> None:
    ledger.want([job("a")])
    ledger.claim("w1", 0.0)
    time.sleep(0.01)
    taken = ledger.claim("w2", 60.0)
    assert taken is not None
    assert (taken.worker, taken.attempts) == ("w2", 2)


@pytest.mark.parametrize("name", ["w", "v"])
def test_a_stale_claim_changes_nothing(ledger: Ledger, name: str) -> None:
    """Also where both claims are those of one worker."""
    ledger.want([job("a")])
    stale = claim(ledger, 0.0)
    time.sleep(0.01)
    taken = claim(ledger, 60.0, name)
    before = ledger.get("a")
    assert not ledger.renew(stale, 60.0, 0.5, "still at it")
    assert not ledger.release(stale)
    assert ledger.failed(stale, ERROR) is None
    assert not ledger.done(stale, "d", 1.0)
    assert ledger.get("a") == before == taken


class Counter:
    """A clock that stands still unless told otherwise."""

    def __init__(self, name: str, seconds: float = 0.0) -> None:
        self.seconds = seconds
        self.clock = Clock(name, lambda: self.seconds)


def test_the_date_moves_no_lease(ledger: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    ledger.want([job("a")])
    held = claim(ledger)
    now = time.time
    for step in (-86400.0, 3600.0, 1e9):
        monkeypatch.setattr(time, "time", lambda step=step: now() + step)
        assert Ledger(ledger.path).claim("other", 60.0) is None
        assert ledger.renew(held, 60.0)


def test_a_lease_by_another_boot_s_clock_is_watched(ledger: Ledger) -> None:
    """Neither counter says anything of the other; a sign of life within the lease does."""
    theirs, ours = Counter("before", 1e6), Counter("since", 5.0)
    alive, watcher = Ledger(ledger.path, theirs.clock), Ledger(ledger.path, ours.clock)
    ledger.want([job("a")])
    held = claim(alive, 30.0)
    assert watcher.claim("new", 30.0) is None
    for _ in range(3):
        ours.seconds, theirs.seconds = ours.seconds + 29.0, theirs.seconds + 29.0
        assert watcher.claim("new", 30.0) is None
        assert alive.renew(held, 30.0)
    assert watcher.claim("new", 30.0) is None
    ours.seconds += 29.0
    assert watcher.claim("new", 30.0) is None
    ours.seconds += 2.0
    taken = watcher.claim("new", 30.0)
    assert taken is not None
    assert not alive.renew(held, 30.0)


def test_a_time_namespace_shares_its_host_s_clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offsets = tmp_path / "timens_offsets"
    offsets.write_text("monotonic        1000   500000000\nboottime  7  0\n")
    monkeypatch.setattr(time, "monotonic", lambda: 5000.25)
    before = Clock.of_host().now()
    monkeypatch.setattr(clock, "_OFFSETS", offsets)
    clock._namespace_offset.cache_clear()
    try:
        assert Clock.of_host().now() - before == -1000.5
    finally:
        clock._namespace_offset.cache_clear()


def test_a_job_that_kills_its_workers_is_given_up(ledger: Ledger) -> None:
    ledger.want([job("a")])
    for _ in range(MAX_LOST):
        assert ledger.claim("w", -1.0) is not None
    assert ledger.claim("w", -1.0) is None
    lost = ledger.get("a")
    assert lost.state == "failed"
    assert lost.error is not None
    assert lost.error["code"] == "worker-lost"


def test_a_job_whose_runners_die_is_given_up(ledger: Ledger) -> None:
    """Whoever knows that a runner is dead says so at once, and the attempt counts as if its lease had run out."""
    ledger.want([job("a")])
    for attempt in range(1, MAX_LOST + 1):
        held = claim(ledger)
        assert held.attempts == attempt
        assert ledger.lost(held)
        assert not ledger.lost(held)
    found = ledger.get("a")
    assert (found.state, found.worker) == ("failed", None)
    assert found.error is not None
    assert found.error["code"] == "worker-lost"


def test_claims_among_keys_and_plans_that_share_jobs(ledger: Ledger) -> None:
    ledger.want([job("a"), job("b")], plan="p")
    ledger.want([job("b"), job("c")], plan="q")
    claimed = ledger.claim("w", 60.0, keys={"c", "b"})
    assert claimed is not None
    assert claimed.key == "b"
    assert ledger.claim("w", 60.0, keys=[]) is None
    assert [j.key for j in ledger.jobs(plan="q")] == ["b", "c"]
    assert ledger.counts("q")["running"] == ledger.counts("p")["running"] == 1
    assert ledger.get("b").plan == "p"


def test_unknown_jobs(ledger: Ledger) -> None:
    with pytest.raises(UnknownJob):
        ledger.get("nobody")


def test_want_is_all_or_nothing(ledger: Ledger) -> None:
    def half() -> object:
        yield job("a")
        raise RuntimeError("the plan broke")

    with pytest.raises(RuntimeError):
        ledger.want(half())  # type: ignore[arg-type]
    assert sum(ledger.counts().values()) == 0


CLAIM = """
import sys
from store.ledger.ledger import Ledger
ledger = Ledger(sys.argv[1])
while (job := ledger.claim(sys.argv[2], 600.0)) is not None:
    print(job.key, flush=True)
    ledger.done(job, "d", 0.0)
"""


def test_no_job_is_handed_out_twice(ledger: Ledger) -> None:
    # nobody has opened the file yet: the processes also race to create it
    ledger.path.parent.mkdir(exist_ok=True)
    Ledger(ledger.path).want(job(f"{i:03d}") for i in range(240))
    processes = [python(CLAIM, ledger.path, f"w{i}") for i in range(4)]
    claimed = [line for process in processes for line in process.communicate(timeout=120)[0].split()]
    assert sorted(claimed) == [f"{i:03d}" for i in range(240)]
    assert ledger.counts()["done"] == 240


CREATE = "import sys; from store.ledger.ledger import Ledger; print(Ledger(sys.argv[1]).counts()['done'])"


def test_processes_race_to_create_the_file(ledger: Ledger) -> None:
    processes = [python(CREATE, ledger.path) for _ in range(4)]
    assert [process.communicate(timeout=120)[0].strip() for process in processes] == ["0"] * 4


def test_threads_share_a_ledger(ledger: Ledger) -> None:
    ledger.want(job(str(i)) for i in range(60))
    claimed: list[str] = []

    def work(name: str) -> None:
        while (taken := ledger.claim(name, 60.0)) is not None:
            claimed.append(taken.key)

    threads = [threading.Thread(target=work, args=(f"t{i}",)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(claimed) == len(set(claimed)) == 60


FORK = """
import os, sys
from store.ledger.jobs import JobSpec
from store.ledger.ledger import Ledger
ledger = Ledger(sys.argv[1])
ledger.want([JobSpec(str(i), "s", "1", {}, {}) for i in range(40)])
children = []
for worker in range(2):
    child = os.fork()
    if child == 0:
        while (job := ledger.claim(str(worker), 60.0)) is not None:
            ledger.done(job, "d", 0.0)
        os._exit(0)
    children.append(child)
codes = [os.waitpid(child, 0)[1] for child in children]
print(codes, ledger.counts()["done"])
"""


def test_a_fork_opens_its_own_connection(ledger: Ledger) -> None:
    assert python(FORK, ledger.path).communicate(timeout=120)[0].strip() == "[0, 0] 40"


def test_travels_between_processes(ledger: Ledger) -> None:
    ledger.want([job("a")])
    again = pickle.loads(pickle.dumps(ledger))
    assert again.get("a") == ledger.get("a")
    ledger.close()
    assert ledger.get("a").state == "wanted"


def test_rebuilt_from_shards_alone(store: Store) -> None:
    keys = fill(store, te=[0.03, 0.04], gamma=[10, 30], resolution=8)
    before = {j.key: (j.params, j.need, j.digest, j.solver, j.version) for j in store.ledger.jobs()}
    store.ledger.close()
    for path in store.root.glob("ledger*"):
        path.unlink()
    damaged = store.shard_path(keys[0])
    damaged.write_bytes(damaged.read_bytes()[:-9])
    assert store.ledger.rebuild(store.results()) == 3
    after = {j.key: (j.params, j.need, j.digest, j.solver, j.version) for j in store.ledger.jobs("done")}
    assert after == {name: row for name, row in before.items() if name != keys[0]}
    assert store.ledger.want([spec(te=0.03, gamma=10, resolution=8)]) == 1


def test_rebuilding_takes_back_what_is_gone(store: Store) -> None:
    keys = fill(store, te=[0.03, 0.04], resolution=8)
    store.shard_path(keys[1]).unlink()
    assert store.ledger.rebuild(store.results()) == 1
    assert [store.ledger.get(name).state for name in keys] == ["done", "wanted"]


def test_what_ends_while_a_ledger_is_rebuilt_stays(store: Store) -> None:
    """Its shard may have come after those that were listed; and so may one that was missing before."""
    (gone,) = fill(store, te=[0.03], resolution=8)
    store.shard_path(gone).unlink()
    keys = {name: (spec(te=te, resolution=8), make(te=te, resolution=8)[1]) for name, te in ((gone, 0.03), ("b", 0.04))}
    store.ledger.want([keys["b"][0]])

    def meanwhile() -> Iterator[xr.Dataset]:
        yield from store.results()
        Queue(store.ledger).ask(keys[gone][0], "w", lost=True)
        for asked, result in keys.values():
            held = store.ledger.claim("w", 60.0, [asked.key])
            assert held is not None
            assert store.ledger.done(held, store.put(asked.key, result), 1.0)

    assert store.ledger.rebuild(meanwhile()) == 0
    assert store.ledger.counts()["done"] == 2
    assert all(found.digest for found in store.ledger.jobs())


def test_every_run_that_was_begun_is_charged(ledger: Ledger) -> None:
    """Taken back and asked for again it begins anew; what was never begun costs nothing, however often it is asked."""
    queue, asker, quota = Queue(ledger), Asker("t"), Quota(9, 9, Spending(token=100.0))
    for _ in range(5):
        queue.ask(job("a"), asker, quota, expected=40.0)
        queue.withdraw("a", asker.id)
    for _ in range(2):
        queue.ask(job("a"), asker, quota, expected=40.0)
        claim(ledger)
        queue.withdraw("a", asker.id)
    with pytest.raises(QuotaSpent, match="asked for 80 s"):
        queue.ask(job("a"), asker, quota, expected=40.0)
    queue.ask(job("b"), asker, quota, expected=20.0)
    queue.withdraw("b", asker.id)
    # a run that goes on is paid once by each who has asked for it, and by what it took
    queue.ask(job("b"), asker, quota, expected=20.0)
    running = claim(ledger)
    other = Asker("u", client="here")
    queue.ask(job("b"), other, Quota(9, 9, Spending(token=30.0)), expected=20.0)
    queue.withdraw("b", asker.id)
    queue.ask(job("b"), asker, expected=20.0)
    assert ledger.done(running, "d", 15.0)
    with pytest.raises(QuotaSpent, match="asked for 95 s"):
        queue.ask(job("c"), asker, quota, expected=40.0)
    with pytest.raises(QuotaSpent, match="asked for 15 s"):
        queue.ask(job("c"), other, Quota(9, 9, Spending(token=30.0)), expected=40.0)


@pytest.mark.parametrize("end", ["cancelled", "failed"])
def test_who_asked_before_a_job_ended_has_no_part_in_the_next(ledger: Ledger, end: str) -> None:
    queue = Queue(ledger)
    queue.ask(job("a"), "first")
    if end == "cancelled":
        ledger.cancel(["a"])
    else:
        assert ledger.failed(claim(ledger), ERROR, 1) == "failed"
    queue.ask(job("a"), "second", again=True)
    assert not queue.withdraw("a", "first")[1]
    assert queue.withdraw("a", "second")[0].state == "cancelled"
    # nor is a sweep's job the queue's
    ledger.want([job("a")], "sweep")
    assert queue.waiting() == []


def test_what_jobs_are_of_is_read_when_it_is_wanted(ledger: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mesh among the parameters takes a third of a second, and runners ask twice a second how their jobs are."""
    ledger.want([job("a")], plan="p")
    held = claim(ledger)
    read: list[str] = []
    loads = jobs.json.loads

    def counted(text: str) -> object:
        read.append(text)
        return loads(text)

    monkeypatch.setattr(jobs.json, "loads", counted)
    [found] = ledger.running("w")
    assert found.key == held.key
    assert ledger.get("a").state == "running"
    assert pickle.loads(pickle.dumps(found)).state == "running"  # as it goes to a worker
    assert '{"te":0.04}' not in read
    assert found.params == {"te": 0.04}
    assert (dict(found.params), len(found.params), repr(found.params)) == ({"te": 0.04}, 1, "{'te': 0.04}")
    assert found.params["te"] == 0.04
    assert read.count('{"te":0.04}') == 1
    assert pickle.loads(pickle.dumps(found)) == found
