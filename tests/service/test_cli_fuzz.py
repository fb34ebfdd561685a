"""The command line taken at anything: typed errors with a sentence, never a traceback, never a "defect"."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from service.cli import app

#: What people type, what goes wrong in shells, and what breaks parsers.
TYPED = """
- -- 0 -1 0.1 1e400 nan inf -inf 1_0 ٣ default none te=0.03 te=0.03,gamma=7 te= =0.1 te=0.03,te=0.04
te=nan,gamma=7 s=0.2 0.1,0.2 0.1:0.3:5 , out.glb out.obj out.npz out.json out.doc missing/out.glb . / ~ ../x
0,90,0,90 45:90,350:20 0:90,-45:45 0:90,20 :,: raisin plum1 kinetics=grape rate=1
idw linear+LL+env idw+idw rgh:0.1 rgh: glb usda png read 90d -3d 1e99d
"""
WORDS = st.one_of(
    st.sampled_from(TYPED.split()),
    st.sampled_from(["", "a\0b", "a b"]),
    st.floats().map(str),
    st.integers().map(str),
    st.text(max_size=12),
)
STORES = st.sampled_from(["store", "store", "store", "nothing", "file", ""])


def options(*names: str) -> st.SearchStrategy[list[str]]:
    """Return some of the options, each with a word."""
    if not names:
        return st.just([])
    pairs = st.tuples(st.sampled_from(names), WORDS).map(list)
    return st.lists(pairs, max_size=4).map(lambda found: [word for pair in found for word in pair])


def words(command: str, *names: str, stored: bool = True, arguments: int = 1) -> st.SearchStrategy[list[str]]:
    """Return a command with a store, some options and up to so many arguments."""
    parts = [st.just(command.split()), options(*names), st.lists(WORDS, max_size=arguments)]
    if stored:
        parts.append(STORES.map(lambda store: ["--store", store]))
    parts.append(st.sampled_from([[], ["--json"]]))
    return st.tuples(*parts).map(lambda found: [word for part in found for word in part])


#: None of them runs a solver, or listens.
COMMANDS = st.one_of(
    words("query", "--set", "--stages", "--name", "--resolution", "--method", "--max-error", "--out"),
    words("query", "--set", "--stages", "--hours", "--under", "--preset", "--region", "--out"),
    words("export", "--out", "--format", "--stage", "--colour", "--textures", "--size", "--scale", "--fps", "--map"),
    words("status", arguments=2),
    words("table build", "--name", "--solver", "--quality", "--version"),
    words("table rebuild", "--name", "--resolution", "--dtype"),
    words("table verify", "--name"),
    words("table compare", "--name", arguments=2),
    words("table score", "--name", "--held-out", "--methods", "--stage"),
    words("table info", "--name", arguments=2),
    words("token create", "--name", "--scopes", "--expires"),
    words("token list"),
    words("token revoke", arguments=2),
    words("presets", "--nothing", stored=False),
    words("serve", "--port", "--workers", stored=False).map(lambda found: [*found, "--port", "99999999"]),
    words("solve", "--preset", "--set", "--stages", "--quality", "--region", "--out", stored=False).map(
        lambda found: [*found, "--set", "nobody=1"]
    ),
    words("sweep", "--workers", "--scheduler").map(lambda found: [*found, "plan.toml"]),
    st.lists(WORDS, max_size=4),
)


@pytest.fixture(scope="module")
def place(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A directory to work in, with a store, a file that is none, and a plan that is none."""
    folder = tmp_path_factory.mktemp("place")
    shutil.copytree(built, folder / "store")
    (folder / "file").write_text("not a store")
    (folder / "plan.toml").write_text("solver = 3")
    before = Path.cwd()
    os.chdir(folder)
    yield folder
    os.chdir(before)


def clean(folder: Path) -> None:
    for path in folder.iterdir():
        if path.name not in ("store", "file", "plan.toml"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()


@settings(
    max_examples=int(os.environ.get("WIZEN_FUZZ_EXAMPLES", "50")),
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(line=COMMANDS)
def test_no_line_ends_in_a_traceback(place: Path, line: list[str]) -> None:
    result = CliRunner().invoke(app, line)
    assert result.exit_code in (0, 1, 2), (line, result.output)
    assert isinstance(result.exception, SystemExit | None), (line, result.exception)
    said = result.stdout + result.stderr
    assert "Traceback" not in said, line
    assert "defect of wizen" not in said, (line, said)
    if result.exit_code:
        assert "error: " in result.stderr or "Usage" in said, (line, said)
        if "--json" in line and result.stdout.strip():
            error = json.loads(result.stdout)["error"]
            assert error["code"] != "internal-error"
            assert error["message"]
    clean(place)
