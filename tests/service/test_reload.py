"""New generations of a table are taken up while requests run, and none of these is lost."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import httpx
import pytest

from service.shapes import live as module
from service.shapes.live import LiveTables
from solver import registry
from solver.dehydration import SOLVER
from store import tables
from store.errors import CorruptTable, UnknownTable
from store.lookup import ShapeTable
from store.store import Store

from ..store.conftest import fill
from ._asking import until
from .conftest import QUERY, SHAPE, build, client_of


def test_no_request_is_lost_while_tables_change(own: Store) -> None:
    answers: list[tuple[int, str]] = []
    stop = threading.Event()

    with client_of(own.root, reload_interval=0.02) as client:

        def keep_asking() -> None:
            with httpx.Client(base_url=client.base_url, timeout=120) as mine:
                while not stop.is_set():
                    answer = mine.get(SHAPE, params={**QUERY, "format": "json"})
                    answers.append((answer.status_code, answer.json().get("digest", "")))

        threads = [threading.Thread(target=keep_asking) for _ in range(3)]
        for thread in threads:
            thread.start()
        digests = [tables.info(own).digest]
        try:
            for resolution in (8, 12):
                digests.append(build(own, resolution=resolution).digest)
                tables.prune(own)
                until(lambda: bool(answers) and answers[-1][1] == digests[-1])
        finally:
            stop.set()
            for thread in threads:
                thread.join()
    assert {status for status, _ in answers} == {200}
    assert {digest for _, digest in answers} == set(digests)
    assert len(answers) > 10


def test_new_samples_change_the_tag(own: Store) -> None:
    with client_of(own.root, reload_interval=0) as client:
        query = {**QUERY, "format": "glb"}
        before = client.get(SHAPE, params=query)
        known = {"If-None-Match": before.headers["etag"]}
        assert client.get(SHAPE, params=query, headers=known).status_code == 304
        fill(own, te=[0.03], gamma=[7.0])
        build(own)
        until(lambda: client.get(SHAPE, params=query, headers=known).status_code == 200)
        after = client.get(SHAPE, params=query)
        assert after.headers["etag"] != before.headers["etag"]


def test_the_old_generation_serves_while_the_new_one_is_damaged(own: Store) -> None:
    with client_of(own.root, reload_interval=0) as client:
        first = client.get(SHAPE, params=QUERY)
        assert first.status_code == 200
        manifest = own.tables_dir / "default" / "current.json"
        damaged = manifest.with_name("damaged")
        damaged.write_text("{")
        damaged.replace(manifest)
        assert client.get(SHAPE, params=QUERY).status_code == 200
        until(lambda: "damaged" in client.get("/healthz").json()["tables"]["default"].get("complaint", ""))
        assert client.get("/healthz").status_code == 200
        assert client.get(SHAPE, params=QUERY).content
        build(own)
        until(lambda: "complaint" not in client.get("/healthz").json()["tables"]["default"])


@pytest.mark.parametrize("error", [CorruptTable("it is damaged."), KeyError("shape"), MemoryError()])
def test_a_generation_that_could_not_be_opened_is_tried_again(
    own: Store, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    """A copy brings the manifest first, and the file that it names after it: the same manifest, that is."""
    monkeypatch.setattr(module, "_AGAIN", 0.02)
    live = LiveTables(own.root, 0)
    first = live.get("default")
    tries = []

    def read(name: str) -> ShapeTable:
        tries.append(name)
        if len(tries) < 3:
            raise error
        return ShapeTable.open(own, name, surfaces=registry.surface)

    monkeypatch.setattr(live, "_read", read)
    build(own, resolution=8)
    until(lambda: live.get("default") is first and bool(live.complaint("default")))
    until(lambda: live.get("default") is not first)
    assert (len(tries), live.complaint("default")) == (3, "")
    assert live.get("default").digest == tables.info(own).digest


def test_what_goes_on_failing_is_tried_ever_more_seldom(own: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    live = LiveTables(own.root, 0)
    live.get("default")
    entry, stamp = live._open["default"], (0, 0, 0)
    entry.stamp = stamp
    monkeypatch.setattr(live, "_read", {}.__getitem__)
    waits = []
    for _ in range(2000):
        live._renew("default", entry, stamp)
        waits.append(round(entry.again - time.monotonic(), 1))
    assert waits[:4] == [0.5, 1.0, 2.0, 4.0]
    assert waits[-1] == max(waits) == 60.0


def test_a_deleted_table_is_gone_and_may_come_back(own: Store) -> None:
    live = LiveTables(own.root, 0)
    assert live.get("default").size == 4
    (own.tables_dir / "default" / "current.json").unlink()
    with pytest.raises(UnknownTable):
        live.families(SOLVER)
    with pytest.raises(UnknownTable):
        live.get("default")
    build(own)
    assert live.get(live.families(SOLVER).infos[0].name).size == 4


def test_a_manifest_is_not_looked_at_for_every_request(own: Store) -> None:
    live = LiveTables(own.root, 60)
    first = live.get("default")
    build(own, resolution=8)
    assert live.get("default") is first


def test_choosing(own: Store) -> None:
    live = LiveTables(own.root, 0)
    build(own, "dehydration")
    live.belongs("default", "dehydration")
    with pytest.raises(UnknownTable, match="belongs to the solver"):
        live.belongs("default", "decay")
    with pytest.raises(UnknownTable, match="no table of 'decay'"):
        live.families(registry.get("decay"))
    both = live.families(SOLVER)
    assert [info.name for info in both.infos] == ["default", "dehydration"]
    assert live.families(SOLVER) is both
    (own.tables_dir / "default" / "current.json").unlink()
    assert [info.name for info in live.families(SOLVER).infos] == ["dehydration"]


@pytest.mark.slow
def test_twenty_generations_under_load(tmp_path: Path) -> None:
    """The benchmark's 200 swaps in little: 16 connections, and every swap waits until it is answered from."""
    from benchmarks.service.__main__ import swaps

    store = Store.open(tmp_path / "store", create=True)
    fill(store, te=[0.02, 0.06], gamma=[10.0, 60.0])
    build(store)
    found = swaps(store.root, 20, resolution=8)
    assert found["swaps"] == 20
    assert found["failed"] == 0
    assert found["requests"] > 100


def test_a_picture_has_the_tag_of_the_generation_that_it_is_of(own: Store) -> None:
    old = tables.info(own).digest
    with client_of(own.root, reload_interval=60) as client:
        assert client.get(SHAPE, params=QUERY).status_code == 200
        address = "/v1/maps/default/thumbnail.png"
        before = client.get(address)
        assert (old[:32] in before.headers["etag"], before.headers["cache-control"]) == (True, "public, max-age=86400")
        build(own, resolution=8)
        assert tables.info(own).digest != old
        # the new one is not open yet
        during = client.get(address)
        assert (during.headers["etag"], during.content) == (before.headers["etag"], before.content)
        assert during.headers["cache-control"] == "no-cache"  # its address names the new one
        again = client.get(address, headers={"If-None-Match": before.headers["etag"]})
        assert (again.status_code, again.headers["cache-control"]) == (304, "no-cache")
    with client_of(own.root) as client:
        assert tables.info(own).digest[:32] in client.get(address).headers["etag"]
