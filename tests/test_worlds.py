"""A solver owns its world: no floor above names one, nor a parameter or a field that only one of them has."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from solver import registry

ROOT = Path(__file__).resolve().parents[1]
WORLDS = re.compile(rf"radii|stone|\brot\b|rot_|mould|{'|'.join(registry.names())}")
FILES = sorted(path for floor in ("store", "sweeps", "service") for path in (ROOT / floor).rglob("*.py"))


def named(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield what code names: identifiers and strings of one word. Sentences, as in help texts, are for people."""
    for node in ast.walk(tree):
        for field in ("id", "attr", "arg", "name", "module"):
            if isinstance(found := getattr(node, field, None), str):
                yield getattr(node, "lineno", 0), found
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and not re.search(r"\s", node.value):
            yield node.lineno, node.value


def examples(tree: ast.AST) -> set[int]:
    """The lines of examples for a schema."""
    return {node.value.lineno for node in ast.walk(tree) if isinstance(node, ast.keyword) and node.arg == "examples"}


def test_there_is_something_to_look_at() -> None:
    assert len(FILES) > 100
    tree = ast.parse('def radii(): return {"stone": x.mould}\n"the growth of a fruit"')
    assert {word for _, word in named(tree) if WORLDS.search(word)} == {"radii", "stone", "mould"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_floor_above_names_a_solver(path: Path) -> None:
    tree = ast.parse(path.read_text())
    found = [(line, word) for line, word in named(tree) if WORLDS.search(word) and line not in examples(tree)]
    assert not found


def test_the_page_names_no_solver() -> None:
    sources = sorted((ROOT / "service" / "viewer" / "src").glob("*.ts"))
    assert sources
    assert not [path.name for path in sources if WORLDS.search(path.read_text())]
