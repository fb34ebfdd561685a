from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from solver.dehydration import SOLVER
from store import seal, tables
from store.checking import audit, compare, truncation
from store.errors import CorruptTable, UnknownJob
from store.manifest import write_manifest
from store.store import Store

from .conftest import fill


def flip(path: Path, place: float) -> None:
    data = bytearray(path.read_bytes())
    data[int(place * (len(data) - 1))] ^= 1
    path.write_bytes(data)


def test_one_flipped_byte_is_found_in_each_part(store: Store) -> None:
    keys = fill(store, te=[0.03, 0.04])
    table = tables.build(store, SOLVER)
    assert audit.verify(store) == []
    file = tables.path_of(store, table)
    parts = {"generation": file, "result": store.shard_path(keys[1])}
    for part, path in parts.items():
        good = path.read_bytes()
        for place in (0.0, 0.3, 0.6, 1.0):
            flip(path, place)
            (finding,) = audit.verify(store)
            assert finding.part == part
            assert finding.name in (path.name, path.stem)
            path.write_bytes(good)
    assert audit.verify(store) == []
    manifest = file.with_name("current.json")
    text = manifest.read_text()
    manifest.write_text(text.replace('"resolution": 16', '"resolution": 17', 1))
    (finding,) = audit.verify(store)
    assert finding.part == "manifest"


@pytest.fixture(scope="module")
def _tabled_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    store = Store.open(tmp_path_factory.mktemp("tabled") / "store", create=True)
    fill(store, te=[0.03, 0.04, 0.05])
    tables.build(store, SOLVER)
    store.ledger.close()
    return store.root


@pytest.fixture
def tabled(tmp_path: Path, _tabled_once: Path) -> Store:
    """Return a store of its own with a table."""
    return Store.open(shutil.copytree(_tabled_once, tmp_path / "tabled"))


def edited(path: Path, edit: Callable[[h5py.File], None]) -> None:
    """Change a sealed file and seal it again, as a program would that means well."""
    path.write_bytes(path.read_bytes()[: -seal.TRAILER])
    with h5py.File(path, "r+") as file:
        edit(file)
    seal.seal(path)


def _move(file: h5py.File) -> None:
    file["spectrum"][1, 0, 0, 2, 2, 0] += 0.01


def _blind(file: h5py.File) -> None:
    file["left_out_dB"][0, 0] = np.nan


def _units(file: h5py.File) -> None:
    file["mean_radius"].attrs["units"] = "m"


def _axis(file: h5py.File) -> None:
    file["te"][...] = file["te"][...] * 1.01


@pytest.mark.parametrize(
    ("edit", "part", "said"),
    [
        (_move, "result", "other values than the result"),
        (_blind, "trust", "left_out_dB is not finite"),
        (_units, "generation", "mean_radius is in 'm'"),
        (_axis, "generation", "te runs from"),
    ],
)
def test_what_a_seal_does_not_tell(tabled: Store, edit: Callable[[h5py.File], None], part: str, said: str) -> None:
    from store.generations import generation

    store = tabled
    table = tables.info(store)
    file = tables.path_of(store, table)
    edited(file, edit)
    assert any("other values than the manifest" in finding.message for finding in audit.verify(store))
    # even one whose digest was made to fit, in the file as in the manifest
    digest = generation.digest(file)
    edited(file, lambda opened: opened.attrs.__setitem__("digest", digest))
    write_manifest(store.tables_dir, replace(table, digest=digest))
    findings = audit.verify(store)
    assert [finding.part for finding in findings] == [part]
    assert said in findings[0].message


