"""Every `wizen`, `curl` and Python block that a document shows, run as it stands in a directory prepared for it.

The directory holds what the documents speak of: a store `demo` with results and a table, stored runs, a mesh, a plan. A
service answers beside it; its port and the key of a result stand in for the ones that are printed. Commands that solve
take minutes together and are marked slow.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import trimesh

from benchmarks.service import lookup
from store import tables
from store.store import Store
from tests.service._runs import rotting

from ._blocks import DOCUMENTS, ROOT, Block, blocks, commands

#: What answers within seconds. Whatever is not here solves, and runs with the slow tests.
_QUICK = re.compile(
    r"wizen (presets|status|query|map|export|table (build|rebuild|verify|compare|score)|refine .*--dry-run|.*--help)|curl"
)
#: What is tested elsewhere: `make` is what runs these tests, and equations are no commands.
_COMMAND = re.compile(r"(wizen|curl|TOKEN=|python) ?")
_INLINE = re.compile(r"`(wizen (?:solve|export|query|onset|map|table rebuild|table score|sweep) [^`]*[^`A-Z])`")
_PORT = "8765"


def _shown() -> list[tuple[Block, str]]:
    """Return every command with its block; a block that sets variables is one script."""
    found = []
    for block in blocks():
        if block.language == "python":
            continue
        lines = commands(block)
        if any(line.startswith("TOKEN=") for line in lines):
            found.append((block, "\n".join(lines)))
            continue
        found += [(block, line) for line in lines if _COMMAND.match(line)]
    for path in DOCUMENTS:
        words = re.sub(r"\s*\n\s*", " ", path.read_text(encoding="utf-8"))
        for command in dict.fromkeys(_INLINE.findall(words)):
            if not re.search(r"\b[A-Z]{2,}\b|\.\.\.|maps/", command):
                found.append((Block(path, 0, "", command), command))
    return found


def _case(block: Block, command: str) -> object:
    quick = _QUICK.match(command) and not re.search(r"exact=run", command)
    return pytest.param(command, id=f"{block}:{command[:60]}", marks=() if quick else pytest.mark.slow)


class Workshop:
    """The directory, and the service beside it."""

    def __init__(self, at: Path, port: int, key: str, log: Path) -> None:
        self.at, self.port, self.key, self.log = at, port, key, log

    def run(self, command: str, limit: float) -> subprocess.CompletedProcess[str]:
        """Run a command with bash, `wizen` and `python` being those of this environment."""
        generation = next((self.at / "demo" / "tables" / "default").glob("*.h5")).stem
        command = command.replace(_PORT, str(self.port)).replace("/jobs/KEY/", f"/jobs/{self.key}/")
        command = re.sub(r"\b[0-9a-f]{16}\b", generation, command)
        # without it curl calls an answer of 404 a success
        command = re.sub(r"\bcurl (?=.*http)", "curl --fail-with-body --no-progress-meter --max-time 300 ", command)
        return subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", command],
            cwd=self.at,
            env=_surroundings(),
            capture_output=True,
            text=True,
            errors="replace",
            timeout=limit,
            check=False,
        )


def _surroundings() -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("WIZEN_")}
    paths = os.pathsep.join([str(Path(sys.executable).parent), kept.get("PATH", "")])
    return kept | {"PATH": paths, "WIZEN_JOBS_WORKERS": "1"}


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workshop]:
    at = tmp_path_factory.mktemp("workshop")
    (at / "examples").symlink_to(ROOT / "examples")
    store = Store.open(at / "demo", create=True)
    lookup.fill(store, te=(0.03, 0.04), gamma=(10.0, 30.0, 50.0), band=32)
    tables.build(store)
    shutil.copytree(at / "demo", at / "held")
    for name in ("orange.h5", "run.h5"):
        rotting().to_netcdf(at / name, engine="h5netcdf")
    for name in ("patch.obj", "my.obj"):
        trimesh.creation.icosphere(3).export(at / name)
    plan = (ROOT / "examples" / "fig7-right.toml").read_text(encoding="utf-8")
    (at / "plan.toml").write_text(plan.replace("[set]", '[set]\nmirrors = "xyz"'), encoding="utf-8")
    log = at / "serve.log"
    with log.open("w") as file, _served(at, file) as port:
        yield Workshop(at, port, next(iter(store.keys())), log)


@contextlib.contextmanager
def _served(at: Path, log: object) -> Iterator[int]:
    command = [str(Path(sys.executable).parent / "wizen"), "serve", "--store", "demo", "--port", "0"]
    server = subprocess.Popen(
        command, cwd=at, env=_surroundings(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        assert server.stdout is not None
        said = ""
        for line in server.stdout:
            said += line
            if at_port := re.search(r"http://127\.0\.0\.1:(\d+)", line):
                break
        else:
            pytest.fail(f"no service: {said}")
        yield int(at_port[1])
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(30)


@pytest.mark.parametrize("command", [_case(*shown) for shown in _shown()])
@pytest.mark.timeout(3600)
def test_a_shown_command_works(workshop: Workshop, command: str) -> None:
    if command.startswith("wizen serve"):
        return  # it answers beside all the others
    done = workshop.run(command, 3000)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    for name in re.findall(r"(?:--out|-o) ([\w.-]+)", command):
        assert (workshop.at / name).stat().st_size > 0


def _python() -> list[object]:
    return [
        pytest.param(block, id=str(block), marks=pytest.mark.slow if ".solve(" in block.text else ())
        for block in blocks()
        if block.language == "python"
    ]


@pytest.mark.parametrize("block", _python())
def test_a_python_block_works(workshop: Workshop, monkeypatch: pytest.MonkeyPatch, block: Block) -> None:
    """It runs on its own, and an expression has the value that its comment begins with."""
    monkeypatch.chdir(workshop.at)
    names: dict[str, object] = {}
    exec(compile(block.text, str(block), "exec"), names)
    for line in block.text.splitlines():
        shown = re.fullmatch(r"(?P<value>[\w.()]+)  # (?P<said>-?\d+(?:\.(?P<digits>\d+))?)\b.*", line)
        if shown:
            assert f"{eval(shown['value'], names):.{len(shown['digits'] or '')}f}" == shown["said"]


def test_every_plan_that_is_named_can_be_read() -> None:
    for path in (ROOT / "examples").rglob("*.toml"):
        tomllib.loads(path.read_text(encoding="utf-8"))


def test_commands_are_found() -> None:
    """The collector has not gone blind."""
    shown = [command for _, command in _shown()]
    assert len(shown) > 40
    assert sum(bool(_QUICK.match(command)) for command in shown) > 15
    assert any("\n" in command and "/events" in command for command in shown)
