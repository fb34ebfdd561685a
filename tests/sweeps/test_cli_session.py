"""`wizen session`: what is wrong is said before work, with the number of the message, and as bad input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from _command import wizen

BEGIN = {"do": "open", "params": {"shape": "square", "tools": [], "step": 0.05}}
DAB = {"do": "brush", "at": [0, 0, 0]}


def messages(folder: Path, *lines: Any) -> Path:
    file = folder / "acts.jsonl"
    file.write_text("\n".join(json.dumps(line) for line in lines))
    return file


@pytest.mark.parametrize("preset", [5, ["leaf"], {}])
def test_a_preset_that_is_no_name_is_refused(tmp_path: Path, preset: Any) -> None:
    done = wizen("session", "growth", messages(tmp_path, {"do": "open", "preset": preset}))
    assert done.exit_code == 2
    assert "names no preset" in done.stderr
    assert "Known: bed, cabbage" in done.stderr
    assert "defect" not in done.output


@pytest.mark.parametrize(
    ("opening", "said"),
    [
        ({"prams": {}}, "open does not take 'prams' here. It takes params, preset, quality."),
        ({"session": "s_1", "key": "k"}, "open does not take 'session' here."),
        ({"quality": []}, "there is no quality []. Take preview, default, fine."),
        ({"quality": ""}, "there is no quality ''."),
        ({"quality": None}, "there is no quality None."),
    ],
)
def test_what_open_does_not_take_is_refused_as_over_a_connection(tmp_path: Path, opening: Any, said: str) -> None:
    """A misspelt name began with a sphere."""
    done = wizen("session", "growth", messages(tmp_path, {"do": "open", **opening}))
    assert done.exit_code == 2
    assert said in " ".join(done.stderr.split())
    kept = {"do": "open", "token": "t", "fields": ["elastic_strain"], "id": 1, **BEGIN}
    assert wizen("session", "growth", messages(tmp_path, kept, DAB)).exit_code == 0


def test_where_it_is_to_be_saved_is_looked_at_before_work(tmp_path: Path) -> None:
    acts = messages(tmp_path, BEGIN, DAB)
    done = wizen("session", "growth", acts, "--save", tmp_path / "nowhere" / "x.toml")
    assert done.exit_code == 2
    assert "there is no directory" in done.stderr
    assert not done.stdout  # nothing was done
    done = wizen("session", "growth", acts, "--save", tmp_path)
    assert done.exit_code == 2
    assert "is a directory" in done.stderr


def test_the_saved_file_says_how_it_is_run_itself(tmp_path: Path) -> None:
    done = wizen("session", "growth", messages(tmp_path, BEGIN, DAB), "--save", tmp_path / "dab.toml")
    assert done.exit_code == 0, done.stderr
    said = (tmp_path / "dab.toml").read_text()
    assert "save this as dab.toml" in said
    assert "--params dab.toml" in said
    assert "session.toml" not in said + done.stderr


def test_a_message_that_is_wrong_is_bad_input_by_its_number(tmp_path: Path) -> None:
    done = wizen("session", "growth", messages(tmp_path, BEGIN, DAB, {**DAB, "radius": -1}))
    assert done.exit_code == 2
    assert "error: message 2: radius" in done.stderr


def test_a_step_that_fails_is_told_by_the_message_that_led_to_it(tmp_path: Path) -> None:
    much = {**DAB, "stretch": [10, 10], "radius": 100, "hold": 1000}
    done = wizen("session", "growth", messages(tmp_path, BEGIN, DAB, much, {"do": "play", "until": 1.5}))
    assert done.exit_code == 1  # it could not be known beforehand
    assert "error: message 3: at growth time" in done.stderr
    assert "message None" not in done.stderr
