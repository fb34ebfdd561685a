from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from solver import registry
from solver.dehydration import SOLVER
from store import tables
from store.checking import audit
from store.errors import CorruptShard, CorruptTable, EmptyTable, MixedSamples, StorageFull, UnknownTable
from store.lookup import ShapeTable
from store.store import Store

from .conftest import ROOT, fill, make, spec


def test_a_table_explains_itself(filled: Store) -> None:
    store, keys = filled, sorted(filled.keys())
    info = tables.build(store, SOLVER)
    assert info == tables.info(store)
    assert info.axes == {"te": (0.03, 0.05), "gamma": (10.0, 30.0)}
    assert (info.fixed["rs1"], info.fixed["imperfection"], info.fixed["seed"]) == (0.4, 0.001, 0)
    assert info.stages == (0.1, 0.2, 0.3)
    assert (info.samples, info.resolution, keys) == (9, 16, list(info.keys))
    assert store.table_names() == ["default"]
    path = tables.path_of(store, info)
    assert path.read_bytes()[:4] == b"\x89HDF"
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        assert dict(opened.sizes) == {
            "sample": 9,
            "stage": 3,
            "component": 3,
            "m": 17,
            "k": 17,
            "part": 2,
            "degree": 17,
            "ahead": 2,
            "other": 9,
            "band": 8,
        }
        assert set(opened.coords) >= {"te", "gamma", "stage", "m", "k", "component", "part", "key"}
        assert opened.spectrum.dtype == np.float32
        assert all(opened[name].attrs["units"] for name in ("te", "spectrum", "stage", "mean_radius", "roughness"))
        assert opened.attrs["digest"] == info.digest
        assert opened.attrs["solver"] == "dehydration"
        assert json.loads(opened.attrs["fixed"])["rs1"] == 0.4
        assert {"converged", "residual", "buckle_count"} <= set(opened.data_vars)
        assert "seconds" not in opened
        assert sorted(zip(opened.te.values, opened.gamma.values, strict=True))[0] == (0.03, 10.0)
    assert audit.verify(store) == []


def test_the_digest_is_of_the_content(tmp_path: Path) -> None:
    digests = set()
    for i, order in enumerate((1, -1)):
        store = Store.open(tmp_path / str(i), create=True)
        fill(store, te=[0.03, 0.04][::order])
        digests.add(tables.build(store, SOLVER).digest)
    assert len(digests) == 1
    assert tables.build(store, SOLVER, resolution=8).digest not in digests
    assert tables.build(store, SOLVER, dtype="float64").digest not in digests
    fill(store, te=[0.06])
    assert tables.build(store, SOLVER).digest not in digests


def test_rebuilt_from_shards_alone(filled: Store) -> None:
    store = filled
    before = tables.build(store, SOLVER)
    store.ledger.close()
    for path in store.root.glob("ledger*"):
        path.unlink()
    shutil.rmtree(store.tables_dir)
    after = tables.build(Store.open(store.root), SOLVER)
    assert (after.digest, after.keys, after.axes) == (before.digest, before.keys, before.axes)


def test_results_that_came_without_the_ledger_are_not_left_out(store: Store, tmp_path: Path) -> None:
    """Copied in from another machine's store, or here since before a ledger that was lost."""
    other = Store.open(tmp_path / "other", create=True)
    (failed, _) = fill(other, te=[0.03, 0.05])
    fill(store, te=[0.04])
    store.ledger.want([spec(te=0.03)])
    held = store.ledger.claim("w", 60.0)
    assert held is not None
    assert held.key == failed
    assert store.ledger.failed(held, {"code": "x"}, 1) == "failed"
    shutil.copytree(other.root / "shards", store.root / "shards", dirs_exist_ok=True)
    assert tables.build(store, SOLVER).axes["te"] == (0.03, 0.05)
    assert store.ledger.counts()["done"] == 3
    assert store.learn() == 0
    store.ledger.want([spec(te=0.06)])
    running = store.ledger.claim("w", 60.0)
    assert running is not None
    store.put(running.key, make(te=0.06)[1])
    assert store.learn() == 0, "who runs it says that it is done"
    assert store.ledger.done(running, "digest", 1.0)


def test_nothing_to_build_from(store: Store) -> None:
    with pytest.raises(EmptyTable, match="displacement"):
        tables.build(store, SOLVER)
    fill(store, te=[0.04], fields=["roughness"])
    fill(store, te=[0.04], region={"colatitude": (0, 90)})
    with pytest.raises(EmptyTable):
        tables.build(store, SOLVER)
    fill(store, te=[0.04])
    with pytest.raises(EmptyTable, match="quality"):
        tables.build(store, SOLVER, quality="fine")
    assert tables.build(store, SOLVER).samples == 1


