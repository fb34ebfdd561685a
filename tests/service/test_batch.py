"""Batches over HTTP: each shape as it comes alone, limits that say their name, wrong entries with their number."""

from __future__ import annotations

import email
import io
import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from service.shapes import batch as module
from solver import registry
from store import starter
from store.lookup import ShapeTable
from store.store import Store

from .conftest import QUERY, SHAPE, client_of

BATCH = "/v1/shapes:batch"
ROWS = [{"te": 0.03, "gamma": 7.0, "s": 0.25}, {"te": 0.02, "gamma": 5.0, "s": 0.2}, {"te": 0.06, "gamma": 9, "s": 0}]
BODY: dict[str, Any] = {"solver": "dehydration", "points": ROWS, "resolution": 16}


def ask(client: httpx.Client, accept: str = "*/*", **changes: Any) -> httpx.Response:
    body = {k: v for k, v in {**BODY, **changes}.items() if v is not None}
    return client.post(BATCH, json=body, headers={"accept": accept})


def load(answer: httpx.Response) -> dict[str, np.ndarray]:
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "application/x-npz"
    with np.load(io.BytesIO(answer.content), allow_pickle=False) as archive:
        return dict(archive)


def single(client: httpx.Client, row: dict[str, Any], kind: str, **more: Any) -> httpx.Response:
    answer = client.get(SHAPE, params={**row, "resolution": 16, "format": kind, **more})
    assert answer.status_code == 200, answer.text
    return answer


@pytest.mark.parametrize("name", Store.open(starter.ROOT).table_names())
def test_tables_of_the_package_come_as_each_shape_alone(name: str) -> None:
    """Those that are packed in whole numbers, too: positions are not."""
    with client_of(starter.ROOT) as client:
        axes = client.get(f"/v1/tables/{name}").json()["axes"]
        row = {axis: 0.5 * (said["lowest"] + said["highest"]) for axis, said in axes.items()} | {"s": 0.1}
        found = load(ask(client, points=[row], table=name, fields=["position", "displacement"]))
        with np.load(io.BytesIO(single(client, row, "npz", table=name).content)) as alone:
            for field in ("position", "displacement", "poles"):
                assert found[field].dtype == alone[field].dtype == np.float32
                assert np.array_equal(found[field][0], alone[field])


def test_each_shape_is_as_it_comes_alone(client: httpx.Client) -> None:
    found = load(ask(client, fields=["position", "displacement"]))
    assert found["position"].shape == found["displacement"].shape == (3, 16, 32, 3)
    assert found["poles"].shape == (3, 2, 3)
    for i, row in enumerate(ROWS):
        with np.load(io.BytesIO(single(client, row, "npz").content)) as alone:
            for name in ("position", "displacement", "poles"):
                assert np.array_equal(found[name][i], alone[name])
            for name in ("colatitude", "azimuth"):
                assert np.array_equal(found[name], alone[name])
    assert found["te"].tolist() == [0.03, 0.02, 0.06]
    assert found["stage"].tolist() == [0.25, 0.2, 0]
    assert found["exact"].tolist() == [False, True, True]
    assert (
        found["descriptor_mean_radius"][0]
        == single(client, ROWS[0], "json").json()["descriptors"]["mean_radius"]["value"]
    )
    assert np.isnan(found["descriptor_mean_radius"][2])
    about = json.loads(str(found["about"]))
    assert (about["axes"], about["stage"], about["params"]["rs1"]) == (["te", "gamma"], "s", 0.4)


def test_columns_are_rows_turned(client: httpx.Client) -> None:
    columns = {"te": 0.03, "gamma": [5, 7.5, 20], "s": [0.1, 0.2, 0.3]}
    rows = [{"te": 0.03, "gamma": g, "s": s} for g, s in zip([5, 7.5, 20], [0.1, 0.2, 0.3], strict=True)]
    assert ask(client, points=columns).content == ask(client, points=rows).content
    assert len(load(ask(client, points={"te": 0.03, "gamma": 7, "s": 0.1}))["position"]) == 1
    wrong = ask(client, points={"te": [0.03, 0.04], "gamma": [5, 6, 7], "s": 0.1})
    assert wrong.status_code == 422
    assert wrong.json()["errors"][0]["name"] == "points.te"


