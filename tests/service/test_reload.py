"""New generations of a table are taken up while requests run, and none of these is lost."""

from __future__ import annotations

import threading
from pathlib import Path

import httpx
import pytest

from service.shapes.live import LiveTables
from solver import registry
from solver.dehydration import SOLVER
from store import tables
from store.errors import UnknownTable
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