@pytest.mark.parametrize(
    ("odd", "word"),
    [
        ({"quality": "preview"}, "quality"),
        ({"stages": (0.1, 0.2)}, "stages"),
        ({"seed": 7}, "seed"),
        ({"imperfection": 0.002}, "imperfection"),
        ({"resolution": 20}, "resolution"),
    ],
)
def test_mixed_samples_are_refused(store: Store, odd: dict[str, object], word: str) -> None:
    fill(store, te=[0.03])
    fill(store, te=[0.05], **odd)
    with pytest.raises(MixedSamples, match=word) as caught:
        tables.build(store, SOLVER)
    assert caught.value.advice


def test_plans_and_qualities_select(store: Store) -> None:
    fill(store, te=[0.03, 0.04])
    fill(store, te=[0.03, 0.05], quality="preview")
    store.ledger.want([spec(te=0.03)], plan="few")
    assert tables.build(store, SOLVER, quality="preview").samples == 2
    assert tables.build(store, SOLVER, plan="few").samples == 1


def test_a_run_that_others_start_from_is_no_sample(store: Store) -> None:
    (origin,) = fill(store, te=[0.035], stages=(0.1,))
    keys = fill(store, te=[0.03, 0.04], pattern={"key": origin, "stage": 0.1})
    table = tables.build(store, SOLVER)
    assert set(table.keys) == set(keys)
    assert table.fixed["pattern"] == {"key": origin, "stage": 0.1, "amplitude": 0.2}
    assert ShapeTable.open(store, surfaces=registry.surface).at({"te": 0.035}, 0.2).inside
    # the same fruit without the pattern is another question
    fill(store, te=[0.03])
    with pytest.raises(MixedSamples, match="pattern"):
        tables.build(store, SOLVER)


def test_the_same_run_for_other_fields_counts_once(store: Store) -> None:
    fill(store, te=[0.03, 0.04])
    fill(store, te=[0.03], fields=["displacement"])
    assert tables.build(store, SOLVER).samples == 2


def test_a_damaged_or_cut_result_is_not_left_out_silently(filled: Store) -> None:
    store = filled
    name, dataset = make(te=0.03, gamma=10.0)
    path = store.shard_path(name)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(CorruptShard):
        tables.build(store, SOLVER)
    path.unlink()
    store.put(name, dataset.isel(stage=slice(0, 2)))
    with pytest.raises(MixedSamples, match="stages"):
        tables.build(store, SOLVER)
    assert store.table_names() == []
    assert not list((store.tables_dir / "default").iterdir())


def test_a_reader_keeps_its_generation(filled: Store) -> None:
    store = filled
    old_info = tables.build(store, SOLVER)
    old = ShapeTable.open(store, surfaces=registry.surface)
    before = old.at({"te": 0.035, "gamma": 20}, 0.15).position
    assert before is not None
    fill(store, te=[0.035], gamma=[20.0])
    new_info = tables.build(store, SOLVER)
    assert new_info.digest != old_info.digest
    assert tables.prune(store) == [tables.path_of(store, old_info)]
    assert tables.prune(store) == []
    again = old.at({"te": 0.035, "gamma": 20}, 0.15).position
    np.testing.assert_array_equal(again, before)
    assert old.digest == old_info.digest
    new = ShapeTable.open(store, surfaces=registry.surface)
    assert (new.digest, new.size) == (new_info.digest, 10)
    assert new.at({"te": 0.035, "gamma": 20}, 0.2).exact


