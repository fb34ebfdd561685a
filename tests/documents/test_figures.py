"""Figures in documents are those of the records, and say with which version they were measured."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
from pathlib import Path

import pytest

from benchmarks import documents, figures
from solver import registry

_MARKED = re.compile(r"<!-- (?:figures|measured): .*?<!-- end -->", re.DOTALL)
#: A table with one of these in its head is a measured one.
_MEASURED = re.compile(r"CPU s|seconds|\bms\b|\bns\b|error|requests/s")


@pytest.mark.parametrize("path", documents.DOCUMENTS, ids=lambda path: path.name)
def test_figures_are_those_of_the_records(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    if documents.rendered(text) != text:
        how = dict(documents.stale())[path]
        pytest.fail(
            f"{path.name} differs from the records in benchmarks/results, or a solver's version has moved on. Run the "
            f"benchmarks that changed, then `make docs`, which says of figures left behind that they are:\n{how}",
            pytrace=False,
        )


@pytest.mark.parametrize("path", documents.DOCUMENTS, ids=lambda path: path.name)
def test_no_measured_table_is_typed_by_hand(path: Path) -> None:
    bare = _MARKED.sub("", path.read_text(encoding="utf-8"))
    heads = re.findall(r"^(\|.*\|)\n\|[-|: ]+\|$", bare, re.MULTILINE)
    assert not [head for head in heads if _MEASURED.search(head)]


@pytest.mark.parametrize("name", figures.names())
def test_records_say_what_made_them(name: str) -> None:
    record = figures.load(name)
    assert record["name"] == name
    assert record["command"]
    assert not re.search(r"(^|\s)/", record["command"])  # where one machine keeps things says nothing to others
    assert re.fullmatch(r"[0-9a-f]{7,40}\+?", record["commit"])
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", record["date"])
    assert ("solver" in record) == ("version" in record)
    if record["source"] == "text":  # taken over: rows, but no runs, and nobody knows on which machine
        assert record["table"]["rows"]
        assert not record["runs"]
    else:
        assert record["source"] == "run"
        assert record["runs"]
        assert record["machine"]["cpu"]


def _named(path: Path) -> list[str]:
    return re.findall(r"<!-- figures: (\S+)", path.read_text(encoding="utf-8"))


def test_every_digit_counts() -> None:
    """Whatever digit is changed between markers, the rendering brings it back."""
    text = (figures.ROOT / "docs" / "dehydration.md").read_text(encoding="utf-8")
    blocks = [block[0] for block in _MARKED.finditer(text) if block[0].startswith("<!-- figures")]
    assert blocks
    for block in blocks:
        right = documents.rendered(block)  # blocks know nothing of each other
        digits = [at.start() for at in re.finditer(r"\d", block) if "\n" in block[: at.start()]]
        for at in digits[:: max(len(digits) // 5, 1)]:
            wrong = block[:at] + str((int(block[at]) + 1) % 10) + block[at + 1 :]
            assert documents.rendered(wrong) == right != wrong


def test_a_version_that_moved_on_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    solver = registry.get("decay")
    kept = registry.get
    text = f"<!-- measured: decay {solver.version} -->\nOne takes 2 s.\n<!-- end -->"
    assert documents.rendered(text) == text
    later = dataclasses.replace(solver, version="99")
    monkeypatch.setattr(registry, "get", lambda name: later if name == "decay" else kept(name))
    said = f"\n*Measured with version {solver.version} of `decay`; it is 99 now.*\n"
    moved = documents.rendered(text)
    assert said in moved
    assert documents.rendered(moved) == moved
    named = [path for path in documents.DOCUMENTS if any(name.startswith("decay-") for name in _named(path))]
    assert named
    assert all(path in dict(documents.stale()) for path in named)
    monkeypatch.setattr(registry, "get", kept)
    assert documents.rendered(moved) == text  # and unsaid once it is measured anew


def test_all_seeds_of_a_table_are_in_it() -> None:
    """Every run of the version stands in it, as it is in the mean: those that did not converge would, too."""
    table = documents.table(figures.load("dehydration-buckled"), "whole")
    record = figures.load("dehydration-buckled")
    runs = [run for run in record["runs"] if not run["mirrors"] and run["version"] == record["version"]]
    shown = re.findall(r"^\| ([\d.]+ \| \w+, \d+) \|", table, re.MULTILINE)
    assert sorted(shown) == sorted(f"{run['gamma']:g} | {run['quality']}, {run['seed']}" for run in runs)
    assert len(runs) >= 6


def test_a_busy_machine_is_said() -> None:
    """Seconds that were taken beside other work are marked, and the mark goes when they are taken again."""
    assert documents.busy({"load": 9.2, "cores": 2}) == (
        "Run beside other work (load 9 on 2 cores): compare seconds within the table only."
    )
    assert documents.busy({"load": 1.9, "cores": 2}) == documents.busy({"cores": 2}) == documents.busy({}) == ""


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of a document and of all records, which the check then looks at in place of the real ones."""
    path = tmp_path / "docs" / "decay.md"
    path.parent.mkdir()
    text = documents.rendered((figures.ROOT / "docs" / "decay.md").read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    monkeypatch.setattr(figures, "RESULTS", Path(shutil.copytree(figures.RESULTS, tmp_path / "results")))
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    monkeypatch.setattr(documents, "DOCUMENTS", (path,))
    monkeypatch.setattr("sys.argv", ["documents", "--check"])
    return path


def test_the_check_fails_on_a_changed_digit(
    copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = copy.read_text(encoding="utf-8")
    assert documents.main() == 0
    wrong = re.sub(r"(?<=\| default \| 96 \| 92 162 \| )\d", lambda at: str((int(at[0]) + 1) % 10), text)
    assert wrong != text
    copy.write_text(wrong, encoding="utf-8")
    assert documents.main() == 1
    assert "decay.md" in capsys.readouterr().out
    assert copy.read_text(encoding="utf-8") == wrong  # looked at, not mended
    monkeypatch.setattr("sys.argv", ["documents"])
    assert documents.main() == 0
    assert copy.read_text(encoding="utf-8") == text


def test_the_check_fails_on_a_record_of_an_old_version(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Both ways: a record that stayed behind, and a document that does not say so."""
    path = figures.RESULTS / "decay-published.json"
    record = json.loads(path.read_text(encoding="utf-8"))
    assert documents.main() == 0
    path.write_text(json.dumps(record | {"version": "0"}), encoding="utf-8")
    assert documents.main() == 1
    assert "Measured with version 0 of `decay`" in capsys.readouterr().out