@pytest.mark.parametrize("kind", ["glb", "obj", "points"])
def test_files_come_as_parts(client: httpx.Client, kind: str) -> None:
    answer = ask(client, format=kind)
    kind_line = f"Content-Type: {answer.headers['content-type']}\r\n\r\n".encode()
    message = email.message_from_bytes(kind_line + answer.content)
    parts = message.get_payload()
    assert isinstance(parts, list)
    assert [part.get_filename() for part in parts] == [f"{i}.{kind if kind != 'points' else 'wzp'}" for i in range(3)]
    for part, row in zip(parts, ROWS, strict=True):
        alone = single(client, row, kind)
        assert part.get_content_type() == alone.headers["content-type"].partition(";")[0]
        if kind != "obj":  # whose lines a mail reader ends its own way
            assert alone.content in answer.content


def test_lines_of_json(client: httpx.Client) -> None:
    answer = ask(client, accept="application/x-ndjson")
    assert answer.headers["content-type"] == "application/x-ndjson"
    lines = [json.loads(line) for line in answer.text.splitlines()]
    for line, row in zip(lines, ROWS, strict=True):
        alone = single(client, row, "json").json()
        assert {**line, "links": 0, "timings_ms": 0} == {**alone, "links": 0, "timings_ms": 0}


def test_what_is_accepted(client: httpx.Client) -> None:
    assert ask(client, accept="multipart/mixed").headers["content-type"].startswith('multipart/mixed; boundary="')
    refused = ask(client, accept="image/png")
    assert refused.status_code == 406
    assert "application/x-npz" in refused.json()["advice"]


def test_long_answers_are_streamed_and_the_same(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    short = ask(client, format="npz")
    assert int(short.headers["content-length"]) == len(short.content)
    monkeypatch.setattr(module, "_PIECE", 4000)
    long = ask(client, format="npz")
    assert "content-length" not in long.headers
    assert long.content == short.content


def test_every_wrong_entry_is_named(client: httpx.Client) -> None:
    points = [ROWS[0], {"te": 9, "gamma": 7, "s": 0.1}, {"te": 0.03, "gama": 7, "s": 0.1}, {**ROWS[0], "resolution": 3}]
    answer = ask(client, points=points)
    assert answer.status_code == 422
    problem = answer.json()
    named = {wrong["name"] for wrong in problem["errors"]}
    assert named == {"points[1].te", "points[2].gama", "points[2].gamma", "points[3].resolution"}
    off = ask(client, points=[ROWS[0], *[{"te": 0.19, "gamma": 7, "s": 0.1}] * 20]).json()
    assert off["type"] == "urn:wizen:problem:outside-table"
    assert len(off["errors"]) == 20
    assert "17 more" in off["detail"]


def test_shapes_that_may_be_too_far_off_are_named(client: httpx.Client) -> None:
    answer = ask(client, points=[ROWS[1], ROWS[0]], max_error=1e-6)
    assert answer.status_code == 422
    assert answer.json()["type"] == "urn:wizen:problem:too-uncertain"
    assert [wrong["name"] for wrong in answer.json()["errors"]] == ["points[1]"]
    again = ask(client, points=[ROWS[1], ROWS[1], ROWS[0], ROWS[1], ROWS[0]], max_error=1e-6)
    assert [wrong["name"] for wrong in again.json()["errors"]] == ["points[2]", "points[4]"]


def test_methods(client: httpx.Client, built: Path) -> None:
    found = load(ask(client, method="idw"))
    point = {"te": 0.03, "gamma": 7.0}
    expected = ShapeTable.open(built, surfaces=registry.surface).at(point, 0.25, resolution=16, method="idw")
    assert np.array_equal(found["position"][0], expected.position)
    assert json.loads(str(found["about"]))["method"] == "idw"
    wrong = ask(client, method="idv")
    assert wrong.status_code == 422


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"points": []}, "at least 1"),
        ({"points": [{"te": "0.03"}]}, "number"),
        ({"resolution": 513}, "WIZEN_MAX_RESOLUTION"),
        ({"screen_px": 300}, "one is named"),
        ({"region": "0:10"}, "not a region"),
        ({"region": "0:90,0:90", "format": "glb"}, "closed mesh"),
        ({"colour": "red"}, "not permitted"),
        ({"format": "png"}, "npz"),
    ],
)
def test_bad_bodies(client: httpx.Client, change: dict[str, Any], words: str) -> None:
    answer = ask(client, **change)
    assert answer.status_code == 422, answer.text
    assert words in answer.text


