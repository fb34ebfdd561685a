"""Results as a table: rows, conditions, order, and the ways out."""

from __future__ import annotations

import csv
import io
import shlex
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from _command import document, wizen
from conftest import Solves

from solver import registry
from solver.contract import Need, finish
from solver.dehydration import SOLVER as DEHYDRATION
from store.errors import CorruptShard
from store.store import Store
from sweeps import results
from sweeps.errors import InvalidOption
from sweeps.planning.plan import job

Write = Callable[..., Path]

#: What every solver says of a stage.
CONVERGED = {name: ("stage", [1]) for name in ("residual", "drift", "converged", "iterations", "seconds")}


def test_rows_say_what_was_solved_and_what_came_out(table: Path) -> None:
    rows = results.find(Store.open(table))
    assert len(rows) == 6 * 2
    for row in rows:
        # a fruit that shrinks freely has the radius of its fresh skin, shrunk
        assert row.numbers["mean_radius"] == pytest.approx((1 - row.stage) * (1 + row.params["te"]))
        assert row.solver == "shrinking"
        assert row.params["quality"] == "preview"
    assert {row.params["te"] for row in rows} == {0.02, 0.03, 0.04}
    assert {row.params["gamma"] for row in rows} == {10.0, 30.0}


def test_conditions_and_order(table: Path) -> None:
    store = Store.open(table)
    found = results.find(store, where=["te<0.035, gamma=10"], sort="-volume")
    assert [(row.params["te"], row.stage) for row in found] == [(0.03, 0.1), (0.02, 0.1), (0.03, 0.2), (0.02, 0.2)]
    assert len(results.find(store, where=["te<=0.03", "stage>0.15"])) == 4
    assert results.find(store, where=["te!=0.02"], last=True) == results.find(store, where=["te>0.02", "stage=0.2"])
    assert results.find(store, solver="growth") == results.find(store, where=["solver=growth"]) == []
    assert results.find(store, where=["converged=true"]) == results.find(store)
    for where in ("te", "te<", "<3", "te~3"):
        with pytest.raises(InvalidOption, match="no condition"):
            results.find(store, where=[where])
    for asked in ({"where": ["tea<3"]}, {"sort": "-tea"}):
        with pytest.raises(InvalidOption, match="no result has 'tea'"):
            results.find(store, **asked)
    # no row would ever meet them
    for where in ("te<0.03 and gamma=10", "te<0.03 gamma", "te=thin", "converged=yes"):
        with pytest.raises(InvalidOption, match="commas"):
            results.find(store, where=[where])


def test_the_command_writes_what_others_read(table: Path, tmp_path: Path) -> None:
    words = ("results", "--store", table, "--where", "te<0.03", "--sort", "gamma", "--last")
    said = document(wizen(*words, "--json"))
    assert (said["count"], [row["gamma"] for row in said["results"]]) == (2, [10.0, 30.0])
    lines = list(csv.DictReader(io.StringIO(wizen(*words, "--csv", "--columns", "te,volume").stdout)))
    assert [float(line["volume"]) for line in lines] == [row["volume"] for row in said["results"]]
    assert set(lines[0]) == {"te", "volume"}
    assert wizen(*words, "--nc", tmp_path / "rows.nc").exit_code == 0
    with xr.open_dataset(tmp_path / "rows.nc", engine="h5netcdf") as opened:
        assert opened["mean_radius"].attrs["long_name"]
        assert opened["te"].values.tolist() == [0.02, 0.02]
        assert opened["te"].attrs["normalised_by"] == "r1"
        assert opened["stage"].attrs["long_name"] == registry.get("shrinking").stages.long_name
        assert all("long_name" in variable.attrs for variable in opened.variables.values())
        assert opened["seed"].dtype == opened["iterations"].dtype == np.int64
    people = wizen(*words).stdout
    assert said["results"][0]["key"][:12] in people
    assert "2 rows of 2 results" in people
    assert wizen("results", "--store", table, "--columns", "tea").exit_code == 2
    # what is asked about is shown, however many columns come before it
    asked = wizen("results", "--store", table, "--where", "converged=1,seconds<99", "--sort=-iterations").stdout.split()
    assert asked[:7] == ["key", "te", "gamma", "stage", "converged", "seconds", "iterations"]
    assert wizen("results", "--store", table, "--solver", "nobody").exit_code == 2
    lost = wizen("results", "--store", table, "--nc", tmp_path / "none" / "rows.nc")
    assert (lost.exit_code, (tmp_path / "none").exists()) == (2, False)


def test_rows_of_several_solvers_are_one_dataset(table: Path) -> None:
    row = results.find(Store.open(table))[0]
    other = row._replace(solver="growth", params={"thickness": 0.1}, numbers={"mesh_area": 3.0})
    both = results.dataset([row, other])
    assert np.isnan(both["te"].values[1])
    assert both["mesh_area"].values[1] == 3.0
    assert both["solver"].values.tolist() == ["shrinking", "growth"]


def test_parameters_that_are_no_axis_tell_runs_apart(tmp_path: Path) -> None:
    """How a fruit is lit, say: numbers as they are, of a map something that no other has."""
    store = Store.open(tmp_path / "lit", create=True)
    maps = [{"values": [[0.0, share] * 10] * 10} for share in (0.1, 0.2)]
    for more in ({"light": [0, 0, 0.5]}, {"light": [0, 0, 2]}, {"light_map": maps[0]}, {"light_map": maps[1]}):
        params = DEHYDRATION.parse({"te": 0.1, **more}, "sphere")
        need = DEHYDRATION.settle(Need(stages=(0.1,), fields=("volume",), quality="preview"))
        told = xr.Dataset({"volume": ("stage", [4.0]), **CONVERGED}, {"stage": [0.1]})
        store.put(job(DEHYDRATION, params, need).key, finish(told, DEHYDRATION, params, need))
    rows = results.find(store)
    assert {row.params.get("light") for row in rows} == {"0 0 0.5", "0 0 2", None}
    assert len({row.params.get("light_map") for row in rows}) == 3
    assert [row.params["light"] for row in results.find(store, where=["light=0 0 2"])] == ["0 0 2"]
    assert "0 0 0.5" in wizen("results", "--store", store.root).stdout
    assert set(results.dataset(rows)["light"].values) == {"0 0 0.5", "0 0 2", ""}


