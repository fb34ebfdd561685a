"""A store that belongs to somebody else, or lies on a disk that is read only: a sentence, and what is there is read."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from _command import wizen

from store.store import Store
from store.tokens import Tokens

ROOT = Path(__file__).parents[2]

#: Runs a command as nobody; what is imported from a home directory was imported before, by looking at a store of ours.
AS_NOBODY = """
import os, sys
from service.cli import main
import store.tables, store.tokens, store.copies.backup, sweeps.running.runner, sweeps.running.executors, sweeps.tabled
import sweeps.planning.plan, sweeps.results, xarray, h5netcdf, store.scalars, store.ledger.asks
from solver import registry
from typer.testing import CliRunner
from service.cli import app
CliRunner().invoke(app, ["table", "info", "--store", os.environ["OURS"]])
registry.get("shrinking")
os.setegid(65534)
os.seteuid(65534)
sys.argv = ["wizen", *sys.argv[1:]]
main()
"""

pytestmark = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root becomes another user"
)


def as_nobody(ours: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "OURS": str(ours), "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ['PYTHONPATH']}"}
    return subprocess.run(
        [sys.executable, "-c", AS_NOBODY, *words],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        cwd=ROOT,
    )


@pytest.fixture
def open_to_all() -> Iterator[Path]:
    """A directory that everybody may look into: pytest closes its own whenever a test begins anywhere."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


@pytest.mark.slow
@pytest.mark.usefixtures("site")
def test_every_writing_command_says_so(write_plan: Callable[..., Path], open_to_all: Path) -> None:
    store = Store.open(open_to_all / "store", create=True)
    plan = shutil.copy(write_plan(), open_to_all)
    assert wizen("sweep", plan, "--store", store.root).exit_code == 0
    assert wizen("table", "build", "--store", store.root).exit_code == 0
    Tokens(store.root).create("one", ["run"])
    ours = shutil.copytree(store.root, open_to_all / "ours")
    (store.root / ".x.1.aa.part").touch()
    before = {path: path.stat().st_mtime_ns for path in store.root.rglob("*") if "sqlite" not in path.name}
    root = str(store.root)
    for words in (
        ("sweep", str(plan), "--store", root),
        ("sweep", str(plan), "--store", str(open_to_all / "new")),
        ("table", "build", "--store", root),
        ("token", "create", "--store", root, "--name", "two"),
        ("token", "revoke", "one", "--store", root),
        ("backup", str(open_to_all / "copy"), "--store", root),
    ):
        said = as_nobody(ours, *words)
        assert said.returncode not in (0, -9), words
        assert "cannot be written" in said.stderr, (words, said.stderr)
        assert "Traceback" not in said.stderr, (words, said.stderr)
    assert before == {path: path.stat().st_mtime_ns for path in store.root.rglob("*") if "sqlite" not in path.name}
    key = next(iter(store.keys()))
    for words in (("table", "info"), ("table", "list"), ("results", "--json"), ("show", key[:12])):
        said = as_nobody(ours, *words, "--store", root)
        assert said.returncode == 0, (words, said.stderr)
    # the ledger's own readers write beside it: a sentence
    for words in (("status",), ("audit",)):
        said = as_nobody(ours, *words, "--store", root)
        assert said.returncode == 0 or "cannot be written" in said.stderr, (words, said.stderr)
        assert "Traceback" not in said.stderr, (words, said.stderr)
