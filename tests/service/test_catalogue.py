"""What there is: index, tables, solvers, health, and the OpenAPI page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest
from openapi_spec_validator import validate

from service.app import create_app
from service.settings import Settings
from solver import __version__, registry
from solver.dehydration import SOLVER
from store import tables
from store.store import Store

from ._asking import checked
from .conftest import client_of, served


def test_index_links_lead_somewhere(client: httpx.Client) -> None:
    index = client.get("/").json()
    for name in ("tables", "solvers", "health", "documentation", "schema"):
        assert client.get(index["links"][name]).status_code == 200
    assert set(index["formats"]) == {"glb", "obj", "npz", "json", "points"}


@pytest.mark.parametrize(
    ("address", "hint"),
    [
        ("/v1/maps?solver=dehydration", "Leave it out"),
        ("/v1/tables?limit=2", "Leave it out"),
        ("/v1/tables/default?verbose=1", "Leave it out"),
        ("/v1/solvers/dehydration?full=1", "Leave it out"),
        ("/v1/results?solvr=dehydration", "Did you mean 'solver'?"),
        ("/v1/jobs?sate=done", "Did you mean 'state'?"),
        ("/v1/solvers/dehydration/stages?hours=24&x=1", "Known: hours, preset, under"),
    ],
)
def test_a_parameter_that_an_address_does_not_know_is_refused(client: httpx.Client, address: str, hint: str) -> None:
    name = address.rpartition("&")[2].rpartition("?")[2].partition("=")[0]
    problem = checked(client.get(address), 422, "invalid-query")
    assert [wrong["name"] for wrong in problem["errors"]] == [name]
    assert hint in problem["errors"][0]["advice"]


def test_who_watches_may_ask_with_anything(client: httpx.Client) -> None:
    for address in ("/?utm=1", "/healthz?t=1"):
        assert client.get(address).status_code == 200


def test_tables(client: httpx.Client, built: Path) -> None:
    (listed,) = client.get("/v1/tables").json()["tables"]
    one = client.get("/v1/tables/default").json()
    assert one == listed
    assert one["digest"] == tables.info(Store.open(built)).digest
    assert one["axes"]["te"] | {"description": ""} == {
        "lowest": 0.02,
        "highest": 0.06,
        "units": "r1",
        "description": "",
    }
    assert one["fixed"]["rs1"] == 0.4
    assert one["stage"]["symbol"] == "s"
    assert one["stage"]["stored"] == [0.1, 0.2, 0.3]
    assert one["descriptors"]["roughness"]["units"] == "1"
    assert client.get("/v1/tables/none").status_code == 404
    assert client.get("/v1/tables/..%2F..").status_code == 404


def test_solvers(client: httpx.Client) -> None:
    assert "dehydration" in {s["name"] for s in client.get("/v1/solvers").json()["solvers"]}
    solver = client.get("/v1/solvers/dehydration").json()
    assert solver["axes"]["gamma"]["lowest"] == 1.0
    assert solver["axes"]["r2"]["units"] == "r1"
    assert solver["axes"]["rs1"]["default"] == 0.4
    assert solver["stages"]["highest"] == 0.6
    assert solver["fields"]["position"]["units"] == "1"
    assert solver["qualities"]["default"] == {"relative_error": SOLVER.tolerances["default"], "resolution": 96}
    assert solver["qualities"]["fine"] == {"relative_error": SOLVER.tolerances["fine"], "resolution": 128}
    for preset in solver["presets"].values():
        SOLVER.params.parse(preset)
    assert set(solver["params"]["properties"]) == set(SOLVER.params.model_fields)


def test_lists_along_an_axis_say_so(client: httpx.Client) -> None:
    """The page draws curves of them, so that it needs to know their axis, its bounds and all units."""
    page = client.get("/v1/solvers/decay").json()["params"]
    weather = page["properties"]["weather"]
    item = page["$defs"][weather["items"]["$ref"].rpartition("/")[2]]["properties"]
    assert weather["along"] == "day"
    assert {name: one["units"] for name, one in item.items()} == {
        "day": "day",
        "temperature": "degC",
        "humidity": "percent",
    }
    assert all({"minimum", "maximum"} <= one.keys() for one in item.values())


def test_health(client: httpx.Client, built: Path, tmp_path: Path) -> None:
    answer = client.get("/healthz")
    assert answer.status_code == 200
    assert answer.json()["version"] == __version__
    assert answer.json()["tables"]["default"]["digest"] == tables.info(Store.open(built)).digest
    with client_of(tmp_path / "nowhere") as other:
        sick = other.get("/healthz")
        assert sick.status_code == 503
        assert sick.json()["type"] == "urn:wizen:problem:missing-store"
        assert sick.headers["retry-after"]
        # the store may come after the service
        Store.open(tmp_path / "nowhere", create=True)
        assert other.get("/healthz").status_code == 200


def test_a_damaged_table_is_reported(own: Store) -> None:
    (own.tables_dir / "default" / "current.json").write_text("{}")
    with client_of(own.root) as client:
        assert client.get("/healthz").status_code == 503
        assert client.get("/v1/tables/default").json()["type"] == "urn:wizen:problem:corrupt-table"
        # the list is still there for the others
        (row,) = client.get("/v1/tables").json()["tables"]
        assert "damaged" in row["complaint"]


def test_openapi_is_valid_and_explains_the_query(built: Path, client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    validate(document)
    get = document["paths"]["/v1/shapes/{solver}"]["get"]
    parameters = {p["name"]: p for p in get["parameters"]}
    assert set(parameters) >= {*(f"r{i}" for i in range(2, 9)), "rs1", "rs2", "te", "gamma", "s", "resolution"}
    assert set(parameters) >= {"table", "format", "solver"}
    te = parameters["te"]
    assert "[r1]" in te["description"]
    assert (te["schema"]["minimum"], te["schema"]["maximum"]) == (0.002, 0.2)
    assert {e["value"] for e in te["examples"].values()} == {0.02, 0.06}
    assert parameters["s"]["schema"]["maximum"] == 0.6
    assert set(get["responses"]["200"]["content"]) == {
        "application/json",
        "application/octet-stream",
        "application/vnd.wizen.points",
        "application/x-npz",
        "model/gltf-binary",
        "model/obj",
    }
    assert "application/problem+json" in get["responses"]["422"]["content"]
    assert "HTTPValidationError" not in document["components"]["schemas"]


def test_openapi_needs_no_store(tmp_path: Path) -> None:
    document = create_app(Settings(store=tmp_path / "nowhere")).openapi()
    validate(document)


def test_openapi_is_one_that_clients_are_made_from() -> None:
    """Names that stay, a server, who needs a token, and no keyword that JSON Schema does not know."""
    document = create_app().openapi()
    operations = {op["operationId"]: op for each in document["paths"].values() for op in each.values()}
    assert set(operations) == {
        "index", "health", "tables", "table", "solvers", "solver", "portrait", "shape", "info", "batch", "jobs", "ask",
        "job", "cancel", "events", "fields", "result", "results", "maps", "thumbnail", "plan", "stages", "scenes",
        "match", "mesh",
    }  # fmt: skip
    assert document["servers"]
    needs = {name: operation["security"] for name, operation in operations.items()}
    assert {name for name, need in needs.items() if need == [{"token": []}]} == {"ask", "cancel", "mesh"}
    assert needs["shape"] == [{}, {"token": []}]
    schemas = document["components"]["schemas"]
    thickness = schemas["JobRequest_dehydration"]["properties"]["params"]["properties"]["exocarp_thickness"]
    assert thickness["x-units"] == "r1"
    assert "units" not in thickness
    weather = schemas["JobRequest_decay"]["properties"]["params"]["properties"]["weather"]
    assert weather["x-along"] == "day"
    assert "along" not in weather
    place = schemas["Colour"]["properties"]["where"]  # a default that is one of several kinds, made whole
    assert place["x-default"] == {"kind": "everywhere"}
    assert "default" not in place


@pytest.mark.parametrize("solver", registry.names())
def test_definitions_of_solvers_are_each_ones_own(solver: str) -> None:
    """Decay and wood both have a Cut, of other numbers."""
    schemas = create_app().openapi()["components"]["schemas"]

    def same(told: Any, own: Any, defs: dict[str, Any]) -> None:
        while "$ref" in own:
            told, own = schemas[told["$ref"].rsplit("/", 1)[1]], defs[own["$ref"].rsplit("/", 1)[1]]
        assert set(told.get("properties", {})) == set(own.get("properties", {})), own.get("title")
        for name, each in own.get("properties", {}).items():
            same(told["properties"][name], each, defs)
        for key in ("items", "additionalProperties"):
            if isinstance(own.get(key), dict):
                same(told[key], own[key], defs)
        for key in ("anyOf", "oneOf", "prefixItems"):
            for one, other in zip(told.get(key, ()), own.get(key, ()), strict=True):
                same(one, other, defs)

    own = registry.get(solver).params.model_json_schema()
    told = schemas[f"JobRequest_{solver}"]["properties"]["params"]
    axes = set(told["properties"]) - set(own["properties"])
    same({**told, "properties": {k: v for k, v in told["properties"].items() if k not in axes}}, own, own["$defs"])


def test_nothing_at_an_address_is_said_without_the_openapi_page(built: Path) -> None:
    app = create_app(Settings(store=built))
    with served(app) as client:
        problem = checked(client.get("/v1/table"), 404, "not-found")
    assert "/v1/tables" in problem["advice"]
    assert app.openapi_schema is None


def test_settings_come_from_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("WIZEN_STORE", str(tmp_path))
    monkeypatch.setenv("WIZEN_MAX_RESOLUTION", "64")
    assert Settings().store == tmp_path
    assert Settings().max_resolution == 64
    assert Settings().host == "127.0.0.1"
