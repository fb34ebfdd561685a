"""What one job may cost: an operator's limits, whoever asks."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from service.errors import TooCostly
from service.jobs.submit import submit
from service.settings import Settings
from solver import registry
from solver.contract import Cost, Need
from store.ledger.asks import Asker
from store.ledger.queue import Queue
from store.store import Store

pytestmark = pytest.mark.usefixtures("shrinking")


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"max_job_seconds": 0.009}, "take about 0.01 s, longer than the 0.009 s"),
        ({"max_job_bytes": 999.0}, "need about .* GB, more than"),
        ({"max_job_seconds": 0.011, "max_job_bytes": 1e6}, None),
    ],
)
def test_a_job_costs_no_more_than_the_operator_allows(store: Store, limits: dict[str, Any], words: str | None) -> None:
    """`shrinking` expects 0.01 s and 1000 bytes, whatever it is asked."""
    state: Any = SimpleNamespace(settings=Settings(store=store.root, **limits), tables=SimpleNamespace(store=store))
    asked = (state, registry.get("shrinking"), {"te": 0.03}, Need(stages=(0.1,), quality="preview"), Asker("somebody"))
    if words:
        with pytest.raises(TooCostly, match=words):
            submit(*asked, preset="sphere")
        assert Queue(store.ledger).waiting() == []
        # an administrator may
        submit(*asked, preset="sphere", unlimited=True)
    else:
        submit(*asked, preset="sphere")
    assert len(Queue(store.ledger).waiting()) == 1


@pytest.mark.parametrize(("name", "unit"), [("max_job_seconds", "s"), ("max_job_bytes", "GB")])
def test_a_limit_of_what_a_run_is_said_to_take_lets_it_in(store: Store, name: str, unit: str) -> None:
    costly = replace(registry.get("shrinking"), cost=lambda params, need: Cost(1234.4, 1_234_400_001))

    def ask(limit: float) -> None:
        settings = Settings(store=store.root, **{name: limit})
        state: Any = SimpleNamespace(settings=settings, tables=SimpleNamespace(store=store))
        submit(state, costly, {"te": 0.03}, Need(stages=(0.1,), quality="preview"), Asker("somebody"), preset="sphere")

    with pytest.raises(TooCostly) as refused:
        ask(1.0)
    told = re.search(rf"about (\S+) {unit},", refused.value.message)
    assert told is not None
    ask(float(told[1]) * (1e9 if unit == "GB" else 1))
