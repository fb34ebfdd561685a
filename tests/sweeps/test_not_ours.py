"""A store that belongs to somebody else, or lies on a disk that is read only: a sentence, and what is there is read."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from _command import wizen

from store.store import Store
from store.tokens import Tokens

ROOT = Path(__file__).parents[2]

#: Runs a command as nobody; everything that is imported from a home directory was imported before.
AS_NOBODY = """
import os, sys
from service.cli import main
import store.tables, store.tokens, store.copies.backup, sweeps.running.runner, sweeps.running.executors, sweeps.tabled
import sweeps.planning.plan, sweeps.results, xarray, h5netcdf, store.scalars, store.ledger.asks
from solver import registry
registry.get("shrinking")
os.setegid(65534)
os.seteuid(65534)
sys.argv = ["wizen", *sys.argv[1:]]
main()
"""

pytestmark = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root becomes another user"
)


def as_nobody(*words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"}
    return subprocess.run(
        [sys.executable, "-c", AS_NOBODY, *words],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        cwd=ROOT,
    )


@pytest.mark.slow
@pytest.mark.usefixtures("site")
def test_every_writing_command_says_so(store: Store, write_plan: Callable[..., Path], tmp_path: Path) -> None:
    plan = write_plan()
    assert wizen("sweep", plan, "--store", store.root).exit_code == 0
    assert wizen("table", "build", "--store", store.root).exit_code == 0
    Tokens(store.root).create("one", ["run"])
    for path in [tmp_path, *tmp_path.parents]:
        if path.stat().st_uid == os.geteuid() and path != Path("/tmp"):
            path.chmod(path.stat().st_mode | 0o055)
    (store.root / ".x.1.aa.part").touch()
    before = {path: path.stat().st_mtime_ns for path in store.root.rglob("*") if "sqlite" not in path.name}
    root = str(store.root)
    for words in (
        ("sweep", str(plan), "--store", root),
        ("sweep", str(plan), "--store", str(tmp_path / "new")),
        ("table", "build", "--store", root),
        ("token", "create", "--store", root, "--name", "two"),
        ("token", "revoke", "one", "--store", root),
        ("backup", str(tmp_path / "copy"), "--store", root),
    ):
        said = as_nobody(*words)
        assert said.returncode not in (0, -9), words
        assert "cannot be written" in said.stderr, (words, said.stderr)
        assert "Traceback" not in said.stderr, (words, said.stderr)
    assert before == {path: path.stat().st_mtime_ns for path in store.root.rglob("*") if "sqlite" not in path.name}
    said = as_nobody("table", "info", "--store", root)
    assert said.returncode == 0, said.stderr