def test_a_swap_between_manifest_and_file_is_survived(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    from store import lookup

    fill(store, te=[0.03, 0.04])
    stale = [tables.build(store, SOLVER)]
    fill(store, te=[0.05])
    current = tables.build(store, SOLVER)
    tables.prune(store)
    monkeypatch.setattr(lookup, "info", lambda store, name: stale.pop() if stale else tables.info(store, name))
    assert ShapeTable.open(store, surfaces=registry.surface).digest == current.digest


def test_every_flipped_byte_is_found(store: Store) -> None:
    fill(store, te=[0.03, 0.04], resolution=8)
    path = tables.path_of(store, tables.build(store, SOLVER))
    good = path.read_bytes()
    for place in [*range(0, 600, 97), *np.linspace(0, len(good) - 1, 30).astype(int)]:
        data = bytearray(good)
        data[place] ^= 4
        path.write_bytes(data)
        with pytest.raises(CorruptTable, match="Rebuild"):
            ShapeTable.open(store, surfaces=registry.surface)
        assert len(audit.verify(store)) == 1
    manifest = path.with_name("current.json")
    text = manifest.read_bytes()
    for place in range(0, len(text), 97):
        data = bytearray(text)
        data[place] ^= 1
        manifest.write_bytes(data)
        try:
            found = tables.info(store)
        except CorruptTable:
            continue
        assert data[place : place + 1].isspace() or found == tables.TableInfo.from_json(
            {k: v for k, v in json.loads(text).items() if k != "checksum"}
        )


def test_verify_names_what_is_missing(store: Store) -> None:
    keys = fill(store, te=[0.03, 0.04])
    info = tables.build(store, SOLVER)
    store.shard_path(keys[0]).unlink()
    (finding,) = audit.verify(store)
    assert (finding.part, finding.name) == ("result", keys[0])
    tables.path_of(store, info).unlink()
    finding, _ = audit.verify(store)
    assert "missing" in finding.message
    with pytest.raises(CorruptTable, match="missing"):
        ShapeTable.open(store, surfaces=registry.surface)


@pytest.mark.parametrize("name", ["", "..", "../shards", ".hidden", "a/b", "x" * 65, "a\n"])
def test_names_that_are_no_tables(store: Store, name: str) -> None:
    with pytest.raises(UnknownTable):
        tables.info(store, name)


def test_unknown_table(store: Store) -> None:
    with pytest.raises(UnknownTable, match="Build one"):
        tables.info(store)
    fill(store, te=[0.03])
    tables.build(store, SOLVER, "plums")
    with pytest.raises(UnknownTable, match="plums"):
        ShapeTable.open(store.root, "plum", surfaces=registry.surface)


def test_no_space_is_refused_before_work(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(store, te=[0.03])
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10, 10, 0))  # type: ignore[attr-defined]
    with pytest.raises(StorageFull, match="MB"):
        tables.build(store, SOLVER)
    assert not list((store.tables_dir / "default").iterdir())


FULL = """
import shutil, sys
from solver.dehydration import SOLVER
from store import tables
from store.errors import StorageFull
from store.store import Store
shutil.disk_usage = lambda path: shutil._ntuple_diskusage(10**9, 0, 10**9)  # others fill the disk while we write
try:
    tables.build(Store.open(sys.argv[1]), SOLVER)
except StorageFull as error:
    print(error.code)
"""


def test_full_disk_while_writing_leaves_nothing(store: Store, tmp_path: Path) -> None:
    unshare = shutil.which("unshare")
    if unshare is None or subprocess.run([unshare, "-rm", "true"], capture_output=True).returncode:
        pytest.skip("no right to mount here")
    fill(store, te=[0.03, 0.04])
    script = f'mount -t tmpfs -o size=48k none {store.tables_dir} && {sys.executable} -c "$0" {store.root}'
    script += f" && ls -A {store.tables_dir}/default"
    command = [unshare, "-rm", "sh", "-c", script, FULL]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert result.stdout.split() == ["storage-full"], result.stderr


def test_two_rebuilds_at_once_lose_no_sample(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second begins with what the first has made current, and nobody prunes in the middle."""
    keys = fill(store, te=[0.03, 0.04], resolution=8)
    tables.build(store, SOLVER)
    more = fill(store, te=[0.05], resolution=8), fill(store, te=[0.06], resolution=8)
    publish, waits, ended = tables.write_manifest, threading.Event(), list[str]()

    def late(directory: Path, info: tables.TableInfo) -> None:
        waits.set()
        time.sleep(0.2)
        assert ended == []
        publish(directory, info)

    def then(what: str, do: Callable[[], object]) -> threading.Thread:
        def run() -> None:
            do()
            ended.append(what)

        thread = threading.Thread(target=run)
        thread.start()
        return thread

    with monkeypatch.context() as patch:
        patch.setattr(tables, "write_manifest", late)
        threads = [then("first", lambda: tables.rebuild(store, SOLVER, more=more[0]))]
        assert waits.wait(60)
        patch.setattr(tables, "write_manifest", publish)
        threads += [then("prune", lambda: tables.prune(store))]
        threads += [then("second", lambda: tables.rebuild(store, SOLVER, more=more[1]))]
        for thread in threads:
            thread.join(60)
    assert sorted(ended) == ["first", "prune", "second"]
    assert set(tables.info(store).keys) == {*keys, *more[0], *more[1]}
    tables.open(store).close()


def test_packed_shapes_that_do_not_move(store: Store) -> None:
    """No wave is left of them; the table opens all the same."""
    for te in (0.03, 0.04):
        key, result = make(te=te, resolution=8)
        store.put(key, result.assign(displacement=result.displacement * 0))
    tables.build(store, SOLVER, dtype="int16")
    shape = ShapeTable.open(store, surfaces=registry.surface).at({"te": 0.035}, 0.15)
    assert shape.position is not None
    assert np.isfinite(shape.position).all()
    assert audit.verify(store) == []
