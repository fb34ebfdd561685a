"""Results of jobs say what answers of tables say; what means nothing for a format is refused."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest

from service.jobs import results
from solver import registry
from solver.contract import Need, Start
from solver.dehydration import SOLVER
from solver.lattice import lattice
from store.ledger.jobs import JobSpec
from store.lookup import ShapeTable
from store.store import Store

from ..store.conftest import answer, fill
from ._asking import checked
from ._gltf import parsed
from .conftest import SHAPE, build, client_of

ASKED: dict[str, Any] = {"te": 0.04, "gamma": 10.0, "mirrors": "xyz", "seed": 3}


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Store:
    store = Store.open(tmp_path_factory.mktemp("said") / "store", create=True)
    fruit = {name: SOLVER.presets["raisin"][name] for name in ("radii", "stone")}
    build(store, "raisin", keys=fill(store, te=[0.01, 0.02], gamma=[10.0], **fruit))
    return store


@pytest.fixture(scope="module")
def client(house: Store) -> Iterator[httpx.Client]:
    with client_of(house.root, jobs_workers=0) as client:
        yield client


def done(store: Store, params: dict[str, Any], preset: str | None = None, **need: Any) -> str:
    """Note a run as done, and return its result's address."""
    values = SOLVER.parse(params, preset)
    wanted = Need(stages=(0.1, 0.2), fields=("displacement", "position"), resolution=16, **need)
    settled = SOLVER.settle(wanted if not need else wanted.model_copy(update={"stages": (0.2,)}))
    spec = JobSpec.of(SOLVER, values, settled)
    if store.has(spec.key):
        return f"/v1/jobs/{spec.key}/result"
    run = answer(values, settled)  # type: ignore[arg-type]
    fresh = SOLVER.fresh(values.model_dump(mode="json"))
    assert fresh is not None
    if "start" in need:
        run.attrs["path"] = "relaxed"
    run["position"] = run["displacement"] + fresh.points(*lattice(16)).astype("f4")
    store.ledger.want([spec], "test")
    store.ledger.done(store.ledger.claim("tester", 60, [spec.key]), store.put(spec.key, run), 1.0)
    return f"/v1/jobs/{spec.key}/result"


def test_a_run_says_how_it_was_done(client: httpx.Client, house: Store) -> None:
    result = done(house, ASKED)
    page = client.get(result, params={"format": "json"}).json()
    document, _ = parsed(client.get(result, params={"format": "glb"}).content)
    with np.load(io.BytesIO(client.get(result, params={"format": "npz"}).content)) as archive:
        about = json.loads(str(archive["about"]))
    for said in (page, document["nodes"][0]["extras"], about):
        assert said["made"] == {"mirrors": "xyz", "seed": 3}
        assert (said["params"]["seed"], said["params"]["imperfection"], said["params"]["te"]) == (3, 0.001, 0.04)
        assert (said["tier"], said["table"], said["method"]) == ("run", "", "")


def test_what_is_relaxed_says_from_where(client: httpx.Client, house: Store) -> None:
    start = Start(table="stone-radius", digest="d" * 64, method="lean+LL+env", lattice=64)
    page = client.get(done(house, ASKED, start=start), params={"format": "json"}).json()
    assert (page["table"], page["digest"], page["method"]) == ("stone-radius", "d" * 64, "lean+LL+env")
    # nobody can look up any more how near a run lies
    assert (page["tier"], page["exact"], page["nearest"]) == ("relaxed", False, None)


def test_what_is_relaxed_says_what_its_table_says_of_it(client: httpx.Client, house: Store) -> None:
    table = ShapeTable.open(house, "raisin", surfaces=registry.surface)
    at = {"te": 0.014}
    own = done(house, table.at_parameters(at), start=Start(table="raisin", digest=table.digest, method="idw"))
    looked = table.at(at, 0.2, resolution=16, method="idw")
    for said in (
        client.get(own, params={"format": "json"}).json(),
        parsed(client.get(own, params={"format": "glb"}).content)[0]["nodes"][0]["extras"],
    ):
        assert (said["tier"], said["exact"], said["nearest"]) == ("relaxed", False, looked.nearest)
        assert (said["inside"], said["held"], said["expected_error"]) == (looked.inside, looked.held, None)
    assert looked.nearest > 0
    page = client.get(own, params={"format": "json"}).json()
    assert page["weights"] == dict(looked.weights)


