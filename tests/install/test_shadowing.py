"""Folders named as the four packages, in the working directory: the packages are found, or a sentence says what hides
them."""

from __future__ import annotations

from pathlib import Path

import pytest

from ._environments import FLOORS, Environment, built, copied

EDITABLE, WHEEL = "build_editable", "build_wheel"


@pytest.fixture(scope="module", params=[EDITABLE, WHEEL])
def environment(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Environment:
    place = tmp_path_factory.mktemp("place")
    return Environment(place / "env", built(copied(place / "tree"), place / "wheels", request.param))


def test_folders_without_python_hide_nothing(environment: Environment, tmp_path: Path) -> None:
    for name in (*FLOORS, "store/shards", "solver/contract", "sweeps/running", "service/app"):
        (tmp_path / name).mkdir(exist_ok=True)
    named = "store.store, store.shards, solver.contract, sweeps.running.runner, service.app"
    asked = f"import {named}; print(store.shards.write)"
    done = environment.run("python", "-c", asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "function write" in done.stdout


@pytest.mark.parametrize(
    ("name", "hidden", "asked"),
    [("solver.py", "solver", "store"), ("store/__init__.py", "store", "sweeps"), ("sweeps.py", "sweeps", "service")],
)
def test_a_module_that_hides_a_package_is_named(
    environment: Environment, tmp_path: Path, name: str, hidden: str, asked: str
) -> None:
    other = tmp_path / name
    other.parent.mkdir(exist_ok=True)
    other.touch()
    done = environment.run("python", "-c", f"import {asked}", cwd=tmp_path)
    said = done.stderr.splitlines()[-1]
    assert said.startswith(f"ImportError: {other} hides wizen's package `{hidden}`.")
    around = environment.run("python", "-P", "-c", f"import {asked}", cwd=tmp_path)
    assert around.returncode == 0, around.stderr  # what the sentence advises


def test_the_command_looks_past_all_of_them(environment: Environment, tmp_path: Path) -> None:
    for name in FLOORS:
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the wrong module')", encoding="utf-8")
    done = environment.run("wizen", "presets", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "jujube2" in done.stdout
