"""Commands that the examples' comments show are ones that `wizen` knows, option by option."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from service.cli import app
from store import starter
from store.manifest import read_manifest

from ._blocks import ROOT

_COMMAND = re.compile(r"^#[ ]+(wizen (?!\.\.\.).*?)(?:[ ]+#.*)?$", re.MULTILINE)


def _shown() -> list[tuple[str, str]]:
    """Return every command in a comment, with the name of its example or of its table in the package."""
    texts = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in (ROOT / "examples").rglob("*.toml")}
    tables = starter.ROOT / "tables"
    texts |= {name.name: read_manifest(tables, name.name).plan or "" for name in tables.iterdir()}
    return [(name, command) for name, text in sorted(texts.items()) for command in _COMMAND.findall(text)]


@pytest.mark.parametrize(("name", "command"), _shown(), ids=lambda text: Path(text).name[:60])
def test_an_examples_command_is_one_that_is_known(name: str, command: str) -> None:
    words = shlex.split(command)[1:]
    known: Any = typer.main.get_command(app)
    while groups := getattr(known, "commands", None):
        word = words.pop(0)
        assert word in groups, f"{name}: {command}"
        known = groups[word]
    known.make_parser(known.context_class(known)).parse_args(words)
