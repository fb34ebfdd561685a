"""What the first visitor of a served page needs is there before him, and nobody who starts a service waits for it."""

from __future__ import annotations

import logging
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from service import maps
from service.shapes import warming
from service.shapes.live import LiveTables
from solver.contract import InvalidGeometry
from store.starter import ROOT
from store.store import Store

#: Begins a service as `wizen serve` does; prints whether compiled code is loaded at once, and once it has warmed.
SCRIPT = """
import sys, threading
from fastapi.testclient import TestClient
from threadpoolctl import threadpool_info
from service.app import create_app
from service.settings import Settings
from store.starter import ROOT
app = create_app(Settings(store=ROOT, jobs_workers=0), is_warmed=sys.argv[1] == "warmed")
with TestClient(app) as client:
    assert client.get("/v1/tables").status_code == 200
    print("numba" in sys.modules, app.state.tables.is_open("default"))
    for thread in threading.enumerate():
        if thread.name == "warming":
            thread.join()
            # one that has others to answer leaves no product to threads
            assert all(lib["num_threads"] == 1 for lib in threadpool_info() if lib["user_api"] == "blas")
    print("numba" in sys.modules, app.state.tables.is_open("default"))
"""


@pytest.mark.parametrize(("how", "after"), [("warmed", ["True True"]), ("cold", ["False False"])])
def test_a_served_app_loads_what_the_page_asks_first_and_only_then(how: str, after: list[str]) -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT, how], capture_output=True, text=True, check=True)
    # nothing of it is there when the service begins to answer
    assert done.stdout.splitlines() == ["False False", *after]


def test_an_empty_or_damaged_store_is_left_to_those_who_ask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(warming, "_PAUSE", 0.0)
    damaged = tmp_path / "damaged"
    (damaged / "tables").mkdir(parents=True)
    shutil.copytree(ROOT / "tables" / "default", damaged / "tables" / "default")
    next((damaged / "tables" / "default").glob("*.json")).write_text("{}")
    empty = tmp_path / "empty"
    Store.open(empty, create=True)
    with caplog.at_level(logging.INFO):
        for root in (tmp_path / "missing", damaged, empty):
            thread = warming.warm(LiveTables(root, 60.0), maps.listed)
            thread.join(60)
            assert not thread.is_alive()
    assert caplog.text.count("nothing to load") == 2  # an empty one has nothing wrong with it


def test_a_shape_that_cannot_be_is_no_end_of_the_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Tables may have none in the middle of their ranges."""
    monkeypatch.setattr(warming, "_PAUSE", 0.0)

    def impossible(tables: LiveTables) -> None:
        raise InvalidGeometry("the stone does not fit.")

    Store.open(tmp_path, create=True)
    with caplog.at_level(logging.INFO):
        warming.warm(LiveTables(tmp_path, 60.0), impossible).join(60)
    assert "nothing to load before the first question: the stone does not fit." in caplog.text


def test_it_waits_a_moment() -> None:
    begun = time.monotonic()
    warming.warm(LiveTables(Path("nowhere"), 60.0), maps.listed).join()
    assert time.monotonic() - begun >= warming._PAUSE
