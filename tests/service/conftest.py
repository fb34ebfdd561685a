"""A small real table, built by the store from results with a known answer, and a real server on loopback over it."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn
from fastapi import FastAPI

from service.app import create_app
from service.settings import Settings
from solver.dehydration import SOLVER
from store import tables
from store.store import Store

from ..store.conftest import fill

AXES = {"te": [0.02, 0.06], "gamma": [5.0, 20.0]}
SHAPE = "/v1/shapes/dehydration"
QUERY: dict[str, Any] = {"te": 0.03, "gamma": 7.0, "s": 0.25, "resolution": 16}


def build(store: Store, name: str = "default", **options: Any) -> tables.TableInfo:
    return tables.build(store, name, axes=SOLVER.params.axes, units={"te": "r1", "gamma": "1"}, **options)


@contextmanager
def served(app: FastAPI) -> Iterator[httpx.Client]:
    server = uvicorn.Server(uvicorn.Config(app, port=0, ws="none", log_config=None, access_log=False))
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        deadline = time.monotonic() + 10
        while not server.started and time.monotonic() < deadline:
            time.sleep(0.01)
        port = server.servers[0].sockets[0].getsockname()[1]
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=20) as client:
            yield client
    finally:
        server.should_exit = True
        thread.join()


def client_of(root: Path, **settings: Any) -> Any:
    return served(create_app(Settings(store=root, **settings)))


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with one table `default`; do not change it."""
    store = Store.open(tmp_path_factory.mktemp("service") / "store", create=True)
    fill(store, **AXES)
    build(store)
    return store.root


@pytest.fixture
def own(built: Path, tmp_path: Path) -> Store:
    """A copy of the store that a test may change."""
    return Store.open(shutil.copytree(built, tmp_path / "store"))


@pytest.fixture(scope="session")
def client(built: Path) -> Iterator[httpx.Client]:
    with client_of(built) as client:
        yield client
