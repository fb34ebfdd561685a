from __future__ import annotations

import errno
import io
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from conftest import Solves, write
from typer.testing import CliRunner, Result

from service.cli import app
from solver import registry
from store import seal
from store.store import Store
from sweeps.options import assignments

Write = Callable[..., Path]

ROOT = Path(__file__).parents[2]


def wizen(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def document(result: Result) -> Any:
    """The one JSON document on stdout, which must hold nothing else."""
    assert result.stdout.strip(), result.output
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def table(site: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a table of shrinking spheres over te and gamma, which no test changes."""
    folder = tmp_path_factory.mktemp("table")
    store = folder / "store"
    assert wizen("sweep", write(folder / "six.toml"), "--store", store).exit_code == 0
    assert wizen("table", "build", "--store", store, "--solver", "shrinking").exit_code == 0
    return store


def test_help_answers_at_once_and_imports_nothing_heavy() -> None:
    code = (
        "import sys, time; start = time.perf_counter()\n"
        "from service.cli import app\n"
        "try: app(['--help'])\n"
        "except SystemExit as end: assert not end.code\n"
        "heavy = {'numba', 'matplotlib', 'xarray', 'scipy', 'numpy', 'h5py', 'fastapi'} & set(sys.modules)\n"
        "print(heavy, time.perf_counter() - start, file=sys.stderr)\n"
        "sys.exit(bool(heavy))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    assert "Commands" in done.stdout


@pytest.mark.parametrize(
    "path",
    [
        "presets",
        "solve",
        "sweep",
        "status",
        "table build",
        "table rebuild",
        "table compare",
        "refine",
        "map",
        "query",
        "serve",
    ],
)
def test_every_help_teaches_by_example(path: str) -> None:
    result = wizen(*path.split(), "--help")
    assert result.exit_code == 0
    assert f"wizen {path}" in " ".join(result.stdout.split())


def test_version() -> None:
    result = wizen("--version")
    assert result.exit_code == 0
    assert result.stdout.startswith("wizen 0.")


def test_presets() -> None:
    assert document(wizen("presets", "--json"))["dehydration"]["presets"]["plum1"]["stone"] == [0.6, 0.5]
    listed = wizen("presets")
    assert listed.exit_code == 0
    assert all(preset in listed.stdout for name in registry.names() for preset in registry.get(name).presets)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.4", 0.4),
        ("[0.4, 0.3]", [0.4, 0.3]),
        ("0.4,0.3", [0.4, 0.3]),
        (" 1, 2 ,3", [1, 2, 3]),
        ("-0.1,2e-3", [-0.1, 2e-3]),
        ("null", None),
        ("waves", "waves"),
        ("waves, mode", "waves, mode"),
        ("0.4,", [0.4]),
        (",0.4", ",0.4"),
    ],
)
def test_values_of_set(text: str, value: Any) -> None:
    assert assignments([f"stone={text}"]) == {"stone": value}


def test_solve_writes_a_shard(shrinking: Solves, tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    grammar = ["--preset", "sphere", "--set", "te=0.03", "--set", "gamma=20", "--set", "radii=[1,1,1,1,1,1,1,1]"]
    result = wizen("solve", "shrinking", *grammar, "--stages", "0.05,0.1", "--seed", 7, "--out", out, "--json")
    said = document(result)
    assert result.exit_code == 0
    assert said["path"] == str(out)
    assert said["stages"] == [0.05, 0.1]
    assert said["params"]["exocarp_thickness"] == 0.03
    assert said["params"]["seed"] == 7
    assert said["descriptors"]["mean_radius"]["units"] == "1"
    assert said["descriptors"]["mean_radius"]["values"] == pytest.approx([0.95 * 1.03, 0.9 * 1.03])
    assert said["seconds"] >= 0
    assert seal.is_whole(out)
    with xr.open_dataset(out, engine="h5netcdf") as opened:
        assert opened.attrs["key"] == said["key"]
        assert opened.attrs["digest"] == said["digest"]
    assert [path.name for path in tmp_path.glob("*run*")] == ["run.h5"]


@pytest.mark.parametrize("suffix", [".npz", ".png", ".json", ".obj", ".glb"])
def test_solve_writes_other_formats(shrinking: Solves, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"run{suffix}"
    result = wizen("solve", "shrinking", "--quality", "preview", "--stages", "0.1", "--out", out)
    assert result.exit_code == 0, result.output
    start = {".npz": b"PK", ".png": b"\x89PNG", ".json": b"{", ".obj": b"#", ".glb": b"glTF"}[suffix]
    assert out.read_bytes().startswith(start)
    assert "mean_radius" in result.stdout


def test_solve_without_a_file(shrinking: Solves) -> None:
    result = wizen("solve", "shrinking", "--stages", "0.1")
    assert result.exit_code == 0
    assert "seconds [s]" in result.stdout


def test_sweep_status_and_resume(shrinking: Solves, tmp_path: Path, write_plan: Write) -> None:
    store = tmp_path / "store"
    first, second = (wizen("sweep", write_plan(), "--store", store, "--json") for _ in range(2))
    assert (document(first)["solved"], document(second)["reused"]) == (6, 6)
    assert "[6/6] te=0.04 gamma=30: solved in" in first.stderr
    said = document(wizen("status", "--store", store, "--json"))
    assert said["jobs"]["done"] == said["results"] == 6
    assert "6 results" in wizen("status", "--store", store).stdout
    assert len(shrinking) == 6


def test_a_sweep_that_fails_says_why(shrinking: Solves, tmp_path: Path, write_plan: Write) -> None:
    plan, store = write_plan("[0.03]", "[10]", 'trouble = "diverges"'), tmp_path / "store"
    result = wizen("sweep", plan, "--store", store)
    assert result.exit_code == 1
    assert "given up: it diverged." in result.stderr
    assert "Take care." in result.stdout
    assert document(wizen("status", "--store", store, "--json"))["failed"][0]["error"]["code"] == "not-converged"
    assert wizen("sweep", plan, "--store", store, "--retry-failed").exit_code == 1
    assert len(shrinking) == 4


def test_a_solve_that_fails_has_exit_code_1(shrinking: Solves) -> None:
    result = wizen("solve", "shrinking", "--set", "trouble=diverges", "--json")
    assert result.exit_code == 1
    error = document(result)["error"]
    assert (error["code"], error["advice"], error["last_stage"]) == ("not-converged", "Take care.", 0.1)


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


def test_runs_of_a_table_solved_again(table: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(table, tmp_path / "copy")
    result = wizen("table", "verify", "--store", copy, "--recompute", 2, "--json")
    assert result.exit_code == 0
    assert [spot["same"] for spot in document(result)["recomputed"]] == [True, True]
    # results that another machine computed a little otherwise, and stored well
    store = Store.open(copy)
    for job in store.ledger.jobs("done"):
        moved = store.get(job.key)
        store.shard_path(job.key).unlink()
        digest = store.put(job.key, moved.assign(displacement=moved["displacement"] * 1.0001))
        store.ledger.done(job.key, digest, 1.0)
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
    # a shrinking sphere has few waves, so that hardly more than single precision's round-off is lost
    assert [row["rms"] < 1e-7 for row in said["after"]["truncation"]] == [True, True]
    found = document(wizen("table", "compare", table, copy, "--json"))
    assert (found["equal"], found["common"]) == (False, 6)
    shown = wizen("table", "compare", "default", "default", "--store", copy).stdout
    assert "the same content" in shown
    assert wizen("table", "compare", "default", "default", "--store", copy, "--name", "x").exit_code == 0
    assert wizen("table", "compare", "nothing.h5", copy).exit_code == 2


def test_query(table: Path, tmp_path: Path) -> None:
    out = tmp_path / "shape.npz"
    point = ["--set", "te=0.025", "--set", "gamma=15"]
    said = document(wizen("query", "--store", table, *point, "--stages", "0.15", "--out", out, "--json"))
    assert said["parameters"]["te"] == 0.025
    assert not said["stages"][0]["exact"]
    # every sample is a sphere that shrinks by s, so what is between them is one, too, up to the fresh shape's skin
    radius = np.linalg.norm(np.load(out)["position"], axis=-1)
    np.testing.assert_allclose(radius, 1.025 * 0.85, rtol=2e-3)


def test_query_by_a_method_within_an_error(table: Path) -> None:
    query = ("query", "--store", table, "--set", "te=0.03", "--set", "gamma=20", "--stages", "0.15", "--json")
    said = document(wizen(*query, "--method", "idw"))
    assert said["method"] == "idw"
    assert "there is no look-up method 'kriging'" in wizen(*query, "--method", "kriging").stderr
    assert "limits no error" in wizen(*query, "--max-error", "rgh:little").stderr
    refused = wizen(*query, "--method", "idw", "--max-error", "0.5")
    assert refused.exit_code != 0
    assert "does not say how far" in refused.stderr


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
    assert "exact" in result.stdout


def test_maps(table: Path, tmp_path: Path) -> None:
    out = tmp_path / "map.png"
    said = document(wizen("map", "--store", table, "--out", out, "--x", "gamma", "--pixels", 48, "--json"))
    assert said["shapes"] == 6
    assert out.read_bytes().startswith(b"\x89PNG")
    result = wizen("map", "--store", table, "--out", out, "--stages", "0.1,0.2", "--set", "te=0.03", "--pixels", 48)
    assert "4 shapes" in result.stdout


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("solve dehydratoin", 2, "did you mean 'dehydration'"),
        ("solve dehydration --preset spere", 2, "did you mean 'sphere'"),
        ("solve dehydration --set gama=3", 2, "did you mean 'gamma'"),
        ("solve dehydration --set te", 2, "NAME=VALUE"),
        ("solve dehydration --set te=thick", 2, "exocarp_thickness"),
        ("solve dehydration --set te=0.02 --set te=0.03", 2, "twice"),
        ("solve dehydration --set rs1=1.1", 2, "stone"),
        ("solve dehydration --stages 0.1,x", 2, "not a number"),
        ("solve dehydration --stages 0.9", 2, "lies outside"),
        ("solve dehydration --quality good", 2, "quality"),
        ("solve dehydration --out run.docx", 2, ".docx"),
        ("solve dehydration --out run.obj --stages 0.1,0.2", 2, "one stage"),
        ("solve dehydration --out no/such/run.h5", 2, "no directory"),
        ("solve dehydration --nonsense", 2, "--nonsense"),
        ("solve", 2, "solver"),
        ("sweeep", 2, "sweeep"),
        ("sweep no-plan.toml --store x", 2, "no plan"),
        ("sweep {plan} --store {tmp}/s --workers 0", 2, "0 workers"),
        ("sweep {plan} --store {tmp}/s --scheduler tcp://x:1 --dask", 2, "own workers"),
        ("status --store {tmp}/nowhere", 1, "there is no store"),
        ("table build --store {tmp}/nowhere", 1, "there is no store"),
        ("table info --store {table} --name other", 1, "other"),
        ("table build --store {table}", 1, "dehydration"),
        ("query --store {table} --set te=0.03 --set gamma=10", 2, "--stages"),
        ("query --store {table} --set te=0.03 --set gamma=99 --stages 0.1", 2, "lies outside"),
        ("query --store {table} --set te=0.03 --stages 0.1", 2, "gamma must be given"),
        ("map --store {table} --out map.jpg", 2, ".png"),
        ("map --store {table} --out {tmp}/map.png --x gama", 2, "gamma"),
        ("map --store {table} --out {tmp}/map.png --stage 0.1 --stages 0.1", 2, "exclude"),
        ("serve --port 99999", 2, "65535"),
    ],
)
def test_errors(table: Path, tmp_path: Path, write_plan: Write, words: str, code: int, said: str) -> None:
    line = words.format(tmp=tmp_path, table=table, plan=write_plan()).split()
    result = wizen(*line)
    assert result.exit_code == code, result.output
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.splitlines()) == 1
    assert said in result.stderr
    assert result.stdout == ""
    if line[0] != "serve":
        again = wizen(*line, "--json")
        assert again.exit_code == code
        error = document(again)["error"]
        assert {"code", "message", "advice"} <= set(error)
        assert error["message"]


def test_a_port_in_use() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        result = wizen("serve", "--port", taken.getsockname()[1])
    assert result.exit_code == 1
    assert "in use" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_full_disk(shrinking: Solves, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    result = wizen("solve", "shrinking", "--stages", "0.1", "--out", tmp_path / "run.h5", "--json")
    assert result.exit_code == 1
    assert document(result)["error"]["code"] == "storage-full"
    assert not list(tmp_path.glob("*run*"))


def test_no_traceback_unless_asked(monkeypatch: pytest.MonkeyPatch, shrinking: Solves) -> None:
    result = wizen("solve", "shrinking", "--set", "trouble=crashes")
    assert result.exit_code == 1
    assert "Traceback" not in result.output
    assert "ZeroDivisionError" in result.stderr
    monkeypatch.setenv("WIZEN_DEBUG", "1")
    assert isinstance(wizen("solve", "shrinking", "--set", "trouble=crashes").exception, ZeroDivisionError)


def test_ctrl_c_stops_and_the_same_command_goes_on(shrinking: Solves, tmp_path: Path, write_plan: Write) -> None:
    """A real process, a real SIGINT, two worker processes; stdout stays one JSON document."""
    plan, root = write_plan(more="pause = 0.4"), tmp_path / "store"
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"}
    command = [sys.executable, "-m", "service.cli", "sweep", str(plan), "--store", str(root), "--json"]
    running = subprocess.Popen(
        [*command, "--workers", "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        cwd=ROOT,
        start_new_session=True,
    )
    deadline = time.monotonic() + 30
    store = Store.open(root, create=True)
    while store.ledger.counts()["done"] < 1 and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(running.pid, signal.SIGINT)
    out, err = running.communicate(timeout=30)
    assert running.returncode == 130, err
    said = json.loads(out)
    assert said["stopped"]
    assert "Traceback" not in err
    assert 1 <= said["solved"] < 6
    assert store.ledger.counts()["running"] == 0
    assert store.ledger.counts()["wanted"] == 6 - said["solved"]
    result = wizen("sweep", plan, "--store", root, "--json")
    assert document(result)["reused"] == said["solved"]


def test_a_reader_that_leaves_early() -> None:
    """`wizen presets | head -0` ends quietly."""
    reader, writer = os.pipe()
    os.close(reader)
    with io.FileIO(writer, "w") as closed:
        done = subprocess.run(
            [sys.executable, "-m", "service.cli", "presets", "--json"],
            stdout=closed,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            check=False,
        )
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr
