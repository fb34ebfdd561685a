"""A world in which runners, workers and clocks fail on a schedule drawn from a seed; ledger and runner are real.

Time is a number, processes are values, results are names in a dictionary. A runner's generators are advanced when
their time has come, a worker renews and reports through the real `Hold`. Faults: crashes of runners and of workers,
suspensions of a runner with its workers, steps of the date, stops, cancellations and a new boot. When they are over,
one more runner starts that nothing happens to, as somebody who says the same command again.
"""

from __future__ import annotations

import heapq
import itertools
import random
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from pathlib import Path
from typing import Any

from store.ledger.clock import Clock
from store.ledger.jobs import Job, JobSpec
from store.ledger.ledger import MAX_LOST, Ledger
from sweeps.running.place import Place
from sweeps.running.run import Run
from sweeps.running.work import Hold, Outcome, Task, beat

__all__ = ["Broken", "World"]

LEASE = 2.0
#: Virtual seconds: faults happen in the first, and all must have ended by the second.
FAULTS_UNTIL, END = 12.0, 200.0


class Broken(AssertionError):
    """An invariant does not hold."""


class World:
    """One schedule. `ledger`, `shared_names` and `dated` put old defects back."""

    def __init__(
        self, seed: int, root: Path, ledger: type[Ledger] = Ledger, shared_names: bool = False, dated: bool = False
    ) -> None:
        self.chance = random.Random(seed)
        self.root, self.shared_names, self.dated = root, shared_names, dated
        self.kind = ledger
        self.now, self.boot, self.booted, self.date = 0.0, 0, 0.0, 1e9
        self.database = ledger(":memory:").database
        self.shards: set[str] = set()
        self.crashes: Counter[str] = Counter()
        self.faults = 0
        self.runners: list[Runner] = []
        self.processes: set[tuple[str, int]] = set()
        self._queue: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._pids = {"one": itertools.count(10), "two": itertools.count(1000)}
        count = self.chance.randint(1, 3)
        self.jobs = [JobSpec(f"{i:064x}", "x", "1", {"i": i}, {}) for i in range(count)]
        self.view = self.ledger()

    def ledger(self) -> Ledger:
        """Return the ledger as a process sees it that starts now."""
        begin = self.booted
        counter = Clock(f"boot {self.boot}", lambda: self.now - begin)
        clock = Clock("date", lambda: self.date + self.now) if self.dated else counter
        made = self.kind(":memory:", clock)
        made.database = self.database
        return made

    def at(self, delay: float, what: Callable[[], None]) -> None:
        """Let something happen after a while."""
        heapq.heappush(self._queue, (self.now + delay, next(self._order), what))

    def start(self, unharmed: bool = False) -> None:
        """Start a runner, in either namespace."""
        namespace = self.chance.choice(["one", "two"])
        self.runners.append(Runner(self, namespace, next(self._pids[namespace]), self.chance.randint(1, 2), unharmed))

    def run(self) -> None:
        """Play the schedule and check what must hold.

        Raises:
            Broken: it does not.

        """
        for _ in range(self.chance.randint(1, 2)):
            self.at(self.chance.uniform(0, 2), self.start)
        for _ in range(self.chance.randint(0, 4)):
            self.at(self.chance.uniform(0.2, FAULTS_UNTIL), self._fault)
        self.at(FAULTS_UNTIL, lambda: self.start(unharmed=True))
        while self._queue and self.now < END:
            self.now, _, what = heapq.heappop(self._queue)
            what()
        self._check()

    def _fault(self) -> None:
        alive = [runner for runner in self.runners if runner.alive and not runner.unharmed]
        kind = self.chance.choice(["crash", "suspend", "suspend", "stop", "worker", "date", "cancel", "boot"])
        if kind == "date":  # moves no lease, so that it may cost nothing
            self.date += self.chance.choice([-3600.0, 3600.0, -5.0, 5.0])
            return
        self.faults += 1
        if kind == "cancel":
            self.view.cancel([self.chance.choice(self.jobs).key])
        elif kind == "boot":
            for runner in self.runners:
                runner.crash()
            self.boot += 1
            self.booted = self.now
            self.view = self.ledger()
        elif alive:
            runner = self.chance.choice(alive)
            if kind == "crash":
                runner.crash()
            elif kind == "stop":
                runner.stop.set()
            elif kind == "suspend":
                runner.asleep_until = self.now + self.chance.choice([0.3, 1.5, 2.5, 5.0])
            elif runner.workers:
                worker = self.chance.choice(list(runner.workers.values()))
                self.crashes[worker.task.job.key] += 1
                worker.vanish()
        if self.chance.random() < 0.5:
            self.at(self.chance.uniform(0, 2), self.start)

    def _check(self) -> None:
        found = {job.key: job for job in self.view.jobs()}
        for spec in self.jobs:
            job = found[spec.key]
            lost = job.error is not None and job.attempts >= MAX_LOST
            if job.state != "done" and not (job.state == "failed" and (self.crashes[job.key] >= 2 or lost)):
                raise Broken(f"job {job.key[-1]} never ended: it is {job.state} after {job.claims} claims")
            if job.state == "done" and job.key not in self.shards:
                raise Broken(f"job {job.key[-1]} is done without a shard")
            if job.claims > 1 + self.faults:
                raise Broken(f"job {job.key[-1]} was claimed {job.claims} times for {self.faults} faults")


