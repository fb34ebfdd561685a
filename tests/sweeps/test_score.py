from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from service.cli import app
from solver import registry
from solver.contract import Need, Params, Unstable, finish
from solver.dehydration import SOLVER
from solver.fruit import azimuths, colatitudes
from store import starter
from store.blending import methods
from store.lookup import ShapeTable
from store.store import Store
from sweeps.errors import InvalidOption
from sweeps.planning import plan
from sweeps.refining import balance, score


def test_samples_predicted_from_each_other(tmp_path: Path) -> None:
    picture = tmp_path / "score.png"
    words = ["table", "score", "--methods", "idw,linear+LL+env", "--picture", str(picture), "--json"]
    done = CliRunner().invoke(app, words, env={"WIZEN_STORE": str(starter.ROOT)})
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert not document["held_out"]
    assert len(document["cases"]) == 21
    assert document["default"] == methods.DEFAULT
    late = {row["method"]: row for row in document["rows"] if row["stage"] == 0.2}
    # the paper's weights flatten what lies between samples, though these lie close, the corrected ones do not
    assert late["idw"]["rgh"] < 0.9
    assert 0.9 < late["linear+LL+env"]["rgh"] < 1.1
    assert late["linear+LL+env"]["W1"] < late["idw"]["W1"] / 2
    likeness = [row["correlation"] for row in document["neighbour_correlation"]]
    # all start from one pattern, and go ever further from it
    assert 0.95 < likeness[0] <= 1
    assert likeness == sorted(likeness, reverse=True)
    assert picture.read_bytes()[:4] == b"\x89PNG"


def held_out(root: Path, table: ShapeTable) -> Store:
    """Return runs between the samples whose shape is by construction what `linear` says, one more with another seed."""
    store = Store.open(root, create=True)
    values, n = {"te": 0.0325, "gamma": 26.0}, 64
    u = np.stack([table.at(values, s, fields=("displacement",), method="linear").displacement for s in table.stages])
    for seed in (0, 1):
        params = SOLVER.parse({**table.at_parameters(values), "seed": seed})
        need = SOLVER.settle(Need(fields=("displacement",), stages=table.stages, resolution=n))
        job = plan.job(SOLVER, params, need)
        turned = np.roll(u, 64 * seed, axis=2) * ([-1, 1, -1] if seed else [1, 1, 1])  # by half a turn about y
        data = {"displacement": (("stage", "colatitude", "azimuth", "component"), turned.astype(np.float32))}
        coords = {"stage": list(table.stages), "colatitude": colatitudes(n), "azimuth": azimuths(n)}
        result = finish(xr.Dataset(data, {**coords, "component": ["x", "y", "z"]}), SOLVER, params, need)
        store.ledger.want([job])
        store.ledger.done(store.ledger.claim("tester", 60, [job.key]), store.put(job.key, result), 1.0)
    return store


def test_held_out_runs_and_the_floor_of_another_seed(tmp_path: Path) -> None:
    table = ShapeTable.open(starter.ROOT, surfaces=registry.surface)
    runs = held_out(tmp_path / "held", table)
    found, pairs = score.cases(Store.open(starter.ROOT), table, runs.root)
    assert [case.label for case in found] == ["te = 0.0325, gamma = 26"]
    report = score.score(table, found, pairs, ("linear", "nearest"))
    assert report.seeds == 1
    rows = {(row.method, row.stage): row.measures for row in report.rows}
    np.testing.assert_allclose(rows["linear", 0.2], (1, 0, 0, 0, 0, 0, 1), atol=2e-2)
    assert rows["nearest", 0.2].ang > 10
    # the other seed is the same fruit turned: as rough, as fine, as steep, and elsewhere
    floor = rows["seed", 0.2]
    np.testing.assert_allclose(floor[:4], (1, 0, 0, 0), atol=1e-2)
    assert floor.corr < 0.5


def test_the_floor_of_another_seed_is_taken_both_ways_round(tmp_path: Path) -> None:
    """Whichever of two seeds is named first: one a fifth rougher is 1.2 over the other, and the other 1 / 1.2."""
    table = ShapeTable.open(starter.ROOT, surfaces=registry.surface)
    (case,) = score.cases(Store.open(starter.ROOT), table, held_out(tmp_path / "held", table).root)[0]
    rougher = dataclasses.replace(case, truth=lambda s: 1.2 * case.truth(s))
    floors = [score.score(table, (), [pair], ()).rows for pair in ((case, rougher), (rougher, case))]
    assert [row.method for row in floors[0]] == ["seed"] * len(table.stages)
    for one, other in zip(*floors, strict=True):
        np.testing.assert_allclose(one.measures, other.measures, rtol=1e-12, atol=1e-12)
        assert one.measures.rgh > 1.005  # of r and 1 / r the mean is above 1


def test_the_table_for_people() -> None:
    done = CliRunner().invoke(app, ["table", "score", "--store", str(starter.ROOT), "--methods", "nearest"])
    assert done.exit_code == 0, done.output
    assert "rgh" in done.stdout
    assert "correlation of neighbours" in done.stdout


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--stage", "0.3"], "--stage is the picture's"),
        (["--picture", "{tmp}/none/score.png"], "there is no directory"),
        (["--picture", "{tmp}/score.jpg"], "it is a picture"),
    ],
)
def test_a_picture_that_cannot_be_is_refused_before_any_work(tmp_path: Path, words: list[str], why: str) -> None:
    said = [word.format(tmp=tmp_path) for word in words]
    refused = CliRunner().invoke(app, ["table", "score", "--name", "nonsense", *said])
    assert refused.exit_code == 2
    assert why in " ".join(refused.stderr.split())
    assert not (tmp_path / "none").exists()


def test_what_cannot_be_scored(tmp_path: Path) -> None:
    store = Store.open(shutil.copytree(starter.ROOT, tmp_path / "store"))
    table = ShapeTable.open(store, surfaces=registry.surface)
    empty = Store.open(tmp_path / "empty", create=True)
    with pytest.raises(InvalidOption, match="no finished run"):
        score.cases(store, table, empty.root)
    wrong = CliRunner().invoke(app, ["table", "score", "--store", str(store.root), "--methods", "best"])
    assert wrong.exit_code == 2
    assert "best" in wrong.stderr
    wrong = CliRunner().invoke(app, ["table", "score", "--store", str(store.root), "--picture", "score.jpg"])
    assert wrong.exit_code == 2


def test_what_is_looked_up_keeps_what_its_runs_begin_with_where_that_is_at_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its pattern is a run of its own; bumps follow from the seed."""
    asked: list[bool] = []

    def relax(params: Params, *_: object) -> xr.Dataset:
        asked.append(params.model_dump()["pattern"] is not None)
        raise Unstable("seen enough.")

    solver, empty = dataclasses.replace(SOLVER, relax=relax), Store.open(tmp_path, create=True)
    begun, cold = (
        ShapeTable.open(starter.ROOT, name, surfaces=registry.surface) for name in ("stone-radius", "sphere-01")
    )
    assert balance.at_hand(cold, empty)
    assert balance.at_hand(begun, empty)
    monkeypatch.setattr(starter, "ROOT", tmp_path)
    assert not balance.at_hand(begun, empty)
    empty.put(begun.info.template["pattern"]["key"], xr.Dataset({"displacement": ("stage", [0.0])}))
    assert balance.at_hand(begun, empty)
    for store in (empty, None):
        assert balance.distance(solver, begun, begun.sample(0), 0.1, "nearest", store) is None
    assert asked == [True, False]
