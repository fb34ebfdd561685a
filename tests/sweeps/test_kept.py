"""Compiled loops find a place: the one chosen, the package's, the user's, or one of a program's own while it runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from _command import ROOT

import solver
from sweeps.commands.terminal import kernels

#: numba takes the chosen directory alone here, as where all others are shut, and looks for one as it loads this.
ALONE = """
import os
from sweeps.commands.terminal import kernels
kernels._may_write = lambda path: False
with kernels.kept():
    import solver.linalg.patterns
    assert os.listdir(os.environ["NUMBA_CACHE_DIR"])
    assert os.stat(os.environ["NUMBA_CACHE_DIR"]).st_mode & 0o077 == 0
    kernels._may_write = lambda path: True
    assert kernels.place() is None, "it does not last"
"""


def test_the_first_place_that_may_be_written_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "solver"
    monkeypatch.setattr(solver, "__file__", str(package / "__init__.py"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert kernels.place() == package
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "not" / "yet"))
    assert kernels.place() == tmp_path / "not" / "yet"
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "below"))
    assert kernels.place() == package
    monkeypatch.setattr(
        kernels, "_may_write", lambda path: path != package and path.is_relative_to(tmp_path / "caches")
    )
    assert kernels.place() == tmp_path / "caches" / "numba"
    monkeypatch.setattr(kernels, "_may_write", lambda path: False)
    assert kernels.place() is None


def test_where_none_lasts_a_program_has_its_own_and_leaves_nothing(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator", "TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", ALONE], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not list(tmp_path.iterdir())
