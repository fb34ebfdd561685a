"""Live sessions are counted over processes: here, over connections of their own to one ledger."""

from __future__ import annotations

from pathlib import Path

from store.ledger.asks import Asker, Spending
from store.ledger.clock import Clock
from store.ledger.ledger import Ledger
from store.ledger.live import LEASE, LiveTally

ANN, BOB = Asker("1", "ann", "10.0.0.1"), Asker("2", "bob", "10.0.0.2")


def test_sessions_of_all_processes_count_and_those_of_a_dead_one_lapse(tmp_path: Path) -> None:
    now = [0.0]
    here, there = (LiveTally(Ledger(tmp_path / "ledger").database, Clock("boot", lambda: now[0])) for _ in range(2))
    free = Spending()
    assert here.enter("a", ANN, 3, 2, free) is None
    assert there.enter("b", ANN, 3, 2, free) is None
    held = here.enter("c", ANN, 3, 2, free)
    assert held is not None
    assert (held.open, held.own) == (2, 2)
    assert here.enter("d", BOB, 3, 2, free) is None
    assert there.enter("e", BOB, 3, 2, free) is not None  # of all together
    there.enter_anyway("admin", BOB)
    here.leave("d", 1.0)
    there.leave("admin", 0.0)
    # the process there is killed: what it had open lapses, what it said of its cost stays
    there.renew({"b": 7.0})
    now[0] += 0.6 * LEASE
    here.renew({"a": 2.0})
    now[0] += 0.6 * LEASE
    assert here.enter("f", ANN, 3, 2, free) is None
    held = here.enter("g", ANN, 9, 9, Spending(token=9.0))
    assert held is not None
    assert (held.open, held.own, held.token) == (2, 2, 9.0)
    assert here.enter("h", BOB, 9, 9, Spending(token=9.0)) is None


def test_leases_of_another_boot_hold_nothing(tmp_path: Path) -> None:
    before = LiveTally(Ledger(tmp_path / "ledger").database, Clock("one", lambda: 0.0))
    after = LiveTally(Ledger(tmp_path / "ledger").database, Clock("two", lambda: 0.0))
    assert before.enter("a", ANN, 1, 1, Spending()) is None
    assert after.enter("b", ANN, 1, 1, Spending()) is None
