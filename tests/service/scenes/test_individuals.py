"""Individuals that differ in shape, variants that a file offers, skins that wear: as other code reads the files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.scenes.compose import make
from service.scenes.errors import InvalidScene
from service.scenes.kinds import distinct
from service.scenes.kinds.looked import Looked
from service.scenes.request import Item, parse
from service.shapes.live import LiveTables
from service.views.scene import SceneItem
from solver.registry import surface
from store import starter
from store.lookup import ShapeTable

from .._gltf import parsed
from .._shapes import RAISIN_AT
from ._reading import array, instances
from .test_scenes import CAMERA, TABLES, complaints

SPOTS = [{"position": [float(x), float(y), 0.0]} for x in (-3, -1, 1, 3) for y in (-1, 1)]


def made(item: dict[str, Any], to: str = "glb", **more: Any) -> Any:
    return make(
        parse({"camera": CAMERA, "items": [{"transforms": SPOTS, "size": 0.5, **item}], **more}), TABLES, 512, to
    )


def kinds(**item: Any) -> list[Looked]:
    found, _ = distinct([Item.model_validate(item)], LiveTables(starter.ROOT, 60.0), 512)
    assert all(isinstance(one, Looked) for one in found)
    return [one for one in found if isinstance(one, Looked)]


def test_shapes_differ_by_no_more_than_is_said_and_stay_in_the_table() -> None:
    asked = {"preset": "sphere", "parameters": {"te": 0.035, "gamma": 20.0}, "stage": 0.2, "count": 40, "place": "p"}
    for differ in (0.1, 0.5):
        found = kinds(**asked, seed=4, differ=differ, shapes=24)
        table = found[0].table
        assert len(found) == 24
        assert len({(tuple(one.point.items()), one.stage) for one in found}) == 24
        assert (found[0].point["te"], found[0].point["gamma"], found[0].stage) == (0.035, 20.0, 0.2)
        for one in found:
            told = {**one.point, "s": one.stage}
            for name, middle in (("te", 0.035), ("gamma", 20.0), ("s", 0.2)):
                low, high = {**table.axes, "s": table.reach}[name]
                assert low <= told[name] <= high
                assert abs(told[name] / middle - 1) <= differ + 1e-3
        spread = np.std([one.stage / 0.2 for one in found])
        assert spread > 0.3 * differ / np.sqrt(3)
    again = kinds(**asked, seed=4, differ=0.5, shapes=24)
    assert [one.point for one in again] == [one.point for one in found]
    other = kinds(**asked, seed=5, differ=0.5, shapes=24)
    assert [one.stage for one in other][1:] != [one.stage for one in found][1:]


def test_individuals_take_turns_among_the_shapes() -> None:
    scene = made({"preset": "raisin", "stage": 0.2, "seed": 1, "differ": 0.3, "shapes": 4}, cull=False)
    document, _ = parsed(scene.data)
    assert len(document["meshes"]) == scene.report["meshes"] == scene.report["items"][0]["shapes"] == 4
    [item] = scene.report["items"]
    assert (item["instances"], item["shown"], item["shared"], len(item["computed"])) == (8, 8, 4, 4)
    assert len({one["extras"]["etag"] for one in document["meshes"]}) == 4
    # each is as the table says at its own stage: what the first is not
    volumes = sorted({round(float(np.ptp(points, axis=0).prod()), 6) for _, points, *_ in instances(scene.data)})
    assert len(volumes) >= 4
    alike = made({"preset": "raisin", "stage": 0.2, "seed": 1}, cull=False)
    assert alike.report["meshes"] == 1


@pytest.mark.parametrize("place", [0, 1])
def test_what_is_no_number_is_not_taken_for_the_one_that_equals_it(place: int) -> None:
    items = [{"preset": "raisin", "stage": 0.2, "parameters": {"seed": False if i == place else 0}} for i in (0, 1)]
    with pytest.raises(InvalidScene) as caught:
        make(parse({"camera": CAMERA, "items": items}), TABLES, 512, "json")
    assert [one.name for one in caught.value.wrong] == [f"items.{place}.parameters.seed"]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"preset": "raisin", "stage": 0.2, "differ": 0.1}, "seed"),
        ({"preset": "raisin", "stage": 0.2, "differ": 0.9, "seed": 1}, "differ"),
        ({"preset": "orange", "stage": 2, "differ": 0.1, "seed": 1}, "differ"),
        ({"preset": "raisin", "curve": [[0, 0], [1, 0.2]], "variants": [0.1]}, "exclude"),
        ({"preset": "raisin", "stage": 0.2, "variants": [9.0]}, "s"),
    ],
)
def test_what_cannot_differ_is_refused(change: dict[str, Any], word: str) -> None:
    with pytest.raises(InvalidScene) as caught:
        made(change)
    assert any(word in f"{one.name} {one.detail}" for one in caught.value.wrong)


def test_a_prototype_can_be_had_at_other_stages(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdShade

    stages = [0.0, 0.1, 0.3]
    scene = made({"preset": "raisin", "stage": 0.2, "seed": 2, "variants": stages}, "usdc", unit=0.01)
    path = tmp_path / "scene.usdc"
    path.write_bytes(scene.data)
    assert complaints(path) == []
    assert [label.split("=")[1] for label in scene.report["items"][0]["variants"]] == ["0", "0.1", "0.3"]
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/scene/fruits/prototypes/shape0")
    choice = prim.GetVariantSets().GetVariantSet("stage")
    assert choice.GetVariantSelection() == "raisin_s_0_2"
    table = ShapeTable.open(starter.ROOT, "raisin", surfaces=surface)
    worn = set()
    for name, s in (("raisin_s_0_2", 0.2), *((f"raisin_s_{f'{s:g}'.replace('.', '_')}", s) for s in stages)):
        assert choice.SetVariantSelection(name), choice.GetVariantNames()
        mesh = UsdGeom.Mesh(prim)
        points = np.array(mesh.GetPointsAttr().Get())
        n = int(np.sqrt((len(points) - 2) / 2))
        position = table.at(RAISIN_AT, s, resolution=n).position
        assert position is not None
        assert np.abs(np.abs(points[: 2 * n * n]) - np.abs(position.reshape(-1, 3))).max() < 1e-5
        assert len(mesh.GetDisplayColorAttr().Get()) == len(points)
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        worn.add(str(material.GetPath()))
    assert len(worn) == 4  # a drier skin is another one
    # whichever is chosen is within the box by which readers cull
    instancer, now = UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/fruits")), Usd.TimeCode.Default()
    low, high = np.array(instancer.GetExtentAttr().Get())
    for name in choice.GetVariantNames():
        choice.SetVariantSelection(name)
        box = np.array(instancer.ComputeExtentAtTime(now, now))
        assert (box[0] > low - 1e-5).all()
        assert (box[1] < high + 1e-5).all()
    # a file of one stage has no choice
    plain = tmp_path / "plain.usdc"
    plain.write_bytes(made({"preset": "raisin", "stage": 0.2}, "usdc").data)
    single = Usd.Stage.Open(str(plain))
    prim = single.GetPrimAtPath("/scene/fruits/prototypes/shape0")
    assert prim.GetVariantSets().GetNames() == []


def test_what_a_variant_alone_shows_is_not_left_out() -> None:
    """A fresh fruit reaches into the picture where the dry one does not, and less is behind the dry one."""
    pytest.importorskip("pxr")
    item = {"preset": "plum2", "stage": 0.3, "transforms": [{"position": [6.94, 0, 0]}]}

    def told(*items: dict[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = make(parse({"camera": CAMERA, "items": items}), TABLES, 512, "usdc").report
        assert {name for one in found["items"] for name in one} <= SceneItem.model_fields.keys()
        return found

    shown = [told({**item, **more}) for more in ({}, {"variants": [0.0]})]
    assert [report["shown"] for report in shown] == [0, 1]
    front = {"preset": "sphere", "stage": 0.0, "transforms": [{}]}
    back = {"preset": "sphere", "stage": 0.3, "size": 0.75, "transforms": [{"position": [0, 0, -3]}]}
    assert told(front, back)["left_out"]["behind others"] == 1
    offered = told({**front, "variants": [0.3]}, back)
    assert offered["left_out"]["behind others"] == 0
    # and what is said of the item holds for all that can be chosen
    assert offered["items"][0]["exact"] is True
    assert told({**front, "variants": [0.27]})["items"][0]["exact"] is False
    assert told({**front, "seed": 1, "differ": 0.2, "shapes": 3})["items"][0]["shapes"] == 1


def test_a_skin_wears_as_it_dries(tmp_path: Path) -> None:
    """At each knot the colours are those of a still scene at that stage, in glTF and in USD."""
    stages = [0.0, 0.15, 0.3]
    moving = {"preset": "raisin", "curve": [[t, s] for t, s in enumerate(stages)], "transforms": SPOTS[:1]}
    document, binary = parsed(made(moving).data)
    [material] = document["materials"]
    base = np.array(material["pbrMetallicRoughness"]["baseColorFactor"][:3])
    [primitive] = document["meshes"][0]["primitives"]
    first = array(document, binary, primitive["attributes"]["COLOR_0"])[:, :3]
    shown = [first * base]
    shown += [(first + array(document, binary, one["COLOR_0"])[:, :3]) * base for one in primitive["targets"]]
    n = document["meshes"][0]["extras"]["colatitudes"]
    for colours, s in zip(shown, stages, strict=True):
        still, its = parsed(made({"preset": "raisin", "stage": s, "transforms": SPOTS[:1]}).data)
        assert still["meshes"][0]["extras"]["colatitudes"] == n
        worn = np.array(still["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][:3])
        [own] = still["meshes"][0]["primitives"]
        meant = array(still, its, own["attributes"]["COLOR_0"])[:, :3] * worn
        assert np.abs(colours - meant).max() < 2.5 / 255
    assert np.abs(shown[0] - shown[2]).max() > 0.03  # and it does wear
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    path = tmp_path / "scene.usdc"
    path.write_bytes(made(moving, "usdc").data)
    stage = Usd.Stage.Open(str(path))
    paint = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/fruits/prototypes/shape0")).GetDisplayColorAttr()
    assert paint.GetTimeSamples() == [0, 24, 48]
    for frame, colours in zip((0, 24, 48), shown, strict=True):
        assert np.abs(np.array(paint.Get(frame)) - colours).max() < 2.5 / 255
