"""Tries a fault at every change that an operation makes to its store: no space, a broken disk, or the end of power.

    LD_PRELOAD=shim.so python -m tests.store._faults DIRECTORY SHIM OPERATION=EVERY...

Of an operation's points, every EVERY-th is tried. A child process is forked for each point, with `_shim.c` armed;
then its parent looks at what is left: what was there before still is, what was said to be done is, the operation works
when it is tried again, and nothing lies about. Prints, as JSON, for each operation how often each fault came and what
became of it, and what was wrong at which point.
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import sys
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from solver.dehydration import SOLVER
from store import tables
from store.errors import StoreError
from store.store import Store
from store.tokens import Tokens

from .conftest import fill, make, spec

KINDS = {"no space": 1, "broken": 2, "killed before": 3, "killed amid": 4}
OLD, NEW = {"te": 0.03, "resolution": 8}, {"te": 0.05, "resolution": 8}


def prepare(root: Path) -> None:
    """Make a store with something of everything in it."""
    store = Store.open(root, create=True)
    fill(store, te=[0.03, 0.04], resolution=8)
    tables.build(store, SOLVER)
    fill(store, te=[0.045], resolution=8)
    Tokens(root).create("old", ["run"])
    store.ledger.close()


def put(root: Path) -> None:
    name, dataset = make(**NEW)
    Store.open(root).put(name, dataset)


def build(root: Path) -> None:
    tables.build(Store.open(root), SOLVER)


def token(root: Path) -> None:
    Tokens(root).create("new", ["run"])


def claim(root: Path) -> None:
    store = Store.open(root)
    name, dataset = make(**NEW)
    store.ledger.want([spec(**NEW)], "plan")
    job = store.ledger.claim("worker", 60, [name])
    assert job is not None
    assert store.ledger.renew(job, 60, 0.5)
    assert store.ledger.done(job, store.put(name, dataset), 1.0)


def check(root: Path, operation: str, succeeded: bool) -> None:
    """Look at what is left, and try the operation once more."""
    store = Store.open(root)
    assert not list(root.rglob("*.part")), "leftovers after the next command"
    # what was there is there
    store.get(make(**OLD)[0])
    assert Tokens(root).all()[0].name == "old"
    done = {job.key for job in store.ledger.jobs("done")}
    assert make(**OLD)[0] in done
    assert all(store.has(key) for key in done), "done without a shard"
    info = tables.info(store)

    tables.open(store).close()
    # what was said to be done is done
    name = make(**NEW)[0]
    if succeeded:
        assert {
            "put": lambda: store.get(name) is not None,
            "build": lambda: info.samples == 3,
            "token": lambda: len(Tokens(root).all()) == 2,
            "claim": lambda: name in done and store.get(name) is not None,
        }[operation]()
    again(store, operation)
    store.ledger.close()
    assert not list(root.rglob("*.part"))


def again(store: Store, operation: str) -> None:
    name, dataset = make(**NEW)
    if operation == "token":
        if len(Tokens(store.root).all()) == 1:
            token(store.root)
    elif operation == "claim":
        store.ledger.want([spec(**NEW)])
        job = store.ledger.get(name)
        if job.state == "running":
            assert store.ledger.release(job)
        if store.ledger.get(name).state != "done":
            taken = store.ledger.claim("other", 60, [name])
            assert taken is not None
            assert store.ledger.done(taken, store.put(name, dataset), 1.0)
    else:
        OPERATIONS[operation](store.root)


OPERATIONS: dict[str, Callable[[Path], None]] = {"put": put, "build": build, "token": token, "claim": claim}


def attempt(root: Path, operation: str, shim: Any, n: int, kind: int) -> tuple[str, bool]:
    """Run the operation in a child whose n-th change fails; return how it ended, and whether the fault came."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        said = b"?"
        try:
            shim.arm(str(root).encode(), n, kind)
            try:
                OPERATIONS[operation](root)
                said = b"ok"
            except StoreError as error:
                said = error.code.encode()
            except BaseException:
                said = traceback.format_exc().encode()
        finally:
            shim.arm(b"", 0, 0) if not shim.fired() else None
            os.write(writing, (b"1" if shim.fired() else b"0") + said)
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        said = pipe.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return ("killed" if os.WTERMSIG(status) == signal.SIGKILL else "crashed"), True
    return said[1:].decode(), said[:1] == b"1"


def tried(operation: str, directory: Path, shim: Any, every: int) -> dict[str, Any]:
    """Try an operation's points on copies of the store that is there."""
    whole, root = directory / "whole", directory / "tried"
    found: dict[str, Counter[str]] = {name: Counter() for name in KINDS}
    wrong: list[str] = []
    for name, kind in KINDS.items():
        for n in range(1 + kind % every, 1000, every):
            shutil.rmtree(root, ignore_errors=True)
            shutil.copytree(whole, root)
            outcome, fired = attempt(root, operation, shim, n, kind)
            if not fired:
                wrong += [f"{name} at {n}: without a fault\n{outcome}"] if outcome != "ok" else []
                break
            found[name][outcome if len(outcome) < 30 else "untyped"] += 1
            try:
                check(root, operation, outcome == "ok")
            except BaseException:
                wrong.append(f"{name} at {n}, which ended with {outcome}\n{traceback.format_exc()}")
    return {"found": found, "wrong": wrong}


def main(directory: Path, library: str, *asked: str) -> None:
    shim = ctypes.CDLL(library)
    shim.arm.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_int]
    prepare(directory / "whole")
    each = (one.split("=") for one in asked)
    print(json.dumps({operation: tried(operation, directory, shim, int(every)) for operation, every in each}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
