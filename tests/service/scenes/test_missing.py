"""Runs that a scene lacks: what stands in for them, and how they become jobs and then shapes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from typer.testing import CliRunner

from service.cli import app
from service.views.scene import SceneItem, ScenePage
from solver import registry
from store.store import Store

from .._asking import checked
from .._gltf import parsed
from .._jobs import drain
from ._reading import instances
from .test_scenes import CAMERA

ITEM = {"solver": "shrinking", "preset": "sphere", "stage": 0.25, "quality": "preview", "size": 1.0, "transforms": [{}]}


def body(**more: Any) -> dict[str, Any]:
    return {"camera": CAMERA, "items": [{**ITEM, **more}]}


def told(client: httpx.Client, **more: Any) -> dict[str, Any]:
    answer = client.post("/v1/scenes?format=json", json=body(**more))
    assert answer.status_code == 200, answer.text
    report = answer.json()
    ScenePage.model_validate(report)
    assert set(report["items"][0]) <= set(SceneItem.model_fields)
    return {**report["items"][0], "count": report["missing"]}


@pytest.mark.usefixtures("shrinking")
def test_what_is_missing_becomes_a_job_and_then_a_shape(store: Store, queue_only: httpx.Client) -> None:
    with httpx.Client(base_url=queue_only.base_url) as anyone:
        _from_nothing_to_a_shape(store, queue_only, anyone)


def _from_nothing_to_a_shape(store: Store, queue_only: httpx.Client, anyone: httpx.Client) -> None:
    first = told(anyone)
    assert first["placeholder"] == "the fresh shape"
    assert first["missing"]["job"] is None
    assert "scope" in first["missing"]["advice"]
    assert queue_only.get("/v1/jobs").json()["jobs"] == []  # who may not, asks for nothing
    asked = told(queue_only)
    job = asked["missing"]["job"]
    assert (asked["count"], job["state"], asked["converged"]) == (1, "wanted", None)
    assert queue_only.get(f"/v1/jobs/{job['id']}").json()["need"]["stages"] == [0.25]
    assert told(queue_only)["missing"]["job"]["id"] == job["id"]  # asked twice is one job
    assert told(anyone)["missing"]["job"]["state"] == "wanted"
    by_key = {"solver": None, "preset": None, "quality": None, "stage": None, "run": job["id"]}
    assert told(anyone, **by_key)["missing"]["job"]["id"] == job["id"]
    plain = queue_only.post("/v1/scenes?compress=false", json=body()).content
    assert drain(store) == 1
    done = told(anyone)
    assert (done["run"], done["count"], done["exact"]) == (job["id"], 0, True)
    file = queue_only.post("/v1/scenes?compress=false", json=body()).content
    [(_, world, _, _)] = instances(file)
    assert np.abs(np.linalg.norm(world, axis=1) - 0.75 * 1.04).max() < 1e-3
    tags = [parsed(data)[0]["meshes"][0]["extras"]["etag"] for data in (plain, file)]
    assert tags[0] != tags[1]  # who holds the placeholder is sent the shape
    assert told(anyone, **by_key)["run"] == job["id"]
    # a variant that is not stored has something plain in its place, however well the item's own stage is known
    offered = told(anyone, variants=[0.25, 0.3])
    assert (offered["run"], offered["count"], offered["exact"]) == (job["id"], 1, False)
    assert offered["missing"]["job"] is None
    assert offered["missing"]["key"] != job["id"]
    # another stage is another run, and one that fails is said to
    assert told(anyone, stage=0.3)["count"] == 1
    fails = {"parameters": {"trouble": "refuses"}}
    assert told(queue_only, **fails)["missing"]["job"]["state"] == "wanted"
    assert drain(store) == 0
    said = checked(queue_only.post("/v1/scenes", json=body(**fails)), 422, "invalid-scene")
    assert "failed: it will not" in said["detail"]
    assert "Ask for something else." in said["advice"]


@pytest.mark.usefixtures("shrinking")
def test_one_job_has_all_stages_at_which_a_scene_shows_a_run(store: Store, queue_only: httpx.Client) -> None:
    items = [
        {**ITEM, "stage": 0.25, "variants": [0.1, 0.3]},
        {**ITEM, "stage": 0.2, "transforms": [{"position": [3, 0, 0]}]},
        {**ITEM, "stage": 0.2, "quality": "default", "transforms": [{"position": [6, 0, 0]}]},
    ]
    scene = {"camera": CAMERA, "items": items}

    def report() -> dict[str, Any]:
        return dict(queue_only.post("/v1/scenes?format=json", json=scene).raise_for_status().json())

    found = report()
    assert [item["stages"] for item in found["items"]] == [[0.25], [0.2], [0.2]]  # each stands in for its own
    jobs = queue_only.get("/v1/jobs").json()["jobs"]
    stages = {job["id"]: queue_only.get(f"/v1/jobs/{job['id']}").json()["need"]["stages"] for job in jobs}
    assert sorted(stages.values()) == [[0.1, 0.2, 0.25, 0.3], [0.2]]
    assert stages[found["items"][0]["missing"]["key"]] == [0.1, 0.2, 0.25, 0.3]
    assert drain(store) == 2
    done = report()
    assert done["missing"] == 0
    assert [item["stages"] for item in done["items"]] == [[0.25], [0.2], [0.2]]
    assert done["items"][0]["run"] == done["items"][1]["run"] != done["items"][2]["run"]
    assert len(queue_only.get("/v1/jobs").json()["jobs"]) == 2


@pytest.mark.usefixtures("shrinking")
def test_a_stage_that_cannot_be_is_told_of_its_own_item_alone(queue_only: httpx.Client) -> None:
    items = [{**ITEM, "stage": 0.22}, {**ITEM, "stage": 9.0, "transforms": [{"position": [3, 0, 0]}]}]
    answer = queue_only.post("/v1/scenes", json={"camera": CAMERA, "items": items})
    said = checked(answer, 422, "invalid-scene")
    assert "items.1" in said["detail"]
    assert "items.0" not in said["detail"]


def test_places_hold_boxes_of_the_right_size(tmp_path: Path) -> None:
    root = Store.open(tmp_path / "store", create=True).root
    scene = {
        "camera": {"position": [0, 30, 60], "fov": 60},
        "unit": 0.01,
        "places": [{"name": "row", "rule": "row"}],
        "items": [
            {"solver": "wood", "preset": "twig", "stage": 0.05, "place": "row"},
            {"preset": "apple", "stage": 9, "place": "row"},
            {"preset": "cabbage", "stage": 1, "place": "row"},
            {"preset": "raisin", "stage": 0.2, "place": "row"},
        ],
    }
    file = tmp_path / "scene.toml"
    import tomli_w

    file.write_text(tomli_w.dumps(scene), encoding="utf-8")
    out = tmp_path / "scene.glb"
    words = ["scene", str(file), "--store", str(root), "--out", str(out), "--plain"]
    done = CliRunner().invoke(app, [*words, "--json"])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert [bool(item.get("missing")) for item in report["items"]] == [True, True, True, False]
    assert "--solve" in report["items"][0]["missing"]["advice"]
    twig, apple, cabbage, _ = (world.max(axis=0) - world.min(axis=0) for _, world, *_ in sized(out.read_bytes()))
    params = registry.get("wood").parse({}, "twig")
    assert abs(twig[0] - params.length) < 1e-4
    assert 2 * params.radius - 1e-4 < twig[2] < 2 * params.radius + 1e-4
    assert 0.05 < apple[1] < 0.07
    assert np.allclose(cabbage, [0.02, 0.0004, 0.02], atol=1e-4)
    shown = CliRunner().invoke(app, words)
    assert "stands in" in shown.output
    own = CliRunner().invoke(app, ["scene", str(file), "--solve"])
    assert own.exit_code != 0


def sized(data: bytes) -> list[tuple[str, np.ndarray, np.ndarray, bool]]:
    """Return the instances in the order of the row."""
    return sorted(instances(data), key=lambda one: float(one[1][:, 0].mean()))


@pytest.mark.slow
def test_the_command_line_solves_what_is_missing(tmp_path: Path) -> None:
    file, out, root = tmp_path / "scene.toml", tmp_path / "scene.usda", tmp_path / "store"
    file.write_text(
        '[camera]\nposition = [0, 0, 12]\n[[items]]\npreset = "sphere-spot"\nstage = 0.25\nquality = "preview"\n'
        '[[items]]\npreset = "raisin"\nstage = 0.1\ntransforms = [{position = [3, 0, 0]}]\n',
        encoding="utf-8",
    )
    words = ["scene", str(file), "--store", str(root), "--out", str(out), "--json"]
    done = CliRunner().invoke(app, [*words, "--solve"])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["missing"] == 0
    key = report["items"][0]["run"]
    assert Store.open(root).ledger.get(key).state == "done"
    assert json.loads(CliRunner().invoke(app, words).stdout)["items"][0]["run"] == key
