"""What pictures of single commands are called: by preset and by what was set, so that two can be told apart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from _command import wizen
from conftest import Solves

from sweeps.commands.terminal.options import shown
from sweeps.pictures import sheet


@pytest.fixture
def titles(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, list[str]]]:
    """Title and labels of the stages of what is drawn."""
    found: list[tuple[str, list[str]]] = []

    def drawn(rows: Any, *, title: str, column_labels: list[str], **_: Any) -> bytes:
        found.append((title, column_labels))
        return b"\x89PNG"

    monkeypatch.setattr(sheet, "sheet", drawn)
    return found


def test_a_run_is_called_by_its_preset_and_what_was_set(
    shrinking: Solves, tmp_path: Path, titles: list[tuple[str, list[str]]]
) -> None:
    params = tmp_path / "thin.toml"
    params.write_text("te = 0.02\n")
    run = ("solve", "shrinking", "--stages", "0.1,0.2", "--out", tmp_path / "run.png")
    for words in (
        ("--preset", "sphere", "--set", "te=0.03", "--set", "gamma = 20"),
        ("--set", "te=0.03", "--seed", 7),
        ("--params", params, "--set", "te=0.03"),
        ("--preset", "sphere"),
        (),
    ):
        assert wizen(*run, *words).exit_code == 0
    plain = titles[-1][0]
    assert [title for title, _ in titles] == [
        "sphere: te = 0.03, gamma = 20",
        "shrinking: te = 0.03, seed = 7",
        "thin: te = 0.03",
        f"{plain}: sphere",
        plain,
    ]
    assert all(labels == ["s = 0.1", "s = 0.2"] for _, labels in titles)


def test_a_shape_is_called_by_its_preset_or_its_table(tmp_path: Path, titles: list[tuple[str, list[str]]]) -> None:
    for words in (
        ("--preset", "jujube1"),
        ("--preset", "jujube2"),
        ("--preset", "wolfberry"),
        ("--name", "wolfberry", "--set", "te=0.005", "--set", "gamma=10"),
        ("--set", "te=0.034", "--set", "gamma=22"),
    ):
        asked = ("query", *words, "--stages", "0.2", "--resolution", 16, "--out", tmp_path / "shape.png")
        assert wizen(*asked).exit_code == 0
    said = [title.partition(":")[0] for title, _ in titles]
    assert said == ["jujube1", "jujube2", "wolfberry", "wolfberry", "default"]
    assert titles[-1][0].startswith("default: ")
    assert {"te = 0.034", "gamma = 22"} <= set(titles[-1][0].removeprefix("default: ").split(", "))


def test_what_hours_come_to_is_said_hour_by_hour() -> None:
    """Stages are in their own order, and what is as dry after other hours is one of them."""
    said = wizen("solve", "dehydration", "--preset", "raisin", "--hours", "48,24", "--max-seconds", "0").stderr
    assert said.startswith("s = 0.168847 after 48 h, 0.091224 after 24 h\n")


def test_long_values_are_left_out_of_titles() -> None:
    assert shown(["te=0.04", "mesh=@fruit.obj", f"wounds=[{'1, ' * 20}]"]) == "te = 0.04, mesh = @fruit.obj, wounds = …"