def test_what_is_made_of_a_result_is_asked_for_again_after_an_upgrade(
    client: httpx.Client, house: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = done(house, ASKED)

    def tag(name: str) -> str:
        return client.get(result, params={"format": name}).headers["etag"]

    before = {name: tag(name) for name in ("netcdf", "json", "obj", "ply")}
    monkeypatch.setattr(results, "__version__", "99")
    assert [name for name, old in before.items() if tag(name) == old] == ["netcdf"]
    held = {"If-None-Match": ", ".join(before.values())}
    assert client.get(result, params={"format": "obj"}, headers=held).status_code == 200


def test_numbers_of_a_run_have_their_units(client: httpx.Client, house: Store) -> None:
    result = done(house, ASKED)
    page = client.get(result, params={"format": "json"}).json()["descriptors"]
    named = ",".join(page)
    fields = client.get(result.replace("result", "fields"), params={"names": named}).json()["fields"]
    assert page["seconds"]["units"] == "s"
    assert {name: one["units"] for name, one in page.items()} == {name: one["units"] for name, one in fields.items()}


def test_the_size_of_a_fruit_stands_in_its_glb(client: httpx.Client, house: Store) -> None:
    looked = client.get(SHAPE, params={"preset": "raisin", "s": 0.2, "format": "glb", "resolution": 16})
    run = client.get(done(house, {}, "raisin"), params={"format": "glb"})
    for found in (looked, run):
        assert parsed(found.content)[0]["nodes"][0]["extras"]["units"]["metres"] == SOLVER.sizes["raisin"]
    sphere = parsed(client.get(done(house, ASKED), params={"format": "glb"}).content)[0]
    assert "metres" not in sphere["nodes"][0]["extras"]["units"]
    body = {"solver": "dehydration", "preset": "raisin", "points": [{"s": 0.2}], "format": "glb", "resolution": 16}
    batch = client.post("/v1/shapes:batch", json=body).content
    assert b'"metres":0.0085' in batch


@pytest.mark.parametrize(
    ("said", "name", "words"),
    [
        ({"stage": 0.1}, "stage", "json"),
        ({"fields": "volume"}, "fields", "json"),
        ({"format": "glb", "fields": "volume"}, "fields", "json"),
        ({"format": "glb", "fps": 24}, "fps", "animation"),
        ({"format": "glb", "map": "rot"}, "map", "png"),
        ({"format": "glb", "size": 64}, "size", "png"),
        ({"format": "obj", "low": 0}, "low", "png"),
        ({"format": "npz", "scale": 2}, "scale", "glb"),
        ({"format": "points", "scale": 2}, "scale", "glb"),
        ({"format": "json", "scale": 2}, "scale", "glb"),
        ({"format": "usdc", "size": 64}, "size", "png"),
    ],
)
def test_what_means_nothing_for_a_format_is_refused(
    client: httpx.Client, house: Store, said: dict[str, Any], name: str, words: str
) -> None:
    problem = checked(client.get(done(house, ASKED), params=said), 422, "invalid-query")
    (wrong,) = problem["errors"]
    assert wrong["name"] == name
    assert f"Leave {name} out" in wrong["advice"]
    assert words in wrong["advice"]


def test_a_scaled_mesh_is_scaled(client: httpx.Client, house: Store) -> None:
    result = done(house, ASKED)
    plain, double = (client.get(result, params={"format": "obj", **more}).text for more in ({}, {"scale": 2}))
    first = [[float(x) for x in re.findall(r"^v (\S+) (\S+) (\S+)", text, re.M)[0]] for text in (plain, double)]
    assert np.allclose(2 * np.array(first[0]), first[1], rtol=1e-5)


def test_files_are_called_by_their_stage(client: httpx.Client, house: Store) -> None:
    result = done(house, ASKED)
    names = {}
    for said in ({"format": "glb", "stage": 0.1}, {"format": "glb"}, {"format": "usda"}, {"format": "ply"}):
        if said["format"] == "usda":
            pytest.importorskip("pxr")
        header = client.get(result, params=said).headers["content-disposition"]
        names[tuple(said.values())] = header.rpartition("-")[2].strip('"')
    assert names[("glb", 0.1)] == "s0.1.glb"
    assert names[("glb",)] == "s0.2.glb"
    assert names[("ply",)] == "s0.2.ply"
    assert re.fullmatch(r"[0-9a-f]{12}\.usda", names[("usda",)])


def test_a_field_that_is_not_there_is_told_by_its_own_parameter(client: httpx.Client, house: Store) -> None:
    result = done(house, ASKED)
    problem = checked(client.get(result.replace("result", "fields"), params={"names": "foo"}), 422, "invalid-query")
    assert problem["errors"][0]["name"] == "names"
    problem = checked(client.get(result, params={"format": "json", "fields": "foo"}), 422, "invalid-query")
    assert problem["errors"][0]["name"] == "fields"
