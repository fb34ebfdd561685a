"""Scenes that take longer than their asker may wait: they stop, and what was poured so far is not lost."""

from __future__ import annotations

import contextlib
import time
from typing import Any

import httpx
import numpy as np
import pytest

from service.scenes import placing
from solver import resting
from store import starter

from .._asking import checked
from ..conftest import client_of

URL = "/v1/scenes?format=json"


def bowl(count: int, seed: int) -> dict[str, Any]:
    item = {"preset": "raisin", "stage": 0.05, "count": count, "seed": 1, "place": "bowl"}
    place = {"name": "bowl", "rule": "bowl", "radius": 2.5 * count ** (1 / 3), "seed": seed}
    return {"items": [item], "places": [place], "camera": {"position": [0, 20, 60], "fov": 40}}


def heap() -> Any:
    """Return the one that was asked for last."""
    return made[-1]


made: list[Any] = []


def watch(monkeypatch: Any) -> None:
    class Watched(resting.Pouring):
        def __init__(self, *values: Any) -> None:
            super().__init__(*values)
            made.append(self)

        def advance(self) -> None:
            # on a fast machine as well it is to take longer than its asker waits
            time.sleep(0.05)
            super().advance()

    monkeypatch.setattr(resting, "Pouring", Watched)


def stands_still(pouring: Any) -> float:
    """Return how far it came, once it goes no further."""
    share = -1.0
    while share < pouring.share:
        share = pouring.share
        time.sleep(0.2)
    return share


@pytest.mark.slow
def test_a_bowl_that_takes_longer_than_its_asker_may_wait_stops_and_goes_on(monkeypatch: Any) -> None:
    watch(monkeypatch)
    with client_of(starter.ROOT) as quiet:
        whole = checked_places(quiet.post(URL, json=bowl(30, 3)))
    placing._heap.cache_clear()
    with client_of(starter.ROOT, timeout=0.5, threads=1) as client:
        advice = set()
        for _ in range(100):
            answer = client.post(URL, json=bowl(30, 3))
            if answer.status_code == 200:
                break
            advice.add(checked(answer, 503, "timed-out")["advice"])
            assert answer.headers["retry-after"]
            if len(made) == 2 and len(advice) == 1:
                assert stands_still(heap()) < 1
        assert any("30 fruits" in text for text in advice), advice
    assert len(made) == 2
    np.testing.assert_array_equal(checked_places(answer), whole)


def checked_places(answer: httpx.Response) -> Any:
    assert answer.status_code == 200, answer.text
    return answer.json()["places"]


def test_who_leaves_stops_what_he_asked_for(monkeypatch: Any) -> None:
    watch(monkeypatch)
    made.clear()
    with client_of(starter.ROOT) as client:
        # what is imported first, or a busy machine, may take longer than the asker waits
        for _ in range(20):
            with contextlib.suppress(httpx.ReadTimeout):
                client.post(URL, json=bowl(400, 4), timeout=0.3)
            if made:
                break
        client.close()
        assert stands_still(heap()) < 1
