"""Jobs of the cheap real solver `shrinking`: who asks, what is asked, and what is told."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from typing import Any

import httpx

from store.store import Store
from store.tokens import Tokens
from sweeps.running import executors
from sweeps.running.runner import run_queue


def bearer(store: Store, name: str = "tester", scope: Any = "run") -> dict[str, str]:
    return {"Authorization": f"Bearer {Tokens(store.root).create(name, [scope])[1]}"}


def body(te: float = 0.04, stages: tuple[float, ...] = (0.1, 0.2), **params: Any) -> dict[str, Any]:
    need = {"stages": stages, "quality": "preview"}
    return {"solver": "shrinking", "preset": "sphere", "params": {"te": te, **params}, "need": need}


def drain(store: Store) -> int:
    with executors.serial() as workers:
        return run_queue(store, workers, threading.Event(), patience=0)


def events(
    client: httpx.Client, url: str, last: str = "", then: Callable[[dict[str, Any]], object] = lambda event: None
) -> list[dict[str, Any]]:
    """Return all events of a job until it ends; `then` hears of each as it comes."""
    found: list[dict[str, Any]] = []
    with client.stream("GET", url, headers={"Last-Event-ID": last} if last else {}) as answer:
        if answer.status_code == 204:
            return found
        assert answer.headers["content-type"].startswith("text/event-stream")
        entry: dict[str, Any] = {}
        for line in answer.iter_lines():
            name, _, value = line.partition(": ")
            if name in ("id", "event"):
                entry[name] = value
            elif name == "data":
                found.append({**entry, "job": json.loads(value)})
                then(found[-1])
    return found