class Runner(Executor):
    """A process that runs all jobs, and the executor that it uses."""

    def __init__(self, world: World, namespace: str, pid: int, width: int, unharmed: bool) -> None:
        self.world, self.width, self.unharmed = world, width, unharmed
        self.ends_itself = False
        self.process = (namespace, pid)
        self.alive, self.asleep_until = True, 0.0
        self.workers: dict[Future[Outcome], Worker] = {}
        self.stop = threading.Event()
        world.processes.add(self.process)
        named = "same" if world.shared_names else namespace
        place = Place("host", f"boot {world.boot}", named, lambda other: (namespace, other) in world.processes)
        self.store: Any = _Store(world)
        self._run = Run(world.jobs, self.store, self, "", None, LEASE, self.stop, lambda: world.now, place)
        self._run.id = place.sign(pid)
        self._steps: Iterator[float] = self._run.rounds()
        self._landing = False
        self._turn = 0
        self._wake(0.0)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Outcome] = Future()
        future.set_running_or_notify_cancel()
        self.workers[future] = Worker(self, future, args[0])
        return future

    def end(self, future: Future[Outcome]) -> None:
        if future in self.workers:
            self.workers[future].vanish()

    def crash(self) -> None:
        """Let it vanish with its workers, in the middle of whatever it does."""
        self.alive = False
        self.workers.clear()
        self.world.processes.discard(self.process)

    def wake(self) -> None:
        """A result is there: the next step is taken now."""
        self._wake(0.0)

    def _wake(self, delay: float) -> None:
        self._turn += 1
        turn = self._turn
        self.world.at(delay, lambda: self._step(turn))

    def _step(self, turn: int) -> None:
        if not self.alive or turn != self._turn:
            return
        if self.world.now < self.asleep_until:
            self._wake(self.asleep_until - self.world.now)
            return
        try:
            self._wake(next(self._steps))
        except StopIteration:
            if self._landing:
                self.crash()  # its end, in good order
                return
            self._landing, self._steps = True, self._run.landing()
            self._wake(0.0)


class Worker:
    """A process that solves one job: it renews while that takes, stores the result, and reports it."""

    def __init__(self, runner: Runner, future: Future[Outcome], task: Task) -> None:
        self.runner, self.world, self.future, self.task = runner, runner.world, future, task
        self.hold = Hold(task, runner.store)
        self.left = self.world.chance.uniform(0.1, 4.0)
        self.hangs = self.world.chance.random() < 0.2
        self._next(self.world.chance.uniform(0, 0.2), self._begin)

    def vanish(self) -> None:
        if self.runner.workers.pop(self.future, None) is not None:
            self.future.set_exception(BrokenExecutor("it was killed"))
            self.runner.wake()

    def _next(self, delay: float, what: Callable[[], None]) -> None:
        def happen() -> None:
            if self.future not in self.runner.workers:
                return
            if self.world.now < self.runner.asleep_until:
                self._next(self.runner.asleep_until - self.world.now + self.world.chance.uniform(0, 0.01), what)
            else:
                what()

        self.world.at(delay, happen)

    def _begin(self) -> None:
        if not self.hold.keep():
            self._end(Outcome(self.task.job.key, "stopped"))
        elif self.task.job.key in self.world.shards:
            self._end(self.hold.report(Outcome(self.task.job.key, "done", "d", reused=True)))
        else:
            self._go_on()

    def _go_on(self) -> None:
        pause = min(beat(LEASE), self.left)
        self.left -= pause
        self._next(pause, self._store if self.left <= 0 else self._beat)

    def _beat(self) -> None:
        if self.hold.keep(0.5):
            self._go_on()
        elif self.hangs:
            self._go_on()  # it does not listen: it solves to the end, or is killed
        else:
            self._next(0.1, lambda: self._end(Outcome(self.task.job.key, "stopped")))

    def _store(self) -> None:
        self.world.shards.add(self.task.job.key)
        # anything may happen between the two
        self._next(
            self.world.chance.uniform(0, 0.3),
            lambda: self._end(self.hold.report(Outcome(self.task.job.key, "done", "d"))),
        )

    def _end(self, outcome: Outcome) -> None:
        del self.runner.workers[self.future]
        self.future.set_result(outcome)
        self.runner.wake()


class _Store:
    """What the runner needs of a store."""

    def __init__(self, world: World) -> None:
        self._world, self.root, self.ledger = world, world.root, world.ledger()

    def has(self, key: str) -> bool:
        return key in self._world.shards


class Unfenced(Ledger):
    """The ledger as it was: whoever gives a job back, fails or finishes it is believed."""

    def release(self, job: Job) -> bool:
        return super().release(self.get(job.key))

    def done(self, job: Job, digest: str, seconds: float) -> bool:
        return super().done(self.get(job.key), digest, seconds)

    def failed(self, job: Job, error: Any, max_attempts: int = 2) -> Any:
        return super().failed(self.get(job.key), error, max_attempts)
