"""The solvers `shrinking` and `ridged`, installed as any third solver is: modules and entry points on the path."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from _command import wizen

from solver import registry
from store.store import Store

HERE = Path(__file__).parent


class Solves:
    """Counts the solves of `shrinking`, in whichever process they happen."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def hold(self, after: int) -> None:
        """Let jobs with `trouble = "waits"` wait from so many solves on."""
        self._hold().write_text(str(after))

    def let_go(self) -> None:
        self._hold().unlink(missing_ok=True)

    def _hold(self) -> Path:
        return Path(f"{self._path}.hold")

    def lines(self) -> list[str]:
        return self._path.read_text().splitlines() if self._path.exists() else []

    def __len__(self) -> int:
        return len(self.lines())


def until(happened: Callable[[], bool], seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    info = tmp_path_factory.mktemp("site") / "shrinking-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: shrinking\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[wizen.solvers]\nshrinking = shrinking:SOLVER\nridged = ridged:SOLVER\n")
    with pytest.MonkeyPatch.context() as patch:
        for path in (HERE, info.parent):
            patch.syspath_prepend(path)
        patch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), str(info.parent)]))
        _forget_solvers()
        yield
    _forget_solvers()


def _forget_solvers() -> None:
    registry._places.cache_clear()
    registry.get.cache_clear()


@pytest.fixture
def shrinking(site: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Solves:
    monkeypatch.setenv("SHRINKING_LOG", str(tmp_path / "solves.log"))
    return Solves(tmp_path / "solves.log")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(tmp_path / "store", create=True)


def write(
    path: Path, te: str = "[0.02, 0.03, 0.04]", gamma: str = "[10, 30]", more: str = "", stages: str = "[0.1, 0.2]"
) -> Path:
    """Write a plan of `shrinking`: six samples unless told otherwise."""
    path.write_text(
        f'solver = "shrinking"\n{"" if not more else "[set]"}\n{more}\n[axes]\nte = {te}\ngamma = {gamma}\n'
        f'[need]\nstages = {stages}\nquality = "preview"\n'
    )
    return path


@pytest.fixture
def write_plan(tmp_path: Path) -> Callable[..., Path]:
    def here(*values: str, name: str = "six", **more: str) -> Path:
        return write(tmp_path / f"{name}.toml", *values, **more)

    return here


@pytest.fixture(scope="module")
def table(site: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a table of shrinking spheres over te and gamma, which no test changes."""
    folder = tmp_path_factory.mktemp("table")
    store = folder / "store"
    assert wizen("sweep", write(folder / "six.toml"), "--store", store).exit_code == 0
    assert wizen("table", "build", "--store", store, "--solver", "shrinking").exit_code == 0
    return store
