"""Scenes over time, and scenes asked for again: morph targets, samples, and meshes that are not sent twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.scenes.compose import make
from service.scenes.errors import InvalidScene
from service.scenes.kinds.kind import COARSE
from service.scenes.request import parse
from solver.registry import surface
from store import starter
from store.lookup import ShapeTable

from .._gltf import parsed
from .._shapes import RAISIN_AT
from ._reading import array, instances, placed
from .test_scenes import CAMERA, TABLES, complaints, made

CURVE = [[0.5, 0.0], [2.0, 0.1], [3.0, 0.25]]
ITEM: dict[str, Any] = {"preset": "raisin", "curve": CURVE, "transforms": [{"position": [1, 0, 0]}, {"scale": 0.5}]}


def own(stage: float, n: int) -> np.ndarray:
    shape = ShapeTable.open(starter.ROOT, "raisin", surfaces=surface).at(RAISIN_AT, stage, resolution=n)
    assert shape.position is not None
    assert shape.poles is not None
    return np.concatenate([shape.position.reshape(-1, 3), shape.poles])


@pytest.mark.parametrize("compress", [False, True])
def test_each_knot_of_a_curve_is_the_tables_shape_at_its_time(compress: bool) -> None:
    if compress:
        pytest.importorskip("meshoptimizer")
    scene = made([{**ITEM, "transforms": [{}]}], compress=compress)
    document, binary = parsed(scene.data)
    [mesh] = document["meshes"]
    [(node, data)] = [(i, one) for i, one in enumerate(document["nodes"]) if "mesh" in one]
    grow = np.abs(data["scale"])
    assert "EXT_mesh_gpu_instancing" not in document["extensionsUsed"]  # three.js cannot draw instances that change
    [primitive] = mesh["primitives"]
    base = array(document, binary, primitive["attributes"]["POSITION"]).astype(float)
    n = scene.report["detail"]["lattices"][0]
    assert mesh["weights"] == [0, 0]
    assert mesh["extras"]["targetNames"] == ["0.1", "0.25"]  # what Blender calls the shape keys
    for (_, stage), target in zip(CURVE, [None, *primitive["targets"]], strict=True):
        steps = 0 if target is None else array(document, binary, target["POSITION"]).astype(float)
        assert np.abs((base + steps) * grow - own(stage, n)).max() < 4e-4
    [animation] = document["animations"]
    [channel] = animation["channels"]
    assert channel["target"] == {"node": node, "path": "weights"}
    sampler = animation["samplers"][channel["sampler"]]
    assert array(document, binary, sampler["input"]).ravel().tolist() == [0.5, 2, 3]
    assert array(document, binary, sampler["output"]).reshape(3, 2).tolist() == [[0, 0], [1, 0], [0, 1]]


def test_normals_that_turn_over_arrive_all_the_same() -> None:
    """From fresh to wrinkled some turn by more than a byte's difference holds."""
    scene = made([{"preset": "jujube1", "curve": [[0, 0.0], [2, 0.3]], "transforms": [{}]}])
    document, binary = parsed(scene.data)
    [mesh] = document["meshes"]
    [primitive] = mesh["primitives"]
    n = scene.report["detail"]["lattices"][0]
    table = ShapeTable.open(starter.ROOT, "jujube1", surfaces=surface)
    shape = table.at({"te": 0.02, "gamma": 10.0}, 0.3, resolution=n)
    truth = np.concatenate([shape.normals.reshape(-1, 3), shape.pole_normals])
    base = array(document, binary, primitive["attributes"]["NORMAL"]).astype(float)
    steps = array(document, binary, primitive["targets"][0]["NORMAL"])
    assert np.abs(truth - base).max() > 1.1
    assert np.abs(base + steps - truth).max() < 0.01


def test_individuals_that_change_are_where_those_are_that_stay() -> None:
    spots = [{"position": [float(x), 0.5, 0.0], "scale": 0.4} for x in range(-3, 4)]
    item = {"preset": "raisin", "transforms": spots, "seed": 7}
    still, changing = (
        made([{**item, "stage": 0.0}], cull=False),
        made([{**item, "curve": [[0, 0.0], [1, 0.2]]}], cull=False),
    )
    nodes = parsed(changing.data)[0]["nodes"]
    assert len(nodes) == 8
    assert {np.sign(node["scale"][0]) for node in nodes[:-1]} == {-1, 1}
    one, other = (sorted(instances(scene.data), key=lambda i: i[1][:, 0].mean()) for scene in (still, changing))
    for (_, world, triangles, mirrored), (_, moved, also, turned) in zip(one, other, strict=True):
        assert np.abs(world - moved).max() < 2e-4
        assert (triangles == also).all()
        assert mirrored == turned
    channels = parsed(changing.data)[0]["animations"][0]["channels"]
    assert sorted(channel["target"]["node"] for channel in channels) == list(range(7))


