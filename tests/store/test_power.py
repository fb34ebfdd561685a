"""The power may fail at any moment: after it a store has the old state or the new one, and what was said to be there.

Everything that is written, synced and renamed is recorded, and at each point all that a disk may then hold is laid
down and opened (`_disk`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from solver.dehydration import SOLVER
from store import tables
from store.errors import CorruptShard, CorruptTable, CorruptTokens, MissingStore, UnknownJob, UnknownTable
from store.lookup import ShapeTable
from store.store import Store
from store.tokens import Tokens

from ._disk import Disk, Tree, lay_down, recorded
from .conftest import fill, make

ASKED: dict[str, Any] = {"te": 0.04, "stages": (0.1,), "resolution": 4}


class Judge:
    """Opens all that may be left, each state once, and keeps what was found there."""

    def __init__(self, disk: Disk, ask: Callable[[Path], str], scratch: Path) -> None:
        self._disk, self._ask, self._scratch = disk, ask, scratch
        self._known: dict[tuple[Any, ...], str] = {}
        self.seen: list[set[str]] = []

    def __call__(self) -> None:
        self.seen.append({self._judged(tree) for tree in self._disk.cuts()})

    def _judged(self, tree: Tree) -> str:
        state = tuple(sorted(tree.items()))
        if state not in self._known:
            with tempfile.TemporaryDirectory(dir=self._scratch) as place:
                root = Path(place) / "disk"
                lay_down(tree, root)
                self._known[state] = self._ask(root / "store")
        return self._known[state]

    @property
    def all(self) -> set[str]:
        return set().union(*self.seen)


def outcome(ask: Callable[[], str], nothing: type[Exception]) -> str:
    try:
        return ask()
    except (MissingStore, nothing):
        return "nothing"
    except (CorruptShard, CorruptTable, CorruptTokens):
        return "torn"


def found_shard(root: Path) -> str:
    return outcome(lambda: str(Store.open(root).get(make(**ASKED)[0]).attrs["digest"]), UnknownJob)


def found_table(root: Path) -> str:
    return outcome(lambda: ShapeTable.open(Store.open(root)).digest, UnknownTable)


def played(base: Path, act: Callable[[], Any], ask: Callable[[Path], str], forget: bool = False) -> tuple[Disk, Judge]:
    (scratch := base / "scratch").mkdir(exist_ok=True)
    disk = Disk(base / "disk")
    judge = Judge(disk, ask, scratch)
    with recorded(disk, judge, forget):
        act()
    return disk, judge


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "disk").mkdir()
    return tmp_path / "disk" / "store"


def kept(place: Path, forget: bool = False) -> tuple[Disk, Judge, str]:
    """Make a store and put a result in it; return with the digest that `put` said."""
    said: list[str] = []

    def act() -> None:
        said.append(Store.open(place, create=True).put(*make(**ASKED)))

    disk, judge = played(place.parent.parent, act, found_shard, forget)
    return disk, judge, said[0]


def test_a_result_is_there_whole_or_not_at_all_and_for_good_once_it_was_said_to_be(place: Path) -> None:
    disk, judge, digest = kept(place)
    done = [what for what, _ in disk.log]
    assert {"make", "write", "fsync", "rename"} <= set(done)
    assert judge.all == {"nothing", digest}
    assert judge.seen[0] == {"nothing"}
    assert judge.seen[-1] == {digest}
    # a second one, next to the first
    name, dataset = make(te=0.05, stages=(0.1,), resolution=4)
    _, judge = played(place.parent.parent, lambda: Store.open(place).put(name, dataset), found_shard)
    assert judge.all == {digest}


def test_a_damaged_result_is_mended_or_stays_damaged(place: Path) -> None:
    _, _, digest = kept(place)
    name, dataset = make(**ASKED)
    path = Store.open(place).shard_path(name)
    path.write_bytes(path.read_bytes()[:-1])
    _, judge = played(place.parent.parent, lambda: Store.open(place).put(name, dataset), found_shard)
    assert judge.seen[0] == {"torn"}
    assert judge.seen[-1] == {digest}
    assert judge.all == {"torn", digest}


def test_without_fsync_torn_results_would_be_found(place: Path) -> None:
    """The model is not blind: on a disk that forgets fsync the same store is torn, or loses what it said it had."""
    _, judge, digest = kept(place, forget=True)
    assert judge.all == {"nothing", "torn", digest}
    assert "nothing" in judge.seen[-1]


def test_a_table_is_the_old_one_or_the_new_one(place: Path) -> None:
    store = Store.open(place, create=True)
    fill(store, te=[0.03, 0.04], stages=(0.1,), resolution=4)
    store.ledger.close()

    def build() -> str:
        return tables.build(store, SOLVER).digest

    said: list[str] = []
    _, judge = played(place.parent.parent, lambda: said.append(build()), found_table)
    assert judge.all == {"nothing", said[0]}
    assert judge.seen[-1] == {said[0]}
    fill(store, te=[0.05], stages=(0.1,), resolution=4)
    store.ledger.close()
    _, judge = played(place.parent.parent, lambda: said.append(build()), found_table)
    assert said[0] != said[1]
    assert judge.all == {*said}
    assert judge.seen[-1] == {said[1]}


def test_tokens_are_the_old_ones_or_the_new_ones(place: Path) -> None:
    Store.open(place, create=True)
    tokens = Tokens(place)

    def found(root: Path) -> str:
        return outcome(lambda: ",".join(token.name for token in Tokens(root).all()), UnknownJob)

    _, judge = played(place.parent.parent, lambda: tokens.create("one", ["read"]), found)
    assert judge.all == {"", "one"}
    assert judge.seen[-1] == {"one"}
    _, judge = played(place.parent.parent, lambda: tokens.revoke("one"), found)
    assert judge.all == {"", "one"}
    assert judge.seen[-1] == {""}
