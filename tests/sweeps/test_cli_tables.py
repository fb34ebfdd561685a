"""The commands about tables, maps and queries."""

from __future__ import annotations

import dataclasses
import json
import shlex
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _command import document, wizen
from conftest import write

from solver.contract import Unstable
from solver.dehydration import SOLVER
from store import starter, tables
from store.store import Store


def test_table_commands(table: Path, tmp_path: Path) -> None:
    said = document(wizen("table", "info", "--store", table, "--json"))
    assert said["samples"] == 6
    assert set(said["axes"]) == {"te", "gamma"}
    assert "0.02 to 0.04" in wizen("table", "info", "--store", table).stdout
    assert document(wizen("table", "verify", "--store", table, "--json"))["sound"]
    copy = shutil.copytree(table, tmp_path / "copy")
    file = copy / Path(said["path"]).relative_to(table)
    file.write_bytes(file.read_bytes()[:-9] + b"damaged!!")
    result = wizen("table", "verify", "--store", copy)
    assert result.exit_code == 1
    assert "damaged" in result.stdout
    result = wizen("table", "rebuild", "--store", copy, "--json")
    assert document(result)["after"]["digest"] == said["digest"]
    assert wizen("table", "verify", "--store", copy).exit_code == 0


def test_a_list_of_tables_has_one_line_for_each_and_cuts_no_word(table: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = wizen("table", "list", "--store", table).stdout
    (row,) = [line.split() for line in listed.splitlines() if line.split()[:1] == ["default"]]
    assert row[1:4] == ["te", "0.02..0.04", "(3);"]
    monkeypatch.setenv("FORCE_COLOR", "1")  # as on a terminal
    monkeypatch.setenv("COLUMNS", "40")
    narrow = wizen("table", "list", "--store", table).stdout
    assert len(narrow.splitlines()) > len(listed.splitlines())
    words = [word for word in listed.split() if "─" not in word]
    assert "converged" in words
    assert all(word in narrow for word in words)


def test_runs_of_a_table_solved_again(table: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(table, tmp_path / "copy")
    result = wizen("table", "verify", "--store", copy, "--recompute", 2, "--json")
    assert result.exit_code == 0
    assert [spot["same"] for spot in document(result)["recomputed"]] == [True, True]
    for path in copy.glob("ledger.sqlite*"):
        path.unlink()  # as lost: the results say what they are of
    assert wizen("table", "verify", "--store", copy, "--recompute", 1).exit_code == 0
    # results that another machine computed a little otherwise, and stored well
    store = Store.open(copy)
    for job in store.ledger.jobs("done"):
        moved = store.get(job.key)
        store.shard_path(job.key).unlink()
        store.put(job.key, moved.assign(displacement=moved["displacement"] * 1.0001))
    store.ledger.rebuild(store.results())
    assert wizen("table", "rebuild", "--store", copy).exit_code == 0
    result = wizen("table", "verify", "--store", copy, "--recompute", 2)
    assert result.exit_code == 1
    assert "solved again" in result.stdout
    assert wizen("table", "verify", "--store", copy, "--recompute", 2, "--tolerance", 1e-3).exit_code == 0


def test_rebuild_and_compare(table: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(table, tmp_path / "copy")
    said = document(wizen("table", "rebuild", "--store", copy, "--resolution", 5, "--precision", "float64", "--json"))
    assert said["changed"]
    assert (said["after"]["resolution"], said["after"]["precision"]) == (5, "float64")
    assert said["source"] == "runs"
    # a shrinking sphere has few waves, so that hardly more than single precision's round-off is lost
    assert [row["rms"] < 1e-7 for row in said["after"]["truncation"]] == [True, True]
    found = document(wizen("table", "compare", table, copy, "--json"))
    assert (found["equal"], found["common"]) == (False, 6)
    shown = wizen("table", "compare", "default", "default", "--store", copy).stdout
    assert "the same content" in shown
    assert wizen("table", "compare", "default", "default", "--store", copy, "--name", "x").exit_code == 0
    assert wizen("table", "compare", "nothing.h5", copy).exit_code == 2


def test_what_is_not_current_is_deleted_when_it_is_asked_for(table: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(table, tmp_path / "copy")
    for precision in ("float64", "int16"):
        assert wizen("table", "rebuild", "--store", copy, "--precision", precision).exit_code == 0
    home = copy / "tables" / "default"
    current, sizes = Store(copy), {path.name: path.stat().st_size for path in home.glob("*.h5")}
    kept = tables.path_of(current, tables.info(current)).name
    said = document(wizen("table", "prune", "--store", copy, "--json"))
    assert sorted(said["deleted"]) == sorted(sizes.keys() - {kept})
    assert said["bytes"] == sum(sizes.values()) - sizes[kept]
    assert [path.name for path in home.glob("*.h5")] == [kept]
    assert wizen("table", "verify", "--store", copy).exit_code == 0
    assert "0 old generations" in wizen("table", "prune", "--store", copy).stdout
    assert wizen("table", "prune", "--store", copy, "--name", "nobody").exit_code == 1
    assert "takes nothing new" in wizen("table", "prune", "--store", starter.ROOT, "--name", "sphere").stderr


def test_more_waves_than_the_runs_hold_are_said_not_to_be_had(table: Path, tmp_path: Path) -> None:
    rebuild = ("table", "rebuild", "--store", shutil.copytree(table, tmp_path / "copy"), "--resolution")
    said = document(wizen(*rebuild, 1000, "--json"))
    held = said["after"]["resolution"]
    assert held < 1000
    assert said["note"] == f"the runs hold {held} waves: the 1000 asked for cannot be had of them"
    assert said["note"] in " ".join(wizen(*rebuild, 1000).stdout.split())
    assert "note" not in document(wizen(*rebuild, held, "--json"))


def test_a_table_whose_runs_are_not_here(table: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(table, tmp_path / "copy")
    for path in (copy / "shards").glob("??/*.h5"):
        path.unlink()
    said = document(wizen("table", "verify", "--store", copy, "--json"))
    assert (said["sound"], [finding["remark"] for finding in said["findings"]]) == (True, [True])
    result = wizen("table", "verify", "--store", copy)
    assert result.exit_code == 0
    assert "None of the table's runs is here" in " ".join(result.stdout.split())
    assert "is sound" in result.stdout
    result = wizen("table", "verify", "--store", copy, "--recompute", 2)
    assert result.exit_code == 1
    assert "nothing was solved again" in " ".join(result.stdout.split())
    shown = wizen("table", "rebuild", "--store", copy, "--precision", "float64")
    assert shown.exit_code == 0
    assert "its own spectra" in shown.stdout
    assert "damaged" not in shown.stdout
    said = document(wizen("table", "rebuild", "--store", copy, "--resolution", 5, "--json"))
    assert (said["source"], said["before"]["truncation"], len(said["after"]["truncation"])) == ("table", [], 2)
    refused = wizen("table", "rebuild", "--store", copy, "--resolution", 6)
    assert refused.exit_code == 1
    assert "without its runs" in refused.stderr


def test_query(table: Path, tmp_path: Path) -> None:
    out = tmp_path / "shape.npz"
    point = ["--set", "te=0.025", "--set", "gamma=15"]
    said = document(wizen("query", "--store", table, *point, "--stages", "0.15", "--out", out, "--json"))
    assert said["parameters"]["te"] == 0.025
    assert not said["stages"][0]["exact"]
    # every sample is a sphere that shrinks by s, so what is between them is one, too, up to the fresh shape's skin
    with np.load(out) as archive:
        found = dict(archive)
    radius = np.linalg.norm(found["position"], axis=-1)
    np.testing.assert_allclose(radius, 1.025 * 0.85, rtol=2e-3)
    points = np.concatenate([found["position"][0].reshape(-1, 3), found["poles"][0]]).astype(float)
    a, b, c = points[found["triangles"]].transpose(1, 0, 2)
    inside = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert found["volume"] == pytest.approx(inside, rel=1e-5)
    assert said["stages"][0]["volume"] == pytest.approx(inside, rel=1e-5)


@pytest.mark.parametrize(
    "said",
    [
        ("--preset", "raisin", "--set", "mirrors=xz"),
        ("--set", "te=0.01", "--set", "gamma=20", "--set", "mirrors=xz"),
        ("--set", "te=0.035", "--set", "gamma=20", "--set", "imperfection_kind=waves"),
    ],
)
def test_how_a_table_s_runs_were_done_may_be_said_as_it_is(said: tuple[str, ...]) -> None:
    asked = ("query", *said, "--stages", "0.2", "--resolution", 16, "--json")
    found = document(wizen(*asked))
    name, _, value = said[-1].partition("=")
    assert found["parameters"][name] == value
    other = wizen("query", "--name", found["table"], *said[:-1], f"{name}=other", "--stages", "0.2")
    assert other.exit_code == 2
    assert f"{name} is {value} in the whole table" in " ".join(other.stderr.split())


def test_the_parameters_of_an_answer_ask_for_it_again() -> None:
    """Entries of a field without a name of their own are told in their field."""
    asked = ("query", "--stages", "0.2", "--resolution", 16, "--json")
    found = document(wizen(*asked, "--preset", "plum1"))
    assert found["parameters"]["radii"][0] == 1.0
    said = [
        f"--set={name}={json.dumps(value)}" for name, value in found["parameters"].items() if value not in ("", None)
    ]
    again = document(wizen(*asked, "--name", found["table"], *said))
    assert again["parameters"] == found["parameters"]
    assert again["stages"] == found["stages"]


def test_a_coarse_lattice_is_said_to_leave_wrinkles_out() -> None:
    thin = ("query", "--preset", "sphere", "--set", "te=0.01", "--stages", "0.1")
    said = "wrinkles' height that this lattice holds"
    assert said in " ".join(wizen(*thin, "--resolution", 32).stdout.split())
    assert said not in " ".join(wizen(*thin).stdout.split())


def test_what_falls_apart_when_relaxed_says_what_to_type(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise Unstable("elements turned inside out.", advice="Run it from the start.")

    monkeypatch.setattr("sweeps.relaxing.relaxed", broken)
    found = wizen("query", "--preset", "raisin", "--stages", "0.1", "--resolution", 16, "--relax")
    assert found.exit_code != 0
    words = " ".join(found.stderr.split())
    assert "Run it from the start. Without the pattern of the table's runs" in words
    assert "`wizen table plan raisin` has: wizen solve dehydration" in words
    assert "exact=run" not in words
    command = shlex.split(words[words.index("wizen solve") :])
    said = dict(word.split("=") for flag, word in pairwise(command) if flag == "--set")
    raisin = SOLVER.parse({}, "raisin")
    assert said.pop("mirrors") == "xz"  # as the table's runs are done
    assert SOLVER.parse({name: float(value) for name, value in said.items()}).axis("r4") == raisin.axis("r4")


def test_whether_what_was_relaxed_is_in_balance_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def tired(*asked: Any, **_: object) -> tuple[Any, dict[str, float]]:
        told = {"residual": 0.02, "moved": 0.3, "iterations": 4000.0, "seconds": 9.0}
        return dataclasses.replace(asked[2], converged=False), told

    monkeypatch.setattr("sweeps.relaxing.relaxed", tired)
    found = wizen("query", "--preset", "raisin", "--stages", "0.1", "--resolution", 16, "--relax")
    words = " ".join(found.stdout.split())
    assert "in balance no" in words
    assert "residual 1 0.02" in words
    assert "in balance" not in wizen("query", "--preset", "raisin", "--stages", "0.1", "--resolution", 16).stdout


def test_query_by_a_method_within_an_error(table: Path) -> None:
    query = ("query", "--store", table, "--set", "te=0.03", "--set", "gamma=20", "--stages", "0.15", "--json")
    said = document(wizen(*query, "--method", "idw"))
    assert said["method"] == "idw"
    assert "there is no look-up method 'kriging'" in wizen(*query, "--method", "kriging").stderr
    assert "limits no error" in wizen(*query, "--max-error", "rgh:little").stderr
    assert "limits a measure twice" in wizen(*query, "--max-error", "0.01,rgh:9").stderr
    refused = wizen(*query, "--method", "idw", "--max-error", "0.5")
    assert refused.exit_code != 0
    assert "does not say how far" in refused.stderr


def test_a_table_of_a_plan_s_file_holds_what_the_file_says_now(site: None, tmp_path: Path) -> None:
    from sweeps.commands.tables import _runs_of
    from sweeps.planning.plan import Plan

    store, file = tmp_path / "store", tmp_path / "two.toml"
    assert wizen("sweep", write(file, te="[0.02, 0.03]", gamma="[10]"), "--store", store).exit_code == 0
    build = ("table", "build", "--store", store, "--plan")
    assert document(wizen(*build, file, "--json"))["samples"] == 2
    write(file, te="[0.03]", gamma="[10]")
    assert document(wizen(*build, file, "--json"))["samples"] == 1
    plan, _ = Plan.read(file)
    other = dataclasses.replace(plan, solver=dataclasses.replace(plan.solver, version="another"))
    assert {job.key for job in plan.jobs()} == set(_runs_of(Store.open(store), other))  # by version as it is there
    refused = wizen(*build, write(file, te="[0.04]", gamma="[10]"))
    assert refused.exit_code != 0
    assert "no run of plan 'two' as its file is now is stored" in " ".join(refused.stderr.split())
    assert document(wizen(*build, "two", "--json"))["samples"] == 2


def test_query_swollen(site: None, tmp_path: Path) -> None:
    store, out = tmp_path / "store", tmp_path / "shape.npz"
    plan = write(tmp_path / "swollen.toml", gamma="[10]", stages="[-0.2, -0.1]")
    assert wizen("sweep", plan, "--store", store).exit_code == 0
    assert wizen("table", "build", "--store", store, "--solver", "shrinking").exit_code == 0
    query = ("query", "--store", store, "--set", "te=0.03")
    said = document(wizen(*query, "--stages", "-0.15,-0.05,0", "--out", out, "--json"))
    assert [stage["stage"] for stage in said["stages"]] == [-0.15, -0.05, 0.0]
    radius = np.linalg.norm(np.load(out)["position"], axis=-1)
    for i, scale in enumerate((1.15, 1.05, 1.0)):
        np.testing.assert_allclose(radius[i], 1.03 * scale, rtol=1e-5)
    assert "stage -0.2 to 0" in wizen(*query, "--stages", "0.1").stderr
    assert "stages -0.2 to 0." in wizen(*query).stderr


@pytest.mark.parametrize("suffix", [".obj", ".glb", ".png", ".json"])
def test_query_formats(table: Path, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"shape{suffix}"
    result = wizen("query", "--store", table, "--set", "te=0.02", "--set", "gamma=10", "--stages", "0.1", "--out", out)
    assert result.exit_code == 0, result.output
    assert out.stat().st_size > 100
    assert "a stored run, as it is" in result.stdout


def test_maps(table: Path, tmp_path: Path) -> None:
    out = tmp_path / "map.png"
    said = document(wizen("map", "--store", table, "--out", out, "--x", "gamma", "--pixels", 48, "--json"))
    assert said["shapes"] == 6
    assert out.read_bytes().startswith(b"\x89PNG")
    result = wizen("map", "--store", table, "--out", out, "--stages", "0.1,0.2", "--set", "te=0.03", "--pixels", 48)
    assert "4 shapes" in result.stdout
    assert wizen("map", "--preset", "raisin", "--out", out, "--stage", "nan", "--pixels", 48).exit_code == 2
    other = wizen("map", "--name", "plum1", "--preset", "raisin", "--out", out, "--pixels", 48)
    assert other.exit_code == 2
    assert "0.88 in the whole table" in other.stderr
    held = wizen("map", "--name", "raisin", "--preset", "raisin", "--out", tmp_path / "map.PNG", "--pixels", 32)
    assert held.exit_code == 0


def test_presets_and_what_the_package_covers(tmp_path: Path) -> None:
    listed = document(wizen("table", "list", "--picture", tmp_path / "fruits.png", "--json"))["tables"]
    assert "sphere" in {preset for one in listed for preset in one["presets"]}
    assert (tmp_path / "fruits.png").stat().st_size > 10_000
    said = document(wizen("query", "--preset", "sphere", "--set", "te=0.035", "--stages", "0.2", "--json"))
    assert (said["parameters"]["te"], said["parameters"]["gamma"]) == (0.035, 10.0)
    wrong = wizen("query", "--preset", "raisn", "--stages", "0.2")
    assert wrong.exit_code == 2
    assert "did you mean 'raisin'?" in wrong.stderr
    far = wizen("query", "--preset", "raisin", "--set", "te=0.1", "--stages", "0.2")
    assert far.exit_code != 0
    assert "no table holds this; the preset's own is 'raisin'" in far.stderr
    assert "Set te=0.0125." in far.stderr
    assert "wizen solve dehydration --preset raisin --set te=0.1 --stages 0.2" in far.stderr
    off = wizen("query", "--preset", "raisin", "--stages", "10")
    assert off.exit_code == 2
    assert "stage 10 lies outside s = -0.3 to 0.6" in off.stderr
    assert "wizen solve" not in off.stderr
    unknown = wizen("table", "plan", "nowhere")
    assert "there is no table 'nowhere'" in unknown.stderr
