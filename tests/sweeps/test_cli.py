"""The command line: its help, runs, sweeps, errors and manners."""

from __future__ import annotations

import errno
import io
import json
import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import xarray as xr
from _command import ROOT, Write, document, wizen
from conftest import Solves

from solver import registry
from solver.contract import Need
from store import seal
from store.store import Store
from sweeps.commands.terminal.options import assignments


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


@pytest.mark.parametrize("name", registry.names())
def test_presets_of_one_solver_say_what_every_parameter_means(name: str) -> None:
    solver = registry.get(name)
    listed = wizen("presets", name)
    assert listed.exit_code == 0
    lines = listed.stdout.splitlines()
    for field, info in solver.params.model_fields.items():
        (line,) = [one for one in lines if one.split()[:1] == [field]]
        assert info.description
        assert info.description.split("\n")[0] in line
    preset = next(iter(solver.presets))
    shown = wizen("presets", name, preset)
    assert shown.exit_code == 0
    said = document(wizen("presets", name, preset, "--json"))
    assert said["parameters"] == solver.parse({}, preset).model_dump(mode="json")
    marked = {line.split()[0].split(".")[0] for line in shown.stdout.splitlines() if line.rstrip().endswith("*")}
    assert marked == set(solver.presets[preset])


def test_presets_that_are_not_there_are_told_from_those_that_are() -> None:
    for words, hint in ((("decoy",), "decay"), (("decay", "orang"), "orange")):
        wrong = wizen("presets", *words)
        assert wrong.exit_code == 2
        assert f"did you mean '{hint}'" in wrong.output


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


@pytest.mark.parametrize("suffix", [".npz", ".png", ".json", ".obj", ".glb", ".GLB", ".H5"])
def test_solve_writes_other_formats(shrinking: Solves, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"run{suffix}"
    result = wizen("solve", "shrinking", "--quality", "preview", "--stages", "0.1", "--out", out)
    assert result.exit_code == 0, result.output
    starts = {".npz": b"PK", ".png": b"\x89PNG", ".json": b"{", ".obj": b"#", ".glb": b"glTF", ".h5": b"\x89HDF"}
    assert out.read_bytes().startswith(starts[suffix.lower()])
    assert "mean_radius" in result.stdout


def test_solve_says_all_of_a_need(shrinking: Solves, tmp_path: Path) -> None:
    """All of it reaches the solver; that it keeps to it is the contract's test."""
    out = tmp_path / "run.h5"
    words = ["--fields", "position", "--resolution", 8, "--region", "0,90,0,180", "--dtype", "float64"]
    result = wizen("solve", "shrinking", "--stages", "0.1", *words, "--out", out, "--json")
    assert result.exit_code == 0, result.output
    with xr.open_dataset(out, engine="h5netcdf") as opened:
        assert opened["position"].dtype == "f8"
        assert opened["position"].shape[1] == 8
        assert "mean_radius" not in opened
    need = document(result)["need"]
    assert need["fields"] == ["position"]
    assert need["region"] == {"colatitude": [0.0, 90.0], "azimuth": [0.0, 180.0]}


def test_parameters_of_a_file_give_way_to_what_is_set_by_whatever_name(shrinking: Solves, tmp_path: Path) -> None:
    file = tmp_path / "fruit.toml"
    file.write_text("te = 0.03\ngamma = 20\nseed = 7\n")
    asked = ("solve", "shrinking", "--stages", "0.1", "--json", "--params", file)
    found = document(wizen(*asked, "--set", "exocarp_thickness=0.05", "--seed", 8))["params"]
    assert (found["exocarp_thickness"], found["modulus_ratio"], found["seed"]) == (0.05, 20.0, 8)
    file.write_text("te = 0.03\nexocarp_thickness = 0.02\n")
    refused = wizen(*asked)
    assert (refused.exit_code, "given twice" in document(refused)["error"]["message"]) == (2, True)


EIGHTH = ("solve", "dehydration", "--set", "te=0.1", "--set", "mirrors=xyz", "--quality", "preview", "--resolution", 8)


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".png", ".usdc", ".pc2", ".wzp"])
def test_a_part_of_a_surface_is_no_closed_shape(tmp_path: Path, suffix: str) -> None:
    """0 to 90 by 0 to 180 degrees has n by 2n points, as a whole lattice has."""
    out = tmp_path / f"part{suffix}"
    refused = wizen(*EIGHTH, "--stages", "0.01", "--region", "0,90,0,180", "--out", out)
    assert refused.exit_code == 2
    assert "--region leaves a part" in refused.stderr
    assert not out.exists()


