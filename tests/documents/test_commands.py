"""Every `wizen`, `curl` and Python block that a document shows, run as it stands in a directory prepared for it.

The directory holds what the documents speak of: a store `demo` with results and a table, stored runs, a mesh, a plan. A
service answers beside it; its port, the key of a result and the table's plan stand in for the ones that are printed.
Commands that solve take minutes together and are marked slow. A quick `wizen` that needs nothing of a shell is called
in this process, which takes a third of the time: what is installed as `wizen` builds the table here, and serves.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from typer.testing import CliRunner

from benchmarks.service import lookup
from service.cli import app
from solver.contract import Need
from solver.dehydration import SOLVER
from store import shards, starter
from store.store import Store
from sweeps.planning.plan import Plan
from tests.service._asking import until
from tests.service._runs import rotting

from ._blocks import DOCUMENTS, ROOT, Block, _blocks, blocks, commands

#: What answers within seconds. Whatever is not here solves, and runs with the slow tests.
_QUICK = re.compile(
    r"curl|wizen (presets|status|results|query|export|table (build|rebuild.* 24|verify|compare|score)|refine .*--dry|"
    r".*--help)"
)
#: What is tested elsewhere: `make` is what runs these tests, and equations are no commands.
_COMMAND = re.compile(r"(wizen|curl|TOKEN=|python) ?")
#: Words and quoted words, none of which a shell would make another of.
_PLAIN = re.compile(r"""wizen( +([\w.,:=/+-]+|"[^"$`\\]*"|'[^']*'))*""")
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


def _quick(command: str) -> bool:
    # --full paints for fifteen seconds: once, into a GLB; what it puts into USDZ tests/service/test_full_looks.py reads
    return bool(_QUICK.match(command)) and not re.search(r"exact=run|--relax|usdz --full", command)


def _case(block: Block, command: str) -> object:
    return pytest.param(command, id=f"{block}:{command[:60]}", marks=() if _quick(command) else pytest.mark.slow)


#: What `demo` holds the made-up runs of: the fruits of `examples/fig7-right.toml`.
_PLAN = """
solver = "dehydration"
preset = "sphere"
set = {mirrors = "xyz"}
axes = {te = [0.03, 0.04], gamma = [10, 30, 50]}
sampling = {kind = "grid"}
need = {stages = [0.1, 0.2, 0.3], quality = "preview", resolution = 32, fields = ["displacement", "roughness"]}
"""


class Workshop:
    """The directory, and the service beside it."""

    def __init__(self, at: Path, port: int, key: str) -> None:
        self.at, self.port, self.key = at, port, key

    def here(self, command: str) -> str:
        """Return a command with the port, the key, the table's generation and its plan that there are."""
        generation = next((self.at / "demo" / "tables" / "default").glob("*.h5")).stem
        command = command.replace(_PORT, str(self.port)).replace("/jobs/KEY/", f"/jobs/{self.key}/")
        # the table is of made-up runs, which no sweep of the plan that is shown shall find done
        command = command.replace("wizen refine examples/fig7-right.toml", "wizen refine plan.toml")
        return re.sub(r"\b[0-9a-f]{16}\b", generation, command)

    def call(self, command: str) -> tuple[int, str]:
        """Call a plain `wizen` in this process, in the directory; return how it ended and what it said."""
        with contextlib.chdir(self.at):
            done = CliRunner().invoke(app, shlex.split(self.here(command))[1:])
        return done.exit_code, f"{done.output}\n{done.exception}"

    def run(self, command: str, limit: float) -> subprocess.CompletedProcess[str]:
        """Run a command with bash, `wizen` and `python` being those of this environment."""
        command = self.here(command)
        if "$TOKEN" in command and "TOKEN=" not in command:
            command = f"TOKEN=$(wizen token create --store demo --name visitor --scopes run)\n{command}"
        # without it curl calls an answer of 404 a success
        command = re.sub(r"\bcurl (?=.*http)", "curl --fail-with-body --no-progress-meter --max-time 1500 ", command)
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
    return kept | {"PATH": paths, "WIZEN_JOBS_WORKERS": "2"}


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workshop]:
    at = tmp_path_factory.mktemp("workshop")
    (at / "examples").symlink_to(ROOT / "examples")
    plan = at / "plan.toml"
    plan.write_text(_PLAN, encoding="utf-8")
    store, rng = Store.open(at / "demo", create=True), np.random.default_rng(0)
    for job in Plan.load(plan).jobs():
        lookup.put(store, SOLVER.parse(job.params), Need.parse(job.need), rng)
    made = subprocess.run(["wizen", "table", "build", "--store", "demo"], cwd=at, env=_surroundings(), check=False)
    assert made.returncode == 0
    shutil.copytree(at / "demo", at / "held")
    # and a run between the samples, which a table's answers are held against
    between = {**job.params, "exocarp_thickness": 0.035, "modulus_ratio": 20}
    lookup.put(Store.open(at / "held"), SOLVER.parse(between), Need.parse(job.need), rng)
    for name in ("orange.h5", "run.h5", "eighth.h5"):
        shards.write(at / name, rotting(), "0" * 64)
    for name in ("patch.obj", "my.obj", "banana.glb"):
        trimesh.creation.icosphere(3).export(at / name)
    for name in ("sun.png", "mask.png", "rot.png"):
        Image.linear_gradient("L").save(at / name)
    shown = [block.text for block in blocks() if block.language == "toml" and '"@rot.png"' in block.text]
    (at / "rind.toml").write_text("\n".join(shown), encoding="utf-8")
    # the package is served, too, where nothing else is named
    shutil.copytree(starter.ROOT / "tables" / "raisin", at / "demo" / "tables" / "raisin")
    with _served(at) as port:
        yield Workshop(at, port, next(iter(store.keys())))


@contextlib.contextmanager
def _served(at: Path) -> Iterator[int]:
    log = at / "serve.log"
    command = [str(Path(sys.executable).parent / "wizen"), "serve", "--store", "demo", "--port", "0"]
    with log.open("w") as said:
        server = subprocess.Popen(command, cwd=at, env=_surroundings(), stdout=said, stderr=said)
    found: list[str] = []

    def ready() -> bool:
        found[:] = re.findall(r"http://127\.0\.0\.1:(\d+)", log.read_text())
        return bool(found) or server.poll() is not None

    try:
        until(ready, 120)
        assert found, log.read_text()
        yield int(found[0])
    finally:
        server.terminate()
        server.wait(60)


def _cases() -> list[object]:
    """What stands in two documents runs once."""
    first = {re.sub(r"\s+#.*", "", command): (block, command) for block, command in reversed(_shown())}
    return [_case(*shown) for shown in reversed(first.values())]


@pytest.mark.parametrize("command", _cases())
@pytest.mark.timeout(3600)
def test_a_shown_command_works(workshop: Workshop, command: str) -> None:
    if command.startswith("wizen serve"):
        return  # it answers beside all the others
    bare = re.sub(r"\s+#.*", "", command)
    if _quick(command) and _PLAIN.fullmatch(bare):
        code, said = workshop.call(bare)
    else:
        done = workshop.run(command, 3000)
        code, said = done.returncode, f"{done.stdout}\n{done.stderr}"
    assert code == 0, f"{command}\n{said}"
    for name in re.findall(r"(?:--out|-o) ([\w.-]+)", command):
        assert (workshop.at / name).stat().st_size > 0


def _python() -> list[object]:
    return [
        pytest.param(block, id=str(block), marks=pytest.mark.slow if ".solve(" in block.text else ())
        for block in blocks()
        if block.language == "python"
    ]


@pytest.mark.parametrize("block", _python())
@pytest.mark.timeout(3600)
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


def test_a_block_goes_on_behind_a_blank_line(tmp_path: Path) -> None:
    path = tmp_path / "page.md"
    path.write_text("Words.\n\n    wizen a\n\n    wizen b\nWords.\n\n- entry\n\n    goes on\n", encoding="utf-8")
    assert [commands(block) for block in _blocks(path)] == [["wizen a", "wizen b"]]


def test_commands_are_found() -> None:
    """The collector has not gone blind."""
    shown = [command for _, command in _shown()]
    assert len(shown) > 40
    assert sum(bool(_QUICK.match(command)) for command in shown) > 15
    assert any("\n" in command and "/events" in command for command in shown)
