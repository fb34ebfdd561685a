"""A solver of one folder, put into `solver/`, is in the wheel: swept, tabled, looked up, served and drawn."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from tests.service._asking import until

from ._environments import Environment, built, copied

_PLAN = """
solver = "cushion"
axes = {flatness = [0.3, 0.5, 0.8], give = [0.2, 0.6]}
sampling = {kind = "grid"}
need = {stages = [0.5, 1.0], resolution = 16}
"""
#: A stored run at a stored stage: exact but for single precision.
_ASKED = {"flatness": 0.5, "give": 0.6, "p": 0.5}


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Environment:
    place = tmp_path_factory.mktemp("place")
    tree = copied(place / "tree")
    shutil.copytree(Path(__file__).with_name("cushion"), tree / "solver" / "cushion")
    return Environment(place / "env", built(tree, place / "wheels"))


@contextmanager
def _served(environment: Environment, at: Path) -> Iterator[str]:
    log = at / "serve.log"
    with log.open("w") as said:
        command = [environment.bin / "wizen", "serve", "--store", "store", "--port", "0"]
        server = subprocess.Popen(command, cwd=at, env=environment.variables(), stdout=said, stderr=said)
    found: list[str] = []

    def ready() -> bool:
        found[:] = re.findall(r"http://127\.0\.0\.1:\d+", log.read_text())
        return bool(found) or server.poll() is not None

    try:
        until(ready, 120)
        assert found, log.read_text()
        yield found[0]
    finally:
        server.terminate()
        server.wait(60)


def test_it_does_all_that_the_others_do(environment: Environment, tmp_path: Path) -> None:
    def wizen(*words: str) -> str:
        done = environment.run("wizen", *words, cwd=tmp_path)
        assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    (tmp_path / "plan.toml").write_text(_PLAN, encoding="utf-8")
    assert "flat" in wizen("presets", "--json")
    wizen("sweep", "plan.toml", "--store", "store", "--workers", "1", "--json")
    wizen("table", "build", "--store", "store", "--json")
    exact = 0.5 * (1 + 0.6 * 0.5)  # height of the pole
    sets = ("--set", "flatness=0.5", "--set", "give=0.6")
    wizen("query", "--store", "store", *sets, "--stages", "0.5", "--out", "cushion.obj")
    lines = (tmp_path / "cushion.obj").read_text(encoding="utf-8").splitlines()
    points = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    assert np.abs(points[:, 1]).max() == pytest.approx(exact, abs=1e-5)
    assert np.hypot(points[:, 0], points[:, 2]).max() == pytest.approx(1, abs=0.02)
    wizen("map", "--store", "store", "--out", "map.png", "--stages", "0.5,1")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    with _served(environment, tmp_path) as url:
        query = "&".join(f"{name}={value}" for name, value in _ASKED.items())
        with urllib.request.urlopen(f"{url}/v1/shapes/cushion?{query}&format=json") as answer:
            said = json.load(answer)
        with urllib.request.urlopen(f"{url}/v1/shapes/cushion?{query}&format=glb") as answer:
            assert answer.read(4) == b"glTF"
    assert said["exact"]
