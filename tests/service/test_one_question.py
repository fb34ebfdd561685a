"""One question has one answer: the files of `wizen query` are those of the service, byte for byte."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
from typer.testing import CliRunner

from service.cli import app
from store import starter

from ._gltf import parsed
from .conftest import SHAPE, client_of

#: A pattern that the runs start from; mirrors, and a preset's skin and size; another of several axes.
QUESTIONS = [{"te": "0.034", "gamma": "22"}, {"preset": "raisin"}, {"preset": "plum2"}]


@pytest.fixture(scope="module")
def package() -> Iterator[httpx.Client]:
    with client_of(starter.ROOT) as client:
        yield client


def queried(asked: dict[str, str], out: Path, *words: str) -> bytes:
    given = [w for name, value in asked.items() if name != "preset" for w in ("--set", f"{name}={value}")]
    given += ["--preset", asked["preset"]] if "preset" in asked else []
    done = CliRunner().invoke(
        app, ["query", *given, "--stages", "0.2", "--resolution", "16", "--out", str(out), *words]
    )
    assert done.exit_code == 0, done.output
    return out.read_bytes()


def sent(client: httpx.Client, asked: dict[str, str], name: str, **more: str) -> bytes:
    answer = client.get(SHAPE, params={**asked, "s": "0.2", "resolution": "16", "format": name, **more})
    assert answer.status_code == 200, answer.text
    return answer.content


@pytest.mark.parametrize("asked", QUESTIONS)
@pytest.mark.parametrize(("name", "suffix"), [("glb", "glb"), ("obj", "obj"), ("points", "wzp")])
def test_files_of_both_ways_are_the_same(
    package: httpx.Client, tmp_path: Path, asked: dict[str, str], name: str, suffix: str
) -> None:
    found = queried(asked, tmp_path / f"fruit.{suffix}")
    if name == "glb":
        assert parsed(found)[0] == parsed(sent(package, asked, name))[0]
    assert found == sent(package, asked, name)


@pytest.mark.parametrize("region", [None, "45:90,350:20"])
def test_an_archive_of_stages_says_of_each_what_that_of_one_does(
    package: httpx.Client, tmp_path: Path, region: str | None
) -> None:
    asked, part = QUESTIONS[1], {} if region is None else {"region": region}
    words = () if region is None else ("--region", region)
    with np.load(io.BytesIO(queried(asked, tmp_path / "fruit.npz", *words))) as archive:
        ours = dict(archive)
    with np.load(io.BytesIO(sent(package, asked, "npz", **part))) as archive:
        theirs = dict(archive)
    for name in theirs.keys() & ours.keys() - {"about", "colatitude", "azimuth"}:
        assert np.array_equal(ours[name][0], theirs[name]), name
    assert np.array_equal(ours["azimuth"], theirs["azimuth"])
    told, said = json.loads(str(ours["about"][0])), json.loads(str(theirs["about"]))
    assert told == said
    assert {"params", "table", "made", "units", "expected_error", "crossings", "lattice"} <= told.keys()
    assert ("poles" in ours) == bool(told["lattice"]["triangles"]["fans"]) == (region is None)