def test_a_damaged_result_is_named_and_the_others_are_listed(table: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(table, tmp_path / "copy"))
    store = Store.open(copy)
    victim = next(iter(store.keys()))
    path = store.shard_path(victim)
    broken = bytearray(path.read_bytes())
    broken[len(broken) // 2] ^= 1
    path.write_bytes(broken)
    with pytest.raises(CorruptShard, match=victim):
        results.find(store)
    damaged: dict[str, CorruptShard] = {}
    assert len(results.find(store, damaged=damaged)) == 5 * 2
    assert list(damaged) == [victim]
    for option in ("--json", "--csv", "--columns=te"):
        said = wizen("results", "--store", copy, option)
        assert said.exit_code == 1
        assert said.stderr.count(victim) == 1
        assert "Traceback" not in said.stderr
    assert document(wizen("results", "--store", copy, "--json"))["damaged"] == [victim]
    assert wizen("results", "--store", table, "--json").exit_code == 0


def test_one_result_by_the_beginning_of_its_key(table: Path) -> None:
    key = next(iter(Store.open(table).keys()))
    said = document(wizen("show", key[:8], "--store", table, "--json"))
    assert said["key"] == key
    assert said["params"]["exocarp_thickness"] in (0.02, 0.03, 0.04)
    assert said["fields"]["displacement"]["dims"] == ["stage", "colatitude", "azimuth", "component"]
    assert "mean_radius" in wizen("show", key, "--store", table).stdout
    # each stage's seconds are those from the beginning
    assert said["seconds"] == max(said["descriptors"]["seconds"]["values"])
    for short in (key[:3], "zzzz", ""):
        assert wizen("show", short, "--store", table).exit_code == 2


def test_a_sweep_ends_in_a_command_that_works(shrinking: Solves, tmp_path: Path, write_plan: Write) -> None:
    shapes, numbers = write_plan(), write_plan(name="plain")
    numbers.write_text(numbers.read_text() + 'fields = ["volume"]\n')
    for plan in (shapes, numbers):
        root = tmp_path / plan.stem
        assert f"next: wizen table build --store {root}" in wizen("sweep", plan, "--store", root).stdout
        built = wizen("table", "build", "--store", root)
        assert built.exit_code == 0, built.output
    # where a part failed there is no table to promise, but results to read
    partly = write_plan(name="partly")
    partly.write_text(
        'solver = "shrinking"\n[sampling]\nkind = "list"\n[[samples]]\nte = 0.02\n[[samples]]\nte = 0.03\n'
        'trouble = "diverges"\n[need]\nstages = [0.1]\nquality = "preview"\n'
    )
    said = wizen("sweep", partly, "--store", tmp_path / "partly").stdout
    assert f"next: wizen results --store {tmp_path / 'partly'} --solver shrinking" in said
    assert "table build" not in said
    # the stage that was settled is not lost
    (kept,) = (tmp_path / "partly" / "quarantine").iterdir()
    for told in (said, wizen("status", "--store", tmp_path / "partly").stdout):
        assert f"Stages settled before: {kept}" in told
    assert "(te=0.03)" in said


def test_a_sweep_beside_others_ends_in_a_command_for_its_own(
    shrinking: Solves, tmp_path: Path, write_plan: Write
) -> None:
    """The plan as its file says it now, whatever was swept under its name before."""
    root, plan = tmp_path / "store", write_plan("[0.02, 0.03, 0.04]")
    assert wizen("sweep", plan, "--store", root).exit_code == 0
    write_plan("[0.02, 0.03]")
    (said,) = (line for line in wizen("sweep", plan, "--store", root).stdout.splitlines() if "next: wizen" in line)
    assert said.endswith(f"--plan {plan}")
    assert wizen(*shlex.split(said.removeprefix("next: wizen "))).exit_code == 0
    assert document(wizen("table", "info", "--store", root, "--json"))["samples"] == 4


def test_a_table_of_one_version(table: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(table, tmp_path / "copy"))
    with closing(sqlite3.connect(root / "ledger.sqlite")) as ledger, ledger:
        ledger.execute("UPDATE jobs SET version = 'before' WHERE key IN (SELECT key FROM jobs LIMIT 2)")
    mixed = wizen("table", "build", "--store", root)
    assert mixed.exit_code == 1
    assert "--version" in mixed.output
    version = registry.get("shrinking").version
    built = wizen("table", "build", "--store", root, "--version", version, "--json")
    assert document(built)["samples"] == 4


def test_words_may_consist_of_digits() -> None:
    """A version, or a key: equal as they are written, but in the order of numbers."""
    seventeen = {"version": "17", "key": "1" * 64}

    def meets(text: str) -> bool:
        return results._meets(seventeen, *results._condition(text))

    for true in ("version=17", "version!=9", "version>9", "version<=17", f"key={'1' * 64}", f"key!={'1' * 63}2"):
        assert meets(true), true
    for false in ("version=9", "version!=17", "version<9", "version=17.0", f"key={'1' * 63}2"):
        assert not meets(false), false
