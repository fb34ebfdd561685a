"""What one job may cost: an operator's limits, whoever asks."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from service.errors import TooCostly
from service.jobs.submit import submit
from service.settings import Settings
from solver import registry
from solver.contract import Need
from store.ledger.asks import Asker
from store.ledger.queue import Queue
from store.store import Store

pytestmark = pytest.mark.usefixtures("shrinking")


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"max_job_seconds": 0.009}, "take about 0 s, longer than the 0.009 s"),
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
