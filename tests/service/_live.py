"""A service of live sessions, and who is in it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil
import pytest
from websockets.exceptions import ConnectionClosed

from service.app import create_app
from service.settings import Settings
from store.store import Store

from ._jobs import bearer
from ._session import Client
from .conftest import served

__all__ = ["BALL", "Served", "engines", "live", "one_service", "refused", "serving"]

BALL = {"shape": "sphere", "thickness": 0.1, "tools": [], "step": 0.05}


class Served:
    """A service with a token."""

    def __init__(self, url: str, root: Path) -> None:
        self.url, self.root = url, root
        self.clients: list[Client] = []
        self.token = bearer(Store.open(root))["Authorization"].removeprefix("Bearer ")

    def client(self, params: dict[str, Any] | None = None, **more: Any) -> Client:
        opening = {"token": self.token, "params": BALL if params is None else params, "quality": "preview", **more}
        self.clients.append(Client(self.url, **opening))
        return self.clients[-1]

    def end(self) -> None:
        """End what a test that failed left open: its sessions would count in the next ones."""
        for client in self.clients:
            with suppress(ConnectionClosed, OSError, AssertionError):
                client.end()
        self.clients.clear()


@contextmanager
def serving(root: Path, **settings: Any) -> Iterator[Served]:
    store = Store.open(root, create=True)
    with served(create_app(Settings(store=store.root, **settings)), ws="websockets-sansio") as client:
        yield Served(str(client.base_url), root)


@pytest.fixture(scope="module")
def one_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serving(tmp_path_factory.mktemp("live") / "store", max_sessions=3, max_sessions_per_token=2) as found:
        yield found


@pytest.fixture
def live(one_service: Served) -> Iterator[Served]:
    yield one_service
    one_service.end()


def engines() -> set[int]:
    found = set()
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):  # gone, or about to
            if "sweeps.live.worker" in " ".join(child.cmdline()):
                found.add(child.pid)
    return found


def refused(client: Client) -> tuple[dict[str, Any], int]:
    """Return the problem that a client is sent away with, and the code."""
    said = client.opened()
    assert said["say"] == "error", said
    with pytest.raises(ConnectionClosed) as closed:
        client.until(lambda c: False)
    client.close()
    assert closed.value.rcvd is not None
    return said["problem"], closed.value.rcvd.code
