"""A small real table, built by the store from results with a known answer, and a real server on loopback over it."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest
import uvicorn
from fastapi import FastAPI

from service.app import create_app
from service.limits.connections import GuardedProtocol
from service.settings import Settings
from solver import registry
from solver.dehydration import SOLVER
from store import tables
from store.store import Store

from ..store.conftest import fill
from ._asking import ROOT
from ._browser import CHROMIUM, FLAGS
from ._jobs import bearer

if TYPE_CHECKING:
    from playwright.sync_api import Browser

AXES = {"te": [0.02, 0.06], "gamma": [5.0, 20.0]}
SHAPE = "/v1/shapes/dehydration"
QUERY: dict[str, Any] = {"te": 0.03, "gamma": 7.0, "s": 0.25, "resolution": 16}


def build(store: Store, name: str = "default", **options: Any) -> tables.TableInfo:
    return tables.build(store, SOLVER, name, **options)


@contextmanager
def served(app: FastAPI, ws: Any = "none") -> Iterator[httpx.Client]:
    server = uvicorn.Server(uvicorn.Config(app, port=0, http=GuardedProtocol, ws=ws, log_config=None, access_log=False))
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        deadline = time.monotonic() + 60
        while not server.started and time.monotonic() < deadline:
            time.sleep(0.01)
        port = server.servers[0].sockets[0].getsockname()[1]
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=120) as client:
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
    for left in (2, 1, 0):
        try:
            return Store.open(shutil.copytree(built, tmp_path / "store"))
        except shutil.Error:
            # the last reader of the ledger takes its side files away while they are copied
            if not left:
                raise
            shutil.rmtree(tmp_path / "store")
    raise AssertionError("unreachable")


@pytest.fixture(scope="session")
def client(built: Path) -> Iterator[httpx.Client]:
    with client_of(built) as client:
        yield client


@pytest.fixture(scope="module")
def shrinking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the solver `shrinking` the way any third one is, here and in the workers."""
    info = tmp_path_factory.mktemp("site") / "shrinking-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: shrinking\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[wizen.solvers]\nshrinking = shrinking:SOLVER\n")
    paths = [str(ROOT / "tests" / "sweeps"), str(info.parent), str(ROOT)]
    with pytest.MonkeyPatch.context() as patch:
        for path in paths[:2]:
            patch.syspath_prepend(path)
        patch.setenv("PYTHONPATH", os.pathsep.join(paths))
        for found in (registry._places, registry.get):
            found.cache_clear()
        yield
    for found in (registry._places, registry.get):
        found.cache_clear()


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file with a line per solve, in whichever process."""
    monkeypatch.setenv("SHRINKING_LOG", str(tmp_path / "solves.log"))
    return tmp_path / "solves.log"


@pytest.fixture
def store(tmp_path: Path, log: Path) -> Store:
    return Store.open(tmp_path / "store", create=True)


@pytest.fixture
def queue_only(store: Store) -> Iterator[httpx.Client]:
    """A service that leaves its jobs to others, asked by somebody who may."""
    with client_of(store.root, jobs_workers=0, max_jobs=4, max_jobs_per_token=3) as client:
        client.headers.update(bearer(store))
        yield client


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A Chromium without a window, for the tests of the page."""
    api = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install -e '.[browser]'")
    with api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()