@pytest.mark.parametrize("region", ["0,90,0,180", "0,90,0,90", "45,60,0,360"])
def test_a_part_of_a_surface_is_kept_as_fields(tmp_path: Path, region: str) -> None:
    part, whole = tmp_path / "part.h5", tmp_path / "whole.h5"
    document(wizen(*EIGHTH, "--stages", "0.01", "--fields", "position", "--out", whole, "--json"))
    document(wizen(*EIGHTH, "--stages", "0.01", "--fields", "position", "--region", region, "--out", part, "--json"))
    with xr.open_dataset(part, engine="h5netcdf") as some, xr.open_dataset(whole, engine="h5netcdf") as full:
        cut = full["position"].sel(colatitude=some["colatitude"], azimuth=some["azimuth"])
        assert some["position"].size
        assert cut.equals(some["position"])


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


def test_a_solve_that_fails_writes_the_stages_before(shrinking: Solves, tmp_path: Path) -> None:
    """As a run that was asked for these alone; and nothing where there is none."""
    out, alone = tmp_path / "part.h5", tmp_path / "alone.h5"
    failed = wizen("solve", "shrinking", "--set", "trouble=diverges", "--stages", "0.1,0.2", "--out", out)
    assert failed.exit_code == 1
    assert f"s = 0.1 settled before, and {out} holds them" in failed.stderr
    with xr.open_dataset(out, engine="h5netcdf") as kept:
        assert kept["stage"].values.tolist() == [0.1]
        assert json.loads(kept.attrs["need"])["stages"] == [0.1]
        assert kept["displacement"].dims[0] == "stage"
    assert wizen("solve", "shrinking", "--set", "trouble=refuses", "--out", alone).exit_code == 2
    assert not alone.exists()