def test_a_generation_that_is_pruned_meanwhile_is_no_finding(filled: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    tables.build(filled, SOLVER)
    real, turns = audit._file, iter(["float64"])

    def late(path: Path, table: tables.TableInfo) -> list[str]:
        for dtype in turns:
            tables.rebuild(filled, SOLVER, dtype=dtype)  # type: ignore[arg-type]
            tables.prune(filled)
        return list(real(path, table))

    monkeypatch.setattr(audit, "_file", late)
    assert audit.verify(filled) == []
    tables.path_of(filled, tables.info(filled)).unlink()
    assert "is missing" in audit.verify(filled)[0].message


def test_a_result_that_was_replaced(store: Store) -> None:
    keys = fill(store, te=[0.03, 0.04])
    tables.build(store, SOLVER)
    result = store.get(keys[0])
    store.shard_path(keys[0]).unlink()
    store.put(keys[0], result.assign(displacement=result["displacement"] * 1.01))
    said = [finding.message for finding in audit.verify(store) if finding.name == keys[0]]
    assert len(said) == 2
    assert "ledger noted" in said[0]


def test_rebuilding_keeps_the_runs_and_the_old_generation(filled: Store) -> None:
    first = tables.build(filled, SOLVER)
    fill(filled, te=[0.06], gamma=[10, 20, 30])
    old = tables.path_of(filled, first)
    exact = tables.rebuild(filled, SOLVER, dtype="float64")
    assert (exact.keys, exact.resolution, exact.dtype) == (first.keys, 16, "float64")
    coarse = tables.rebuild(filled, SOLVER, resolution=5)
    assert (coarse.resolution, coarse.dtype) == (5, "float64")
    assert old.is_file()
    again = tables.rebuild(filled, SOLVER, resolution=99, dtype="float32")
    assert again.digest == first.digest
    assert audit.verify(filled) == []
    with pytest.raises(UnknownJob, match="1 of the table's 10"):
        tables.rebuild(filled, SOLVER, more=["0" * 64])
    assert tables.info(filled) == again


def test_what_truncation_costs(filled: Store) -> None:
    whole = truncation.losses(filled, tables.build(filled, SOLVER, dtype="float64"))
    assert max(loss.max for loss in whole) < 1e-12
    single = truncation.losses(filled, tables.rebuild(filled, SOLVER, dtype="float32"))
    assert 1e-10 < single[-1].rms < 1e-7
    cut = truncation.losses(filled, tables.rebuild(filled, SOLVER, resolution=5))
    # the harmonic of degree 6 is what is lost, and its amplitude is linear in the stage
    assert [loss.stage for loss in cut] == [0.1, 0.2, 0.3]
    assert cut[2].rms == pytest.approx(3 * cut[0].rms, rel=1e-3)
    assert 0.001 < cut[2].rms < cut[2].max < 0.2


def test_a_damaged_generation_is_rebuilt(filled: Store) -> None:
    table = tables.build(filled, SOLVER)
    flip(tables.path_of(filled, table), 0.5)
    assert tables.rebuild(filled, SOLVER).digest == table.digest
    assert audit.verify(filled) == []


def test_comparing(filled: Store) -> None:
    whole = tables.build(filled, SOLVER)
    left = tables.path_of(filled, whole)
    assert compare.compare(left, left).equal
    cut = tables.path_of(filled, tables.rebuild(filled, SOLVER, resolution=5))
    found = compare.compare(left, cut)
    assert not found.equal
    assert (found.common, found.only_a, found.only_b, found.fixed) == (9, (), (), {})
    rows = {row.stage: row for row in found.differences if row.of == "displacement"}
    lost = {loss.stage: loss for loss in truncation.losses(filled, tables.info(filled))}
    for stage, row in rows.items():
        assert row.rms == pytest.approx(lost[stage].rms, rel=1e-3)
    assert all(row.max == 0 for row in found.differences if row.of == "mean_radius")
    json.dumps(found.to_json(), allow_nan=False)


def test_comparing_other_samples_and_settings(filled: Store, tmp_path: Path) -> None:
    a = tables.path_of(filled, tables.build(filled, SOLVER))
    other = Store.open(tmp_path / "other", create=True)
    fill(other, te=[0.03, 0.06], gamma=[10.0, 20.0], seed=3)
    b = tables.path_of(other, tables.build(other, SOLVER))
    found = compare.compare(a, b)
    assert (found.common, len(found.only_a), len(found.only_b)) == (2, 7, 2)
    assert found.fixed["seed"] == (0, 3)
    assert found.only_b[0]["te"] == 0.06
    assert max(row.max for row in found.differences if row.of == "displacement") < 1e-6
    flip(b, 0.5)
    with pytest.raises(CorruptTable, match="Rebuild"):
        compare.compare(a, b)


def bereft(store: Store) -> None:
    """Take the runs away, as of the tables that come with the package."""
    for key in list(store.keys()):
        store.shard_path(key).unlink()


@pytest.mark.parametrize(("resolution", "dtype"), [(5, "float32"), (None, "int16"), (9, "float64"), (None, None)])
def test_a_table_without_its_runs_is_made_of_its_own_spectra(
    filled: Store, resolution: int | None, dtype: tables.Precision | None
) -> None:
    """The same bytes as of the runs: it holds all that they said, and all else follows from its waves."""
    tables.build(filled, SOLVER, dtype="float64", text="# a plan\n")
    wanted = tables.rebuild(filled, SOLVER, resolution=resolution, dtype=dtype)
    first = tables.build(filled, SOLVER, dtype="float64", text="# a plan\n")
    assert not tables.is_alone(filled, first)
    bereft(filled)
    assert tables.is_alone(filled, first)
    made = tables.rebuild(filled, SOLVER, resolution=resolution, dtype=dtype)
    assert (made.digest, made.dtype, made.resolution) == (wanted.digest, wanted.dtype, wanted.resolution)
    assert (made.axes, made.keys, made.need, made.plan) == (wanted.axes, wanted.keys, wanted.need, wanted.plan)
    assert set(made.descriptors) == set(wanted.descriptors)
    assert all(finding.remark for finding in audit.verify(filled))


def test_more_than_a_table_holds_is_not_made_without_its_runs(filled: Store) -> None:
    keys = tables.build(filled, SOLVER, text="# a plan\n").keys
    cut = tables.rebuild(filled, SOLVER, resolution=6)
    bereft(filled)
    for asked, what in (({"resolution": 7}, "waves"), ({"more": keys[:1]}, "samples")):
        with pytest.raises(UnknownJob, match=f"without its runs, .* no more {what}") as refused:
            tables.rebuild(filled, SOLVER, **asked)
        assert f"`wizen table plan default --store {filled.root}` prints the plan" in refused.value.advice
    flip(tables.path_of(filled, cut), 0.5)
    with pytest.raises(CorruptTable, match=r"without its runs, and .* is damaged"):
        tables.rebuild(filled, SOLVER)
    assert tables.info(filled) == cut


def test_that_no_run_is_here_is_remarked_and_that_some_are_gone_is_wrong(tabled: Store) -> None:
    first, *others = tables.info(tabled).keys
    kept = {key: tabled.shard_path(key).read_bytes() for key in (first, *others)}
    bereft(tabled)
    (finding,) = audit.verify(tabled)
    assert (finding.part, finding.remark) == ("result", True)
    assert "None of the table's runs is here" in finding.message
    flip(tables.path_of(tabled, tables.info(tabled)), 0.5)
    assert [finding.remark for finding in audit.verify(tabled)] == [False, True]
    flip(tables.path_of(tabled, tables.info(tabled)), 0.5)
    tabled.shard_path(first).write_bytes(kept[first])
    findings = audit.verify(tabled)
    assert [(finding.name, finding.remark) for finding in findings] == [(key, False) for key in others]
    assert all("is gone" in finding.message for finding in findings)


def test_the_run_that_others_start_from_is_not_one_of_a_table_s_runs(tabled: Store) -> None:
    table = tables.info(tabled)
    for key in table.keys[1:]:
        tabled.shard_path(key).unlink()
    assert not tables.is_alone(tabled, table)
    pattern = {"key": table.keys[0], "stage": 0.1, "amplitude": 0.01}
    assert tables.is_alone(tabled, replace(table, template={**table.template, "pattern": pattern}))
