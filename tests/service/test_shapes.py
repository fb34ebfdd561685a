"""Shapes over HTTP: the right numbers in every representation, caching, and every wrong parameter named."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import trimesh

from solver import registry
from solver.dehydration import SOLVER
from solver.fruit import lattice
from store.lookup import ShapeTable
from store.store import Store

from ..store.conftest import displacement, fill
from .conftest import QUERY, SHAPE, build, client_of

#: A stored sample at a stored stage, where interpolation adds nothing.
STORED = {"te": 0.02, "gamma": 5.0, "s": 0.2, "resolution": 16}


def ask(client: httpx.Client, query: dict[str, Any], **headers: str) -> httpx.Response:
    return client.get(SHAPE, params=query, headers={k.replace("_", "-"): v for k, v in headers.items()})


def exact() -> np.ndarray:
    return SOLVER.parse({"te": 0.02}).surface(*lattice(16)) + displacement(0.02, 5.0, 0.2, 16)


def test_npz_is_the_closed_form(client: httpx.Client) -> None:
    answer = ask(client, STORED, accept="application/x-npz")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/x-npz"
    with np.load(io.BytesIO(answer.content), allow_pickle=False) as archive:
        assert archive["position"].shape == (16, 32, 3)
        assert np.abs(archive["position"] - exact()).max() < 1e-5
        assert np.abs(archive["displacement"] - displacement(0.02, 5.0, 0.2, 16)).max() < 1e-5
        about = json.loads(str(archive["about"]))
    assert about["exact"] is True
    assert about["params"]["te"] == 0.02
    assert about["params"]["rs1"] == 0.4


def test_between_samples_it_is_the_lookup(client: httpx.Client, built: Path) -> None:
    expected = ShapeTable.open(built, surfaces=registry.surface).at({"te": 0.03, "gamma": 7.0}, 0.25, resolution=16)
    with np.load(io.BytesIO(ask(client, {**QUERY, "format": "npz"}).content)) as archive:
        assert np.array_equal(archive["position"], expected.position)


@pytest.mark.parametrize("kind", ["glb", "obj"])
def test_meshes_enclose_the_closed_form(client: httpx.Client, kind: str) -> None:
    answer = ask(client, {**STORED, "resolution": "48x96", "format": kind})
    assert answer.status_code == 200
    mesh = trimesh.load(io.BytesIO(answer.content), file_type=kind, force="mesh", process=False)
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    theta, _ = lattice(200)
    radius = np.linalg.norm(SOLVER.parse({"te": 0.02}).surface(*lattice(200)), axis=-1)
    radius = radius + np.einsum(
        "ijk,ijk->ij",
        displacement(0.02, 5.0, 0.2, 200),
        SOLVER.parse({"te": 0.02}).surface(*lattice(200)) / radius[..., None],
    )
    volume = np.sum(radius**3 / 3 * np.sin(theta)) * (np.pi / 200) ** 2
    assert mesh.volume == pytest.approx(volume, rel=5e-3)
    assert 'filename="dehydration-te0.02-gamma5-s0.2.' + kind in answer.headers["content-disposition"]


def test_json_is_the_default_and_links_to_the_files(client: httpx.Client) -> None:
    answer = ask(client, QUERY)
    assert answer.headers["content-type"] == "application/json"
    document = answer.json()
    assert sum(document["weights"].values()) == pytest.approx(1, abs=1e-6)
    assert document["exact"] is False
    assert document["nearest"] > 0
    assert document["stage"] == {"symbol": "s", "value": 0.25}
    assert document["descriptors"]["mean_radius"]["units"] == "1"
    assert set(document["links"]) == {"glb", "obj", "npz", "points"}
    for kind, link in document["links"].items():
        linked = client.get(link)
        assert linked.status_code == 200
        assert linked.content == ask(client, {**QUERY, "format": kind}).content


def test_the_resolution_is_the_tables_unless_asked(client: httpx.Client) -> None:
    document = ask(client, {"te": 0.03, "gamma": 7, "s": 0.1}).json()
    assert (document["lattice"]["colatitude"], document["lattice"]["azimuth"]) == (16, 32)


def test_fixed_parameters_may_be_named(client: httpx.Client) -> None:
    assert ask(client, {**QUERY, "rs1": 0.4}).status_code == 200


def test_timing_and_caching_headers(client: httpx.Client) -> None:
    answer = ask(client, {**QUERY, "te": 0.0333, "format": "glb"})
    assert answer.headers["server-timing"].startswith("lookup;dur=")
    assert "encode;dur=" in answer.headers["server-timing"]
    assert "max-age=60" in answer.headers["cache-control"]
    assert answer.headers["vary"] == "Accept"


@pytest.mark.parametrize("kind", ["glb", "obj", "npz", "json"])
def test_a_known_tag_is_not_sent_again(client: httpx.Client, kind: str) -> None:
    query = {**QUERY, "format": kind}
    first = ask(client, query)
    tag = first.headers["etag"]
    assert tag.startswith("W/") == (kind == "json")
    for known in (tag, f'"other", {tag}', tag.removeprefix("W/")):
        again = ask(client, query, if_none_match=known)
        assert again.status_code == 304
        assert again.content == b""
        assert again.headers["etag"] == tag
    assert ask(client, query, if_none_match='"other"').status_code == 200
    if kind != "json":
        assert ask(client, query).content == first.content


def test_tags_differ_with_representation_and_query(client: httpx.Client) -> None:
    queries = [
        {**QUERY, "format": "glb"},
        {**QUERY, "format": "obj"},
        {**QUERY, "format": "glb", "s": 0.2},
        {**QUERY, "format": "glb", "resolution": 17},
    ]
    assert len({ask(client, query).headers["etag"] for query in queries}) == len(queries)
    # however it is written
    spelt = {"format": "glb", "s": "2.5e-1", "resolution": "16x32", "gamma": "7", "te": "0.030", "table": "default"}
    assert ask(client, spelt).headers["etag"] == ask(client, queries[0]).headers["etag"]


def test_head_has_the_headers_and_no_body(client: httpx.Client) -> None:
    answer = client.head(SHAPE, params={**QUERY, "format": "glb"})
    assert answer.status_code == 200
    assert int(answer.headers["content-length"]) > 1000
    assert answer.content == b""


def test_nothing_acceptable(client: httpx.Client) -> None:
    answer = ask(client, QUERY, accept="image/png")
    assert answer.status_code == 406
    assert answer.headers["content-type"] == "application/problem+json"
    assert "model/gltf-binary" in answer.json()["advice"]


@pytest.mark.parametrize(
    ("change", "name", "words"),
    [
        ({"te": "thick"}, "te", "not a finite number"),
        ({"te": "nan"}, "te", "not a finite number"),
        ({"te": None}, "te", "is missing"),
        ({"s": None}, "s", "is missing"),
        ({"s": ["0.1", "0.2"]}, "s", "more than once"),
        ({"gama": 5}, "gama", "Did you mean 'gamma'"),
        ({"resolution": "64x64"}, "resolution", "64x128"),
        ({"resolution": "2"}, "resolution", "between 4 and 512"),
        ({"resolution": "513"}, "resolution", "WIZEN_MAX_RESOLUTION"),
        ({"resolution": "-1"}, "resolution", "not a resolution"),
        ({"format": "glbb"}, "format", "Did you mean 'glb'"),
    ],
)
def test_wrong_parameters_are_named(client: httpx.Client, change: dict[str, Any], name: str, words: str) -> None:
    query = {k: v for k, v in {**QUERY, **change}.items() if v is not None}
    answer = ask(client, query)
    assert answer.status_code == 422
    problem = answer.json()
    assert problem["type"] == "urn:wizen:problem:invalid-query"
    assert [wrong["name"] for wrong in problem["errors"]] == [name]
    assert words in " ".join(problem["errors"][0].values())


def test_everything_wrong_is_said_at_once(client: httpx.Client) -> None:
    problem = ask(client, {"te": 9, "gamma": "x", "resolution": 9999, "colour": "red"}).json()
    assert {wrong["name"] for wrong in problem["errors"]} == {"te", "gamma", "resolution", "colour", "s"}


def test_outside_the_table(client: httpx.Client) -> None:
    answer = ask(client, {**QUERY, "te": 0.19, "s": 0.31, "rs1": 0.5})
    assert answer.status_code == 422
    problem = answer.json()
    assert problem["type"] == "urn:wizen:problem:outside-table"
    assert {wrong["name"] for wrong in problem["errors"]} == {"te", "s", "rs1"}
    assert "0.02 to 0.06 [r1]" in problem["advice"]
    edge = {**QUERY, "te": 0.06, "gamma": 20, "s": 0.3}
    assert ask(client, edge).status_code == 200


@pytest.mark.parametrize("query", [{"format": "glb"}, {"format": "npz"}, {"format": "json"}])
def test_the_fresh_fruit(client: httpx.Client, query: dict[str, Any]) -> None:
    assert ask(client, {**QUERY, **query, "s": 0}).status_code == 200


def test_swollen_fruits(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "store", create=True)
    fill(store, te=[0.02, 0.06], stages=(-0.2, 0.2))
    build(store)
    with client_of(store.root) as client:
        answer = ask(client, {"te": 0.02, "s": -0.1, "format": "npz"})
        assert 's-0.1.npz"' in answer.headers["content-disposition"]
        with np.load(io.BytesIO(answer.content)) as archive:
            assert np.abs(archive["displacement"] - displacement(0.02, 10.0, -0.1, 16)).max() < 1e-6
        off = ask(client, {"te": 0.02, "s": -0.21})
        assert off.status_code == 422
        assert "-0.2 to 0.2" in off.json()["advice"]
        stage = client.get("/v1/tables/default").json()["stage"]
        assert (stage["stored"], stage["lowest"], stage["highest"]) == ([-0.2, 0.2], -0.2, 0.2)
        described = client.get("/openapi.json").json()["paths"][SHAPE.replace("dehydration", "{solver}")]["get"]
        s = next(p for p in described["parameters"] if p["name"] == "s")
        assert s["schema"]["minimum"] == SOLVER.stages.lowest
        assert [s["examples"][f"default-{end}"]["value"] for end in ("lowest", "highest")] == [-0.2, 0.2]


def test_tables_are_chosen_by_name(own: Store) -> None:
    build(own, "coarse", resolution=8)
    with client_of(own.root) as client:
        # `default` goes before the others
        assert ask(client, QUERY).json()["table"] == "default"
        assert ask(client, {**QUERY, "table": "coarse"}).json()["table"] == "coarse"
        wrong = ask(client, {**QUERY, "table": "corse"})
        assert wrong.status_code == 404
        assert "Did you mean 'coarse'" in wrong.json()["advice"]
        assert client.get("/v1/shapes/rot", params=QUERY).status_code == 404


def test_of_several_tables_that_hold_it_the_finer_answers(own: Store) -> None:
    build(own, "a", resolution=8)
    build(own, "b")
    (own.tables_dir / "default" / "current.json").unlink()
    with client_of(own.root) as client:
        assert ask(client, QUERY).json()["table"] == "b"