def test_a_solve_that_fails_has_exit_code_1(shrinking: Solves) -> None:
    result = wizen("solve", "shrinking", "--set", "trouble=diverges", "--json")
    assert result.exit_code == 1
    error = document(result)["error"]
    assert (error["code"], error["advice"], error["last_stage"]) == ("not-converged", "Take care.", 0.1)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("solve dehydratoin", 2, "did you mean 'dehydration'"),
        ("solve dehydration --preset spere", 2, "did you mean 'sphere'"),
        ("solve dehydration --set gama=3", 2, "did you mean 'gamma'"),
        ("solve dehydration --set te", 2, "NAME=VALUE"),
        ("solve dehydration --set te=thick", 2, "exocarp_thickness"),
        ("solve dehydration --set gamma=true", 2, "gamma: a truth value is no number"),
        ("solve dehydration --set te=0.03 --set exocarp_thickness=0.05", 2, "as te and exocarp_thickness"),
        ("solve dehydration --seed 5 --set seed=6", 2, "--seed"),
        ("solve dehydration --quality preview --tolerance 0.3", 2, "a tolerance picks the quality"),
        ("solve dehydration --fields mesh_position --region 0:10,0:90", 2, "mesh_position is of the whole mesh"),
        ("solve dehydration --set te=0.02 --set te=0.03", 2, "twice"),
        ("solve dehydration --set rs1=1.1", 2, "stone"),
        ("solve dehydration --stages 0.1,x", 2, "not a number"),
        ("solve dehydration --stages 0.9", 2, "lies outside"),
        ("solve dehydration --quality good", 2, "quality"),
        ("solve dehydration --fields positon", 2, "did you mean 'position'"),
        ("solve dehydration --region 0,90", 2, "colatitude,azimuth in degrees, like 45:90,0:120"),
        ("solve dehydration --region 90,0,0,180", 2, "'90:0,0:180' is empty"),
        ("solve dehydration --region 0:90,0:400", 2, "-360 to 360"),
        ("solve dehydration --threads 100", 2, "--threads"),
        ("solve dehydration --dtype float16", 2, "dtype"),
        ("solve dehydration --resolution 3", 2, "resolution"),
        ("solve dehydration --tolerance 0.0001", 2, "finer than"),
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
        ("table build --store {table} --solver decay", 1, "decay"),
        ("table build --store {table} --resolution 0", 2, "--resolution"),
        ("query --store {table} --name other", 1, "other"),
        ("query --store {table} --set te=0.03 --set gamma=10", 2, "--stages"),
        ("query --store {table} --set te=0.03 --set gamma=10 --stages 0.1 --region 0,90", 2, "like 45:90,0:120"),
        ("query --store {table} --set te=0.03 --set gamma=10 --stages 0.1 --region 0,90,0,90 --relax", 2, "--relax"),
        ("query --store {table} --set te=0.03 --set gamma=10 --stages 0.1 --max-error 1 --relax", 2, "is relaxed"),
        ("query --store {table} --set te=0.03 --set gamma=true --stages 0.1", 2, "gamma: a truth value is no number"),
        ("query --store {table} --set te=0.03 --set exocarp_thickness=0.02 --stages 0.1", 2, "given twice"),
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
    plan, root = write_plan(more='trouble = "waits"'), tmp_path / "store"
    shrinking.hold(3)
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
    deadline = time.monotonic() + 200  # a busy machine takes its time to start three processes
    store = Store.open(root, create=True)
    while store.ledger.counts()["done"] < 1 and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(running.pid, signal.SIGINT)
    out, err = running.communicate(timeout=120)
    assert running.returncode == 130, err
    assert "Traceback" not in err
    solved = store.ledger.counts()["done"]
    assert 1 <= solved < 6
    if err.splitlines()[-1] != "stopped.":  # else the machine was too busy for more within two seconds
        said = json.loads(out)
        assert said["stopped"]
        assert said["solved"] == solved
        assert store.ledger.counts()["running"] == 0
        assert store.ledger.counts()["wanted"] == 6 - solved
    shrinking.let_go()
    result = wizen("sweep", plan, "--store", root, "--json")
    assert document(result)["reused"] == solved


