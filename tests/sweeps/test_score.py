from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli import app
from store import methods, starter
from store.lookup import ShapeTable
from store.store import Store
from sweeps import score
from sweeps.errors import InvalidOption


def test_samples_predicted_from_each_other(tmp_path: Path) -> None:
    picture = tmp_path / "score.png"
    words = ["table", "score", "--methods", "idw,linear+LL+env", "--picture", str(picture), "--json"]
    done = CliRunner().invoke(app, words, env={"WIZEN_STORE": str(starter.ROOT)})
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert not document["held_out"]
    assert len(document["cases"]) == 6
    assert document["default"] == methods.DEFAULT
    late = {row["method"]: row for row in document["rows"] if row["stage"] == 0.2}
    # the paper's weights flatten a cold table, the corrected ones do not
    assert late["idw"]["rgh"] < 0.8
    assert 0.9 < late["linear+LL+env"]["rgh"] < 1.1
    assert late["linear+LL+env"]["W1"] < late["idw"]["W1"] / 2
    assert all(0 < row["correlation"] < 0.8 for row in document["neighbour_correlation"])
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_the_table_for_people() -> None:
    done = CliRunner().invoke(app, ["table", "score", "--store", str(starter.ROOT), "--methods", "nearest"])
    assert done.exit_code == 0, done.output
    assert "rgh" in done.stdout
    assert "correlation of neighbours" in done.stdout


def test_what_cannot_be_scored(tmp_path: Path) -> None:
    store = Store.open(shutil.copytree(starter.ROOT, tmp_path / "store"))
    table = ShapeTable.open(store)
    empty = Store.open(tmp_path / "empty", create=True)
    with pytest.raises(InvalidOption, match="no finished run"):
        score.cases(store, table, empty.root)
    wrong = CliRunner().invoke(app, ["table", "score", "--store", str(store.root), "--methods", "best"])
    assert wrong.exit_code == 2
    assert "best" in wrong.stderr
    wrong = CliRunner().invoke(app, ["table", "score", "--store", str(store.root), "--picture", "score.jpg"])
    assert wrong.exit_code == 2
