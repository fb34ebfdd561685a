"""What help texts and refusals tell people to type works, and no word of theirs is lost on the way."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from _command import wizen
from rich.markup import render
from typer.main import get_command

from service.cli import app
from solver import registry
from solver.contract import Need
from sweeps import outputs

#: The tags that help texts are set with.
_TAGS = ("[bold]", "[/bold]")


def helps(command: Any = None, name: str = "wizen") -> Iterator[tuple[str, str]]:
    """Yield the help texts of all commands and their options."""
    command = command or get_command(app)
    yield name, command.help or ""
    for option in command.params:
        yield f"{name} {option.name}", getattr(option, "help", None) or ""
    for own, below in getattr(command, "commands", {}).items():
        yield from helps(below, f"{name} {own}")


def test_no_unit_in_brackets_is_taken_for_a_tag() -> None:
    texts = dict(helps())
    assert len(texts) > 100
    bracketed = 0
    for name, text in texts.items():
        said = [word.replace("\\[", "[") for word in re.findall(r"\\?\[[^\[\]]*\]", text) if word not in _TAGS]
        bracketed += len(said)
        assert all(word in render(text).plain for word in said), name
    assert bracketed > 2


def test_the_tolerance_that_help_names_is_one_that_was_measured() -> None:
    text = dict(helps())["wizen solve tolerance"]
    named = re.search(r"e\.g\. ([\d.]+\d)", text)
    assert named is not None
    solver = registry.get("dehydration")
    need = solver.settle(Need(tolerance=float(named[1])), None, (solver.parse({}),))
    assert need.quality in ("preview", "default", "fine")


def test_the_help_of_query_names_every_kind_of_file() -> None:
    text = dict(helps())["wizen query"]
    assert all(suffix in text for suffix in outputs.suffixes(False))


@pytest.mark.parametrize("stage", ["0.9", "-0.4"])
def test_a_stage_that_no_run_has_is_told_of_those_that_tables_have(tmp_path: Path, stage: str) -> None:
    out = tmp_path / "map.png"
    refused = wizen("map", "--out", out, f"--stage={stage}", "--pixels", 32)
    assert refused.exit_code == 2
    held = re.search(r"holds (\S+) to (\S+)\.", " ".join(refused.stderr.split()))
    assert held is not None
    for end in held.groups():
        assert wizen("map", "--out", out, f"--stage={end}", "--pixels", 32).exit_code == 0


@pytest.mark.parametrize(("suffix", "instead"), [(".obj", ".obj"), (".wzp", ".glb")])
def test_a_run_on_its_own_mesh_is_told_of_an_export_that_there_is(tmp_path: Path, suffix: str, instead: str) -> None:
    asked = ("solve", "growth", "--set", "step=0.2", "--stages", "0.1", "--quality", "preview")
    refused = wizen(*asked, "--out", tmp_path / f"sheet{suffix}")
    assert refused.exit_code == 2
    assert f"wizen export FILE.h5 --out FILE{instead}." in " ".join(refused.stderr.split())
    assert wizen(*asked, "--out", tmp_path / "sheet.h5").exit_code == 0
    assert wizen("export", tmp_path / "sheet.h5", "--out", tmp_path / f"sheet{instead}").exit_code == 0
