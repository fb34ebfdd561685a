from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pytest
from conftest import Solves

from store.store import Store
from sweeps.errors import InvalidOption, SweepError
from sweeps.planning.plan import Plan
from sweeps.running import executors
from sweeps.running.runner import run_plan

Write = Callable[..., Path]


def surroundings() -> tuple[str, bool]:
    return os.environ["NUMBA_NUM_THREADS"], signal.getsignal(signal.SIGINT) == signal.SIG_IGN


def digests(store: Store) -> dict[str, str]:
    return {job.key: store.get(job.key).attrs["digest"] for job in store.ledger.jobs("done")}


def test_every_executor_stores_the_same(
    shrinking: Solves, tmp_path: Path, write_plan: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    plan, found = Plan.load(write_plan()), []
    for name, opened in {"serial": executors.serial(), "processes": executors.processes(2)}.items():
        store = Store.open(tmp_path / name, create=True)
        with opened as workers:
            assert run_plan(plan, store, workers).complete
            if name == "processes":
                # what numerical libraries read is set before they load; Ctrl-C is the runner's alone
                assert workers.submit(surroundings).result() == (str(max(1, executors.cores() // 2)), True)
        found.append(digests(store))
    assert found[0] == found[1]
    assert len(found[0]) == 6


@pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::ResourceWarning")
def test_dask_stores_the_same(shrinking: Solves, tmp_path: Path, write_plan: Write) -> None:
    """A local cluster, and then the same cluster through its address, as `--scheduler` has it."""
    pytest.importorskip("distributed")
    plan = Plan.load(write_plan("[0.02, 0.03]"))
    stores = [Store.open(tmp_path / name, create=True) for name in ("serial", "dask", "scheduler")]
    with executors.choose() as workers:
        run_plan(plan, stores[0], workers)
    with executors.choose(2, dask=True) as workers:
        assert run_plan(plan, stores[1], workers).solved == 4
        address = workers._inner._client.scheduler.address  # type: ignore[attr-defined]
        with executors.choose(scheduler=address) as cluster:
            assert cluster.width == 2
            assert not cluster.shares_ledger
            assert run_plan(plan, stores[2], cluster).solved == 4
    assert digests(stores[0]) == digests(stores[1]) == digests(stores[2])


def test_one_worker_is_a_process_that_can_be_killed() -> None:
    with executors.choose() as workers:
        assert workers.width == 1
        first = workers.submit(os.getpid).result()
        assert first != os.getpid()
        stuck = workers.submit(time.sleep, 600)
        while not stuck.running():
            time.sleep(0.01)
        workers.end(stuck)
        assert isinstance(stuck.exception(300), BrokenExecutor)
        # another one takes its place
        assert workers.submit(os.getpid).result() not in (first, os.getpid())


def test_errors_come_back_from_a_process_whatever_they_are() -> None:
    with executors.processes(1) as workers:
        with pytest.raises(ZeroDivisionError):
            workers.submit(divmod, 1, 0).result()
        with pytest.raises(RuntimeError, match="Stubborn: no"):
            workers.submit(_stubborn).result()
        with pytest.raises(RuntimeError, match="Lossy: over"):
            workers.submit(_lossy).result(60)
        with pytest.raises(BrokenExecutor, match="cannot be read"):
            workers.submit(Shut).result(60)
        assert workers.submit(abs, -3).result(60) == 3


class Lossy(Exception):
    """Travels, and does not arrive."""

    def __init__(self, what: str, where: str) -> None:
        super().__init__(f"{what} {where}")


def _lossy() -> None:
    raise Lossy("over", "there")


class Shut:
    """A result that does not arrive."""

    def __reduce__(self) -> tuple[object, ...]:
        return divmod, (1, 0)


class Stubborn(Exception):
    def __reduce__(self) -> str:
        raise TypeError("this one does not travel")


def _stubborn() -> None:
    raise Stubborn("no")


def test_options_that_contradict_each_other() -> None:
    for options in ({"workers": 0}, {"workers": -1, "dask": True}, {"scheduler": "tcp://x:1", "dask": True}):
        with pytest.raises(InvalidOption), executors.choose(**options):
            pass


def test_threads_that_the_user_has_set_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "3")
    with executors.processes(1) as workers:
        assert workers.submit(surroundings).result()[0] == "3"


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://", "nonsense"])
def test_nobody_answers(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "_PATIENCE", "1s")
    if not address.startswith("tcp"):  # no client is begun that would wait for itself when it is let go
        monkeypatch.setattr(distributed, "Client", None)
    with pytest.raises(SweepError, match="no Dask scheduler answers"), executors.choose(scheduler=address):
        pass


def test_the_environment_is_left_as_it_was() -> None:
    before = dict(os.environ)
    with executors.processes(2):
        pass
    assert dict(os.environ) == before
