"""Every JSON answer is what the OpenAPI page says of it, and nothing that it does not say."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from jsonschema import Draft202012Validator

from store.store import Store

from ._asking import checked
from ._gltf import parsed
from ._jobs import bearer, body, drain
from .conftest import QUERY, SHAPE, client_of

pytestmark = pytest.mark.usefixtures("shrinking")


def strict(schema: Any) -> Any:
    """Return a schema that refuses what it does not name."""
    if isinstance(schema, list):
        return [strict(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    found = {key: strict(value) for key, value in schema.items()}
    if found.get("type") == "object" and "properties" in found:
        found.setdefault("additionalProperties", False)
    return found


class Page:
    """The OpenAPI page of a service, as one who checks answers reads it."""

    def __init__(self, client: httpx.Client) -> None:
        self._client, self._page = client, client.get("/openapi.json").json()
        self.seen: set[str] = set()
        self.operations = {op["operationId"]: op for each in self._page["paths"].values() for op in each.values()}

    def check(self, operation: str, answer: httpx.Response) -> Any:
        """Hold an answer to what is said of it; return its body."""
        media = answer.headers["content-type"].partition(";")[0]
        said = self.operations[operation]["responses"][str(answer.status_code)]["content"][media]["schema"]
        assert said != {}, f"{operation} says nothing of its answer"
        whole = strict({**said, "components": self._page["components"]})
        errors = [
            f"{error.json_path}: {error.message[:200]}"
            for error in Draft202012Validator(whole).iter_errors(answer.json())
        ]
        assert not errors, (operation, errors)
        self.seen.add(operation)
        return answer.json()

    def get(self, operation: str, url: str, **options: Any) -> Any:
        return self.check(operation, self._client.get(url, **options))


@pytest.fixture
def both(own: Store) -> Iterator[tuple[httpx.Client, Store]]:
    """A service over a store with a table, asked by somebody who may run jobs."""
    with client_of(own.root, jobs_workers=0) as client:
        client.headers.update(bearer(own))
        yield client, own


def test_every_answer_is_as_declared(both: tuple[httpx.Client, Store]) -> None:
    client, store = both
    page = Page(client)
    page.get("index", "/", headers={"Accept": "application/json"})
    page.get("health", "/healthz")
    page.get("tables", "/v1/tables")
    page.get("table", "/v1/tables/default")
    page.get("maps", "/v1/maps")
    for entry in page.get("solvers", "/v1/solvers")["solvers"]:
        page.get("solver", entry["href"])
    page.get("stages", "/v1/solvers/dehydration/stages", params={"hours": "24,48", "preset": "raisin"})
    page.get("shape", SHAPE, params=QUERY)
    info = page.get("info", f"{SHAPE}/info", params=QUERY)
    document, binary = parsed(client.get(info["links"]["glb"]).content)
    assert document["asset"]["version"] == "2.0"
    assert sum(view["byteLength"] for view in document["bufferViews"]) <= len(binary)
    page.get("shape", SHAPE, params={k: v for k, v in QUERY.items() if k != "resolution"} | {"screen_px": 100})
    job = page.check("ask", client.post("/v1/jobs", json=body()))
    page.get("jobs", "/v1/jobs")
    gone = page.check("ask", client.post("/v1/jobs", json=body(0.05)))
    page.check("cancel", client.delete(gone["links"]["self"]))
    drain(store)
    own = page.get("job", job["links"]["self"])["links"]["self"]
    numbers = page.get("fields", f"{own}/fields")
    assert numbers["fields"]["volume"]["dims"] == ["stage"]
    page.get("result", f"{own}/result", params={"format": "json"})
    page.get("result", f"{own}/result", params={"format": "json", "fields": "stage,volume"})
    page.get("results", "/v1/results")
    page.check("match", client.post("/v1/match", params={"table": "default"}, json={"roughness": 0.01}))
    obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    page.check("mesh", client.post("/v1/meshes", content=obj, headers={"Content-Type": "model/obj"}))
    fruit = {"parameters": {"te": 0.035, "gamma": 20}, "stage": 0.2, "transforms": [{}, {"position": [0, 0, 99]}]}
    scene = {"camera": {"position": [0, 0, 9]}, "items": [fruit]}
    page.check("scenes", client.post("/v1/scenes", params={"format": "json"}, json=scene))
    (store.tables_dir / "default" / "current.json").write_text("{}")
    with client_of(store.root) as other:
        page.check("tables", other.get("/v1/tables"))
    assert page.seen == set(page.operations) - {"batch", "events", "thumbnail", "portrait", "plan"}, (
        "an operation with JSON was left out"
    )


def test_files_are_declared_as_bytes_first(client: httpx.Client) -> None:
    """What generators of clients look for: without it they read a mesh as text."""
    operations = Page(client).operations
    for name in ("shape", "batch", "result"):
        content = operations[name]["responses"]["200"]["content"]
        assert next(iter(content)) == "application/octet-stream"
        assert content["application/octet-stream"]["schema"] == {"type": "string", "format": "binary"}


def test_info_says_the_same_as_the_shape_s_json(client: httpx.Client) -> None:
    one, other = (
        client.get(f"{SHAPE}/info", params=QUERY, headers={"Accept": "model/obj"}),
        client.get(SHAPE, params=QUERY),
    )
    mine, its = one.json(), other.json()
    mine.pop("timings_ms"), its.pop("timings_ms")
    assert mine == its
    assert one.headers["etag"] == other.headers["etag"]
    problem = checked(client.get(f"{SHAPE}/info", params={**QUERY, "format": "glb"}), 422, "invalid-query")
    assert [wrong["name"] for wrong in problem["errors"]] == ["format"]
    checked(client.get(f"{SHAPE}/info", params={**QUERY, "te": 9}), 422, "outside-table")


def test_fields_of_a_job_that_has_not_ended(both: tuple[httpx.Client, Store]) -> None:
    client, store = both
    own = client.post("/v1/jobs", json=body(0.06)).json()["links"]["self"]
    checked(client.get(f"{own}/fields"), 409, "job-not-done")
    drain(store)
    checked(client.get(f"{own}/fields", params={"names": "nothing"}), 422, "invalid-query")
    assert client.get(f"{own}/fields", params={"names": "volume", "stage": 0.1}).json()["fields"]["volume"][
        "shape"
    ] == [1]
