"""What an answer says of its trust, which answers are refused for it, and the run that answers instead."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import xarray as xr

from service.shapes.live import LiveTables
from solver import registry
from solver.contract import Need
from solver.dehydration import SOLVER
from solver.fruit import lattice
from store import seal, tables
from store.blending import methods
from store.generations import generation
from store.ledger.queue import Queue
from store.lookup import ShapeTable
from store.starter import ROOT as STARTER
from store.store import Store
from store.surfaces.measures import Measures
from store.tokens import Tokens

from ..store.conftest import answer, fill
from ._asking import checked
from ._shapes import points
from .conftest import QUERY, SHAPE, build, client_of

POINT = {"te": 0.03, "gamma": 7.0}


def bearer(store: Store, scope: Any = "run") -> dict[str, str]:
    return {"Authorization": f"Bearer {Tokens(store.root).create(scope, [scope])[1]}"}


def ask(client: httpx.Client, headers: dict[str, str] | None = None, **change: Any) -> httpx.Response:
    return client.get(SHAPE, params={**QUERY, **change}, headers=headers)


def _file(answer: httpx.Response) -> io.BytesIO:
    assert answer.status_code == 200
    return io.BytesIO(answer.content)


@pytest.fixture
def queue_only(own: Store) -> Iterator[httpx.Client]:
    """A service that leaves its jobs in the queue."""
    with client_of(own.root, jobs_workers=0) as client:
        yield client


@pytest.mark.parametrize("method", ["idw", "nearest", "linear+LL"])
def test_a_method_is_the_lookups(client: httpx.Client, built: Path, method: str) -> None:
    expected = ShapeTable.open(built, surfaces=registry.surface).at(POINT, 0.25, resolution=16, method=method)
    about, found = points(ask(client, format="points", method=method).content)
    assert np.array_equal(found[: 16 * 32].reshape(16, 32, 3), expected.position)
    assert about["method"] == method
    assert about["expected_error"] is None
    assert sum(about["weights"].values()) == pytest.approx(1)
    assert len(about["weights"]) == (1 if method == "nearest" else 4)


def test_a_method_is_one_however_it_is_spelt(client: httpx.Client) -> None:
    address = f"{SHAPE}?te=0.03&gamma=7&s=0.25&resolution=16&format=glb"
    spelt = ["", "&method=lean%2BLL%2Benv", "&method=lean+LL+env", "&method=lean%2Benv%2BLL"]
    tags = [client.get(address + method).headers["etag"] for method in spelt]
    assert len(set(tags)) == 1
    other = client.get(f"{address}&method=idw", headers={"If-None-Match": tags[0]})
    assert other.status_code == 200
    assert other.headers["etag"] != tags[0]


def test_every_format_says_what_error_to_expect(client: httpx.Client, built: Path) -> None:
    expected = ShapeTable.open(built, surfaces=registry.surface).at(POINT, 0.25, resolution=16)
    said = ask(client, format="json").json()
    assert said["expected_error"] == pytest.approx(expected.expected_error)
    assert set(said["expected_error"]) == set(Measures._fields)
    assert said["expected_error"]["rgh"] > 0
    assert (said["inside"], said["method"]) == (True, methods.DEFAULT)
    trusted = {name: said[name] for name in ("expected_error", "inside", "method", "nearest")}
    for text in (ask(client, format="glb").content, ask(client, format="points").content):
        begin = text.index(b'"expected_error"')
        assert json.loads(text[begin + 17 : text.index(b"}", begin) + 1]) == trusted["expected_error"]
    with np.load(_file(ask(client, format="npz"))) as archive:
        about = json.loads(str(archive["about"]))
    assert {name: about[name] for name in trusted} == trusted
    stored = ask(client, te=0.02, gamma=5, s=0.2).json()
    assert stored["expected_error"] == dict.fromkeys(Measures._fields, 0.0)


def test_a_coarse_lattice_is_said_to_leave_wrinkles_out(client: httpx.Client, built: Path) -> None:
    own = ShapeTable.open(built, surfaces=registry.surface).resolution
    coarse, fine = (ask(client, resolution=n).json()["held"] for n in (4, own))
    assert 0 < coarse < 0.9 < fine == 1.0


def test_outside_the_hull_is_said(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "store", create=True)
    for te, gamma in ((0.02, 5.0), (0.06, 5.0), (0.02, 20.0)):
        fill(store, te=[te], gamma=[gamma])
    build(store)
    with client_of(store.root) as client:
        assert ask(client, te=0.05, gamma=18).json()["inside"] is False
        assert ask(client, te=0.021, gamma=6).json()["inside"] is True


@pytest.mark.parametrize(
    ("change", "name", "words"),
    [
        ({"method": "ldw"}, "method", "did you mean 'idw'"),
        ({"method": ""}, "method", "Known: nearest, idw"),
        ({"method": "idw+LL+LL"}, "method", "Name it once"),
        ({"max_error": "little"}, "max_error", "Write it like 0.05"),
        ({"max_error": "-1"}, "max_error", "Write it like 0.05"),
        ({"max_error": "nan"}, "max_error", "Write it like 0.05"),
        ({"max_error": "1e999"}, "max_error", "Write it like 0.05"),
        ({"max_error": "rough:1"}, "max_error", "measures: rgh, dB, W1"),
        ({"max_error": "rgh:0.01,dB:3,rgh:9"}, "max_error", "each measure once"),
        ({"max_error": "0.01,rgh:9"}, "max_error", "each measure once"),
        ({"exact": "yes"}, "exact", "exact=run"),
        ({"max_eror": "1"}, "max_eror", "Did you mean 'max_error'"),
    ],
)
def test_wrong_words_are_named(client: httpx.Client, change: dict[str, str], name: str, words: str) -> None:
    problem = checked(ask(client, **change), 422, "invalid-query")
    (wrong,) = problem["errors"]
    assert wrong["name"] == name
    assert words in wrong["advice"]


def test_what_is_too_uncertain_is_refused_with_advice(client: httpx.Client) -> None:
    expected = ask(client).json()["expected_error"]
    for name in ("rgh", "dB"):
        enough, little = (f"{name}:{share * expected[name]:.6f}" for share in (1.1, 0.9))
        assert ask(client, max_error=enough).status_code == 200
        problem = checked(ask(client, max_error=little), 422, "too-uncertain")
        assert f"the expected error {name} is" in problem["detail"]
        assert "exact=run" in problem["advice"]
        # what is told can be typed
        told = re.search(rf"the expected error {name} is (\S+), above", problem["detail"])
        assert told is not None
        assert ask(client, max_error=f"{name}:{told[1]}").status_code == 200
    assert ask(client, max_error=f"{1.1 * expected['rgh']:.6f}").status_code == 200
    checked(ask(client, max_error="rgh:9,W1:0"), 422, "too-uncertain")
    # whoever has the shape from a question without a limit is refused all the same
    tag = {"If-None-Match": ask(client).headers["etag"]}
    checked(ask(client, tag, max_error="0"), 422, "too-uncertain")


def test_of_which_method_the_errors_are_known(client: httpx.Client) -> None:
    problem = checked(ask(client, method="idw", max_error="9"), 422, "too-uncertain")
    assert f"Take the method {methods.DEFAULT}" in problem["advice"]


def test_a_table_without_errors_is_to_be_rebuilt(tmp_path: Path) -> None:
    old = Store.open(shutil.copytree(STARTER, tmp_path / "old"))
    path = tables.path_of(old, tables.info(old))
    whole = xr.load_dataset(path, engine="h5netcdf")
    judged = [name for name in whole if str(name).startswith("left_out_")]
    assert judged
    whole.drop_vars(judged).to_netcdf(path, engine="h5netcdf", encoding={n: {"_FillValue": None} for n in whole.coords})
    seal.seal(path)
    with client_of(old.root) as client:
        assert client.get("/v1/tables/default").json()["methods"]["judged"] is None
        query = {"te": 0.035, "gamma": 20, "s": 0.22, "max_error": "0.5"}
        problem = checked(client.get(SHAPE, params=query), 422, "too-uncertain")
    assert "wizen table build" in problem["advice"]


def test_the_catalogue_says_how_to_ask(client: httpx.Client, built: Path, own: Store) -> None:
    said = client.get("/v1/tables/default").json()
    assert said["max_resolution"] == 512
    assert said["methods"] == {
        "default": methods.DEFAULT,
        "known": list(methods.OFFERED),
        "judged": methods.DEFAULT,
    }
    likeness = ShapeTable.open(built, surfaces=registry.surface).neighbour_correlation
    assert said["stage"]["neighbour_correlation"] == pytest.approx(
        [likeness[s] for s in said["stage"]["stored"]], rel=1e-4
    )
    # what cannot be read is not known, and the rest is still said
    table = tables.info(own)
    path = tables.path_of(own, table)
    path.write_bytes(path.read_bytes()[:100])
    assert LiveTables(own.root, 0, lambda: None).judged(table) == generation.Judged(None, None)
    with client_of(own.root, max_resolution=100) as other:
        said = other.get("/v1/tables/default").json()
        assert (said["max_resolution"], said["methods"]["judged"]) == (100, None)


@pytest.mark.parametrize(
    "change", [{"max_error": "0"}, {"te": 0.07}, {"te": 0.07, "gamma": 30.0}, {"rs1": 0.3}, {"s": 0.35}]
)
def test_what_is_refused_can_be_run(own: Store, queue_only: httpx.Client, change: dict[str, Any]) -> None:
    refused = checked(ask(queue_only, **change), 422, "too-uncertain" if "max_error" in change else "outside-table")
    assert "exact=run" in refused["advice"]
    sent = ask(queue_only, bearer(own), **change, exact="run", format="glb")
    assert (sent.status_code, sent.headers["cache-control"]) == (303, "no-store")
    job = queue_only.get(sent.headers["location"]).json()
    assert (job["state"], job["need"]["stages"], job["need"]["quality"]) == (
        "wanted",
        [change.get("s", 0.25)],
        "default",
    )
    asked = SOLVER.parse({**POINT, **{k: v for k, v in change.items() if k in SOLVER.params.axes}})
    assert job["params"] == asked.model_dump(mode="json")
    (waiting,), _ = Queue(own.ledger).page("wanted", 10, None)
    assert waiting.key == job["id"]
    # once it is done, the same question leads to the shape
    run = answer(asked, Need.model_validate(job["need"]))
    own.ledger.done(own.ledger.claim("tester", 60, [waiting.key]), own.put(waiting.key, run), 1.0)
    shape = queue_only.get(
        SHAPE,
        params={**QUERY, **change, "exact": "run", "format": "npz"},
        headers=bearer(own, "admin"),
        follow_redirects=True,
    )
    with np.load(_file(shape)) as archive:
        assert np.array_equal(archive["position"], run["displacement"][0] + asked.surface(*lattice(96)).astype("f4"))
        assert json.loads(str(archive["about"]))["exact"] is True


def test_who_may_run(own: Store, queue_only: httpx.Client) -> None:
    checked(ask(queue_only, te=0.07, exact="run"), 401, "unauthorized")
    checked(ask(queue_only, {"Authorization": "Basic abc"}, te=0.07, exact="run"), 401, "unauthorized")
    checked(ask(queue_only, bearer(own, "read"), te=0.07, exact="run"), 403, "forbidden")
    # nothing is run that the table can answer, and nothing that the solver cannot
    assert ask(queue_only, exact="run").status_code == 200
    runner = bearer(own)
    checked(ask(queue_only, runner, te=0.5, exact="run"), 422, "invalid-input")
    checked(ask(queue_only, runner, rs1=1.5, exact="run"), 422, "invalid-geometry")
    checked(ask(queue_only, runner, te="thick", exact="run"), 422, "invalid-query")
    assert Queue(own.ledger).page("wanted", 10, None)[0] == []