def test_limits_say_their_names(built: Path) -> None:
    with client_of(built, max_batch=3, max_batch_samples=2000) as client:
        load(ask(client))
        many = ask(client, points=[ROWS[0]] * 4, resolution=8)
        assert many.status_code == 413
        assert "WIZEN_MAX_BATCH" in many.json()["advice"]
        # nothing is made of too many: not the family of each, which here no table holds, nor their table
        for points in ([{"te": 0.5, "s": 0.1}] * 4, {"te": 0.5, "s": [0.1] * 4}):
            for more in ({}, {"table": "nowhere"}):
                many = ask(client, points=points, **more)
                assert (many.status_code, many.json()["type"]) == (413, "urn:wizen:problem:batch-too-large")
        large = ask(client, resolution=32)
        assert large.status_code == 413
        assert "at most 0 shapes" in large.json()["advice"]
        assert "WIZEN_MAX_BATCH_SAMPLES" in large.json()["advice"]
        # a part counts as what it is
        load(ask(client, resolution=32, region="0:45,0:90"))


def test_it_takes_the_right_to_read(built: Path) -> None:
    with client_of(built, public_read=False) as client:
        assert ask(client).status_code == 401


def test_a_part_of_every_shape(client: httpx.Client) -> None:
    found = load(ask(client, region="45:90,350:20", components=["z"]))
    whole = load(ask(client))["position"]
    columns = [31, 32 - 32, 1]  # 11.25 degrees apart: 348.75 is outside
    assert found["position"].shape == (3, 4, 2, 1)
    assert np.abs(found["position"] - whole[:, 4:8][:, :, columns[1:]][..., 2:]).max() < 1e-6
    assert json.loads(str(found["about"]))["detail"] == {
        "resolution": 16,
        "waves": 16,
        "region": {"degrees": "45:90,350:20", "rows": [4, 4], "columns": [0, 2]},
        "components": ["z"],
    }
    assert "poles" not in found


def test_detail_for_a_screen(client: httpx.Client) -> None:
    point = {k: v for k, v in QUERY.items() if k != "resolution"}
    filled = client.get(SHAPE, params={**point, "screen_px": 200}).json()
    # half the outline, pi r1, is 314 pixels long where the diameter is 200
    assert filled["lattice"]["colatitude"] == filled["detail"]["resolution"] == 80
    assert filled["detail"]["chosen_by"] == "screen_px"
    far = client.get(SHAPE, params={**point, "screen_px": 1000, "distance": 20, "fov": 30}).json()
    assert far["lattice"]["colatitude"] == 80
    near = client.get(SHAPE, params={**point, "screen_px": 4000, "distance": 0.1}).json()
    nearest = client.get(SHAPE, params={**point, "screen_px": 4000, "distance": 5e-324, "fov": 5e-324}).json()
    assert nearest["detail"]["resolution"] == near["detail"]["resolution"]
    assert near["lattice"]["colatitude"] == 512
    assert near["detail"]["wanted"] > 512
    plain = client.get(SHAPE, params=point).json()
    assert "detail" not in plain
    # the links lead to the lattice that was chosen
    with np.load(io.BytesIO(client.get(filled["links"]["npz"]).content)) as archive:
        assert archive["position"].shape == (80, 160, 3)


def test_a_part_of_one_shape(client: httpx.Client) -> None:
    query = {**QUERY, "format": "npz", "region": "0:90,0:360"}
    answer = client.get(SHAPE, params={**query, "fields": "position"})
    with np.load(io.BytesIO(answer.content)) as archive:
        assert archive["position"].shape == (8, 32, 3)
        assert "displacement" not in archive
        assert json.loads(str(archive["about"]))["detail"]["fields"] == ["position"]
    other = client.get(SHAPE, params={**query, "fields": "displacement"})
    assert other.headers["etag"] != answer.headers["etag"]
    links = client.get(SHAPE, params={**query, "format": "json"}).json()["links"]
    assert set(links) == {"npz"}