def test_names_that_mean_something_to_others_are_names(
    shrinking: Solves, tmp_path: Path, write_plan: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the library that prints, `[/b c]` ends something bold; to a shell, it is two words."""
    monkeypatch.chdir(tmp_path)
    Path("a [").mkdir()
    root, plan = "a [/b c]", write_plan("[0.02, 0.03]", name="p[red]")
    swept = wizen("sweep", plan, "--store", root)
    assert swept.exit_code == 0, swept.output
    assert "p[red]: 4 solved" in swept.stdout
    (said,) = (line for line in swept.stdout.splitlines() if line.startswith("next: wizen "))
    built = wizen(*shlex.split(said.removeprefix("next: wizen ")))
    assert built.exit_code == 0, built.output
    assert f"{root}/tables/default/" in built.stdout
    for words in (("status",), ("table", "list"), ("table", "verify"), ("table", "info"), ("results",), ("doctor",)):
        done = wizen(*words, "--store", root)
        assert done.exit_code == 0, done.output
        assert "defect" not in done.output
    assert f"jobs in {root}" in wizen("status", "--store", root).stdout


@pytest.mark.parametrize("closed", ["2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize("workers", [1, 2])
def test_a_sweep_without_streams_runs_all_the_same(
    shrinking: Solves, tmp_path: Path, write_plan: Write, closed: str, workers: int
) -> None:
    """As some service managers and `nohup`'s users begin it: the first files opened would be in their places."""
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"}
    command = [sys.executable, "-m", "service.cli", "sweep", str(write_plan()), "--store", str(tmp_path / "store")]
    whole = ["sh", "-c", f'exec "$@" {closed}', "sh", *command, "--workers", str(workers)]
    assert subprocess.run(whole, env=environment, cwd=ROOT, check=False).returncode == 0
    assert Store.open(tmp_path / "store").ledger.counts()["done"] == 6


def test_words_that_are_no_text_are_refused_in_a_sentence(shrinking: Solves, tmp_path: Path, write_plan: Write) -> None:
    """Latin-1 of an older machine, say, as Python hands it on."""
    root, odd = tmp_path / "store", write_plan(name="pl\udce4n")
    for words in (
        ("sweep", odd, "--store", root),
        ("solve", "shrinking", "--set", "trouble=\udce4"),
        ("audit", "--store", root, "--token", "\udce4"),
        ("table", "build", "--store", root, "--plan", "\udce4"),
    ):
        if words[0] == "audit":
            assert wizen("sweep", write_plan("[0.02]"), "--store", root).exit_code == 0
        done = wizen(*words)
        assert done.exit_code == 2, done.output
        assert "not UTF-8" in done.output


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


def test_hours_stand_in_for_stages(shrinking: Solves) -> None:
    """As the solver's clock has it: `shrinking` is one of its own, which has none, and dehydration has."""
    refused = wizen("solve", "shrinking", "--hours", "24")
    assert refused.exit_code == 2
    assert "does not turn hours into stages" in refused.stderr
    both = wizen("solve", "dehydration", "--hours", "24", "--stages", "0.1")
    assert both.exit_code == 2
    assert "exclude each other" in both.stderr
    alone = wizen("solve", "dehydration", "--under", "temperature=60")
    assert alone.exit_code == 2
    assert "there are none" in alone.stderr
    unmeasured = wizen("solve", "dehydration", "--preset", "raisin", "--hours", "30", "--under", "temperature=60")
    assert unmeasured.exit_code == 2
    assert "open sun" in unmeasured.stderr


@pytest.mark.parametrize("command", [("query",), ("solve", "dehydration"), ("query", "--set", "kinetics=grape")])
def test_conditions_are_named_as_the_command_line_takes_them(command: tuple[str, ...]) -> None:
    refused = wizen(*command, "--preset", "plum1", "--hours", "24")
    assert refused.exit_code == 2
    assert "Say under which conditions: --under kinetics=grape, jujube, or page" in refused.stderr
    several = wizen(*command, "--preset", "jujube1", "--hours", "24")
    assert "For example --under temperature=60 --under air_speed=1 --under diameter=22 (C" in several.stderr
    assert "Write for example --under temperature=60" in wizen(*command, "--hours", "24", "--under", "hot").stderr


def test_what_takes_too_long_is_refused_before_it_begins(shrinking: Solves, tmp_path: Path, write_plan: Write) -> None:
    """What is stored takes no time."""
    cost = registry.get("shrinking").cost
    one = cost(registry.get("shrinking").parse({}), registry.get("shrinking").settle(Need(stages=(0.1,)))).seconds
    alone = ["solve", "shrinking", "--stages", "0.1", "--max-seconds"]
    refused = wizen(*alone, one / 2)
    assert refused.exit_code == 2
    assert "longer than" in refused.stderr
    assert len(shrinking) == 0
    assert wizen(*alone, one * 2).exit_code == 0
    store, before = tmp_path / "store", len(shrinking)
    refused = wizen("sweep", write_plan(), "--store", store, "--max-seconds", one / 2)
    assert refused.exit_code == 2
    assert len(shrinking) == before
    assert wizen("sweep", write_plan(), "--store", store).exit_code == 0
    assert wizen("sweep", write_plan(), "--store", store, "--max-seconds", one / 2).exit_code == 0
    far = wizen("sweep", write_plan(), "--store", store, "--max-seconds", 1, "--scheduler", "tcp://127.0.0.1:1")
    assert far.exit_code == 2
    assert "this machine alone" in far.stderr