def test_an_item_is_as_right_as_the_worst_stage_of_its_curve() -> None:
    """It begins with the fresh shape, which is exact; the rest is not."""

    def told(*curve: list[float]) -> dict[str, Any]:
        found: dict[str, Any] = made([{"preset": "jujube1", "curve": curve}]).report["items"][0]
        return found

    between = told([0, 0.0], [2, 0.27])
    still = made([{"preset": "jujube1", "stage": 0.27}]).report["items"][0]
    assert between["exact"] is False
    assert between["expected_error"] == still["expected_error"]
    assert told([0, 0.0], [1, 0.27], [2, 0.3])["expected_error"] == still["expected_error"]
    assert told([0, 0.0], [2, 0.3])["exact"] is True


def test_usd_samples_prototypes_over_time(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    scene = made([{**ITEM, "seed": 3}], "usdc")
    path = tmp_path / "scene.usdc"
    path.write_bytes(scene.data)
    assert complaints(path) == []
    stage = Usd.Stage.Open(str(path))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (12, 72, 24)
    found = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/fruits/prototypes/shape0"))
    assert found.GetPointsAttr().GetTimeSamples() == [12, 48, 72]
    points = np.array(found.GetPointsAttr().Get(72))
    n = int(np.sqrt((len(points) - 2) / 2))
    assert np.abs(np.abs(points) - np.abs(own(0.25, n))).max() < 1e-5
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/fruits"))
    for time in (12, 48, 72):
        assert np.allclose(instancer.GetExtentAttr().Get(time), instancer.ComputeExtentAtTime(time, time))


def test_a_camera_that_moved_gets_what_it_lacks() -> None:
    still = {"preset": "jujube1", "stage": 0.2, "transforms": [{"position": [-2, 0, 0]}]}
    items = [{**ITEM, "transforms": [{"position": [2, 0, 0]}]}, still]
    first = made(items)
    document, _ = parsed(first.data)
    tags = [one["extras"]["etag"] for one in document["meshes"]]
    assert len(set(tags)) == 2
    again = made(items, known=tags)
    document, _ = parsed(again.data)
    assert [one["extras"]["etag"] for one in document["meshes"]] == tags
    assert all(one["extras"]["known"] for one in document["meshes"])
    # an animation of weights has targets, whoever holds the mesh
    [fading] = [one for one in document["meshes"] if "weights" in one]
    assert len(fading["weights"]) == len(fading["primitives"][0]["targets"]) == len(CURVE) - 1
    assert len(again.data) < 0.05 * len(first.data)
    nearer = {**CAMERA, "position": [-1, 0, 6]}
    moved = make(parse({"camera": nearer, "items": items, "known": tags}), TABLES, 512, "glb", False)
    fresh = [one for one in parsed(moved.data)[0]["meshes"] if not one["extras"].get("known")]
    assert fresh
    assert not {one["extras"]["etag"] for one in fresh} & set(tags)
    assert [place(again.data, node) for node in (0, 1)] == [place(first.data, node) for node in (0, 1)]


def place(data: bytes, node: int) -> list[list[float]]:
    """Where a node's instances are, and their scales: what a mesh that is known already has to be drawn with."""
    document, binary = parsed(data)
    return [part.ravel().tolist() for part in placed(document, binary, document["nodes"][node])[0]]


def test_known_meshes_are_not_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    items = [{"preset": "plum2", "stage": 0.15, "transforms": [{}]}]
    first = made(items)
    tags = [one["extras"]["etag"] for one in parsed(first.data)[0]["meshes"]]
    asked: list[int] = []
    plain = ShapeTable.at

    def at(self: ShapeTable, *words: Any, **more: Any) -> Any:
        asked.append(more["resolution"])
        return plain(self, *words, **more)

    monkeypatch.setattr(ShapeTable, "at", at)
    made(items, known=tags)
    assert max(asked, default=0) <= COARSE  # what is seen is told from the coarse one


@pytest.mark.parametrize(
    ("item", "why"),
    [
        ({"preset": "raisin", "transforms": [{}]}, "either a stage or a curve"),
        ({**ITEM, "stage": 0.1}, "either a stage or a curve"),
        ({**ITEM, "curve": [[0, 0.1]]}, "two or more"),
        ({**ITEM, "curve": [[1, 0.1], [1, 0.2]]}, "times rise"),
        ({**ITEM, "curve": [[0, 0.1], [1, 0.9]]}, "off the table"),
    ],
)
def test_curves_that_mean_nothing_are_refused(item: dict[str, Any], why: str) -> None:
    with pytest.raises(InvalidScene, match=why):
        made([item])