@pytest.mark.parametrize(
    ("change", "name", "words"),
    [
        ({"screen_px": 300}, "screen_px", "one is named"),
        ({"screen_px": "-3", "resolution": None}, "screen_px", "not a positive number"),
        ({"distance": 3}, "distance", "without screen_px"),
        ({"screen_px": 300, "fov": 30, "resolution": None}, "fov", "without distance"),
        ({"screen_px": 9, "distance": 1, "fov": 181, "resolution": None}, "fov", "backwards"),
        ({"region": "90:45,0:10", "format": "npz"}, "region", "is empty"),
        ({"region": "0:90,0:10", "format": "glb"}, "region", "closed mesh"),
        ({"components": "w", "format": "npz"}, "components", "Known: x, y, z"),
        ({"fields": "position,position", "format": "npz"}, "fields", "Known"),
        ({"screen_pix": 3}, "screen_pix", "Did you mean 'screen_px'"),
    ],
)
def test_wrong_detail_is_named(client: httpx.Client, change: dict[str, Any], name: str, words: str) -> None:
    query = {k: v for k, v in {**QUERY, **change}.items() if v is not None}
    answer = client.get(SHAPE, params=query)
    assert answer.status_code == 422
    assert [wrong["name"] for wrong in answer.json()["errors"]] == [name]
    assert words in answer.text


def test_equal_points_are_computed_once(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """In any order, of any format; with `once` they are sent once, too, and the answer says which is whose."""
    asked: list[Any] = []
    real = ShapeTable.at

    def counted(self: ShapeTable, point: Any, stage: float, **options: Any) -> Any:
        asked.append((tuple(point.items()), stage))
        return real(self, point, stage, **options)

    monkeypatch.setattr(ShapeTable, "at", counted)
    points = [ROWS[0], ROWS[1], ROWS[0], ROWS[0], ROWS[1], ROWS[2]]
    whole = load(ask(client, points=points))
    assert len(asked) == 3
    assert whole["position"].shape[0] == 6
    assert np.array_equal(whole["position"][0], whole["position"][3])
    once = load(ask(client, points=points, once=True))
    assert once["row"].tolist() == [0, 1, 0, 0, 1, 2]
    assert np.array_equal(once["position"][once["row"]], whole["position"])
    assert once["te"].tolist() == [0.03, 0.02, 0.06]
    lines = [json.loads(line) for line in ask(client, points=points, once=True, format="json").text.splitlines()]
    assert [line["points"] for line in lines] == [[0, 2, 3], [1, 4], [5]]
    answer = ask(client, points=points, once=True, format="glb")
    head = f"Content-Type: {answer.headers['content-type']}\r\n\r\n".encode()
    parts = email.message_from_bytes(head + answer.content).get_payload()
    assert [part["Wizen-Points"] for part in parts] == ["0,2,3", "1,4", "5"]
    assert "points" not in json.loads(ask(client, format="json").text.splitlines()[0])


def test_each_point_at_its_own_level_of_detail(client: httpx.Client) -> None:
    near, far = {**ROWS[0], "screen_px": 60}, {**ROWS[0], "screen_px": 10}
    own = [ROWS[0], near, far, {**ROWS[0], "resolution": 16}]
    lines = [json.loads(line) for line in ask(client, points=own, format="json").text.splitlines()]
    assert [line["lattice"]["colatitude"] for line in lines] == [16, 24, 8, 16]
    assert lines[1]["detail"]["chosen_by"] == "screen_px"
    # one of each alone is the same file
    answer = ask(client, points=own, format="points")
    head = f"Content-Type: {answer.headers['content-type']}\r\n\r\n".encode()
    parts = [part.get_payload(decode=True) for part in email.message_from_bytes(head + answer.content).get_payload()]
    for part, row, more in zip(parts, own, ({"resolution": 16}, {}, {}, {}), strict=True):
        assert part == client.get(SHAPE, params={**row, **more, "format": "points"}).content
    refused = ask(client, points=own).json()
    assert "several lattices" in refused["detail"]
    assert load(ask(client, points=[far, far], resolution=None))["position"].shape[1] == 8
    for bad in ({"resolution": 3}, {"resolution": 16.5}, {"resolution": 9999}, {"screen_px": -1}, {"fov": 20}):
        problem = ask(client, points=[ROWS[0], {**ROWS[0], **bad}], format="glb").json()
        assert problem["errors"][0]["name"] == f"points[1].{next(iter(bad))}", problem
