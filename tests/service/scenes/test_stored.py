"""Stages of stored runs in scenes: made-up runs of known shape and colour, read back out of the files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.spatial import cKDTree

from service.scenes.compose import make
from service.scenes.errors import InvalidScene, OverBudget
from service.scenes.kinds import Runs
from service.scenes.kinds.solid import Solid
from service.scenes.request import parse
from service.shapes.live import LiveTables
from solver import meshes, registry
from solver.contract import Need
from store import starter
from store.ledger.jobs import JobSpec
from store.store import Store

from .._gltf import parsed
from .._runs import rotting, splitting
from ._reading import array, instances
from .test_scenes import CAMERA, complaints

TABLES = LiveTables(starter.ROOT, 60.0)
ROTTEN, SPLIT, NUMBERS = "5a" * 32, "5b" * 32, "6a" * 32
N = 16


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """An orange that rots, under its own question too, and a box that becomes a ball, of 1 cm a unit."""
    store = Store.open(tmp_path_factory.mktemp("scenes") / "store", create=True)
    run = rotting(N)
    run["converged"] = ("stage", [1, 1, 0])
    store.put(ROTTEN, run)
    store.put(SPLIT, splitting())
    store.put(NUMBERS, xr.Dataset({"volume": ("stage", [1.0])}, {"stage": [0.0]}, {"solver": "decay"}))
    return store


def made(store: Store, items: list[dict[str, Any]], to: str = "glb", compress: bool = False, **more: Any) -> Any:
    runs = Runs(lambda: store, lambda asked: (None, "Solve it."))
    return make(parse({"camera": CAMERA, "items": items, **more}), TABLES, 512, to, compress, runs)


def colours(data: bytes, mesh: int = 0) -> np.ndarray:
    document, binary = parsed(data)
    primitive = document["meshes"][mesh]["primitives"][0]
    pbr = document["materials"][primitive["material"]]["pbrMetallicRoughness"]
    return array(document, binary, primitive["attributes"]["COLOR_0"])[:, :3] * pbr["baseColorFactor"][:3]


@pytest.mark.parametrize("compress", [False, True])
def test_a_stage_comes_as_large_and_as_coloured_as_it_is(store: Store, compress: bool) -> None:
    pytest.importorskip("meshoptimizer")
    near = {**CAMERA, "position": [0, 0, 8]}
    found = made(store, [{"run": ROTTEN[:6], "stage": 2, "transforms": [{}]}], compress=compress, camera=near, unit=0.1)
    [(_, world, triangles, _)] = instances(found.data)
    run = store.get(ROTTEN)
    own = run["position"].values[1].reshape(-1, 3) * 0.033  # an orange's r1 in metres
    away, which = cKDTree(own).query(world)
    poles = away > 1e-4
    assert poles.sum() <= 2
    assert away[~poles].max() < 0.033 * 3e-4
    assert len(triangles) == 4 * N * N
    fields = {name: run[name].values[1].ravel() for name in ("rot", "mould", "mould_active")}
    params = json.loads(run.attrs["params"])
    skin = registry.get("decay").looks.paint(fields, params)
    seen = colours(found.data)[~poles]
    assert np.abs(seen - skin.colour[which[~poles]]).max() < 0.005
    assert np.ptp(seen, axis=0).max() > 0.05  # it is not one colour
    [told] = found.report["items"]
    assert told["run"] == ROTTEN
    assert told["metres_per_unit"] == 0.033
    assert told["exact"]
    assert told["converged"]
    assert found.report["missing"] == 0


def test_far_runs_are_coarser_on_vertices_of_their_own(store: Store) -> None:
    pytest.importorskip("meshoptimizer")
    item = {"run": SPLIT, "stage": 2, "size": 1.0}  # an icosphere of 320 triangles
    found = made(store, [{**item, "transforms": [{}, {"position": [0, 0, -150]}]}])
    near, far = sorted(instances(found.data), key=lambda one: -one[1][:, 2].mean())
    assert len(near[2]) == 320
    assert len(far[2]) <= 256
    ball = splitting()["mesh_position"].values[8 : 8 + 162]
    assert np.abs(np.sort(np.linalg.norm(near[1], axis=1)) - 1).max() < 3e-4
    assert cKDTree(ball).query(far[1] + [0, 0, 150])[0].max() < 3e-4
    a, b, c = (far[1][far[2][:, k]] + [0, 0, 150] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 > 0.9 * 4 / 3 * np.pi * 0.95  # closed, and turned outwards
    [told] = found.report["items"]
    assert max(told["coarsened"].values()) > 0
    assert told["reduced"] == 0


def test_a_fine_mesh_has_as_few_triangles_as_are_asked_for() -> None:
    pytest.importorskip("meshoptimizer")
    import trimesh

    ball = trimesh.creation.icosphere(5)
    solid = Solid(((ball.vertices, ball.vertex_normals),), np.asarray(ball.faces), (np.ones((len(ball.vertices), 3)),))
    assert solid.finest == 96
    for n in (8, 16, 32):
        level = solid.level(n)
        assert 3 * n * n < len(level.triangles) <= 4 * n * n
        middle = ball.vertices[level.vertices][level.triangles].mean(axis=1)
        assert 1 - np.linalg.norm(middle, axis=1).min() < 2.5 * level.error * 2 + 1e-3
    assert not solid.is_open
    assert solid.holds(np.array([0.5, 0.5, 0.5]))
    assert not solid.holds(np.array([0.7, 0.7, 0.7]))
    assert np.abs(np.linalg.norm(solid.around, axis=1) - 1).max() < 1e-2
    half = Solid(solid.stages, solid.triangles[ball.triangles_center[:, 1] > 0], solid.colours)
    assert half.is_open


def test_what_is_in_many_parts_is_not_lost_from_afar() -> None:
    pytest.importorskip("meshoptimizer")
    import trimesh

    boxes = [trimesh.creation.box((0.2, 0.01, 0.01)) for _ in range(400)]
    for box, move in zip(boxes, np.random.default_rng(0).uniform(-1, 1, (400, 3)), strict=True):
        box.apply_translation(move)
    heap = trimesh.util.concatenate(boxes)
    solid = Solid(((heap.vertices, heap.vertex_normals),), heap.faces, (np.ones((len(heap.vertices), 3)),))
    level = solid.level(8)
    assert 8 <= len(level.triangles) <= 4 * 256
    left = heap.vertices[level.vertices]
    assert (np.ptp(left, axis=0) > 1.6).all()


def test_without_the_package_meshes_stay_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    import trimesh

    monkeypatch.setitem(sys.modules, "meshoptimizer", None)
    ball = trimesh.creation.icosphere(3)
    solid = Solid(((ball.vertices, ball.vertex_normals),), np.asarray(ball.faces), (np.ones((len(ball.vertices), 3)),))
    assert len(solid.level(8).triangles) == 1280


def test_a_curve_moves_the_vertices_of_a_run_that_keeps_them(store: Store) -> None:
    pytest.importorskip("meshoptimizer")
    found = made(store, [{"run": ROTTEN, "curve": [[0, 0], [1, 2], [3, 5]], "size": 1.0, "transforms": [{}]}])
    document, binary = parsed(found.data)
    [mesh] = document["meshes"]
    [node] = [one for one in document["nodes"] if "mesh" in one]
    grow = np.abs(node["scale"])
    [primitive] = mesh["primitives"]
    base = array(document, binary, primitive["attributes"]["POSITION"]).astype(float) * grow
    last = array(document, binary, primitive["targets"][-1]["POSITION"]).astype(float) * grow
    run = store.get(ROTTEN)["position"].values
    away, which = cKDTree(run[0].reshape(-1, 3)).query(base)
    kept = away < 1e-3
    assert kept.sum() >= len(base) - 2
    assert np.abs(base + last - run[2].reshape(-1, 3)[which])[kept].max() < 1e-3
    assert document["animations"][0]["channels"]
    # and its colours
    pbr = document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][:3]
    faded = array(document, binary, primitive["targets"][-1]["COLOR_0"])
    assert (faded[:, 3] == 0).all()
    last = colours(found.data) + faded[:, :3] * pbr
    fields = {name: store.get(ROTTEN)[name].values[2].ravel() for name in ("rot", "mould", "mould_active")}
    skin = registry.get("decay").looks.paint(fields, json.loads(store.get(ROTTEN).attrs["params"]))
    assert np.abs(last - skin.colour[which])[kept].max() < 0.01
    with pytest.raises(InvalidScene, match="triangles of this run change"):
        made(store, [{"run": SPLIT, "curve": [[0, 0], [1, 2]]}])


def test_usd_holds_the_same(store: Store, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    items = [
        {"run": ROTTEN, "stage": 5, "transforms": [{"position": [-2, 0, 0]}]},
        {"run": SPLIT, "stage": 0, "transforms": [{}]},
    ]
    path = tmp_path / "scene.usdc"
    path.write_bytes(made(store, items, "usdc", unit=0.01).data)
    assert complaints(path) == []
    stage = Usd.Stage.Open(str(path))
    colour = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/fruits/prototypes/shape0")).GetDisplayColorPrimvar().Get()
    assert np.ptp(np.array(colour), axis=0).max() > 0.05
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/fruits"))
    assert np.allclose(instancer.GetScalesAttr().Get(), [[3.3] * 3, [1] * 3])
    box = np.array(UsdGeom.Mesh(stage.GetPrimAtPath("/scene/fruits/prototypes/shape1")).GetPointsAttr().Get())
    assert np.allclose(np.abs(box), 0.5)
    path = tmp_path / "curve.usdc"  # the first is still open, as mapped memory
    path.write_bytes(made(store, [{"run": ROTTEN, "curve": [[0, 0], [1, 5]], "transforms": [{}]}], "usdc").data)
    assert complaints(path) == []
    stage = Usd.Stage.Open(str(path))
    colour = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/fruits/prototypes/shape0")).GetDisplayColorPrimvar()
    assert colour.GetTimeSamples() == [0, 24]
    assert np.abs(np.array(colour.Get(0)) - np.array(colour.Get(24))).max() > 0.05


def test_what_only_took_part_is_left_out_and_rims_show_both_sides(store: Store) -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "f4")
    points = np.concatenate([square, square + np.array([5, 0, 0], "f4")])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    fields = {"inside": np.zeros(8, "f4"), "body": np.repeat([0, 1], 4).astype("f4")}
    data = meshes.changing([meshes.Frame(points, triangles, fields)])
    key = "5c" * 32
    store.put(key, xr.Dataset(data, {"stage": [0.0]}, {"solver": "wood", "metres_per_unit": 1.0, "up": "z"}))
    found = made(store, [{"run": key, "size": "real", "transforms": [{}]}])
    [(_, world, _, _)] = instances(found.data)
    assert np.allclose(np.abs(world[:, [0, 2]]), 0.5, atol=1e-3)  # z-up lies down, about its own middle
    assert np.allclose(world[:, 1], 0, atol=1e-3)
    assert parsed(found.data)[0]["materials"][0]["doubleSided"]


def test_a_run_is_found_by_its_question(store: Store) -> None:
    solver = registry.get("decay")
    params = solver.parse({}, "orange")
    fields = ("position", "rot", "mould", "mould_active")
    need = solver.settle(Need(quality="preview", resolution=12, stages=(0.0, 2.0, 5.0), fields=fields))
    spec = JobSpec.of(solver, params, need)
    store.ledger.want([spec], "test")
    claimed = store.ledger.claim("tester", 60)
    assert claimed is not None
    store.ledger.done(claimed, store.put(spec.key, rotting(12)), 0.1)
    item = {"preset": "orange", "stage": 2}
    assert made(store, [item], "json").report["items"][0]["run"] == spec.key
    fine = made(store, [{**item, "quality": "fine"}], "json").report["items"][0]
    assert fine["placeholder"] == "the fresh shape"
    assert made(store, [{**item, "stage": 3}], "json").report["missing"] == 1


def test_runs_and_tables_stand_in_one_file(store: Store) -> None:
    items = [
        {"preset": "raisin", "stage": 0.2, "size": "real", "transforms": [{"position": [-3, 0, 0]}]},
        {"run": ROTTEN, "stage": 2, "transforms": [{}]},
        {"run": SPLIT, "stage": 2, "transforms": [{"position": [3, 0, 0]}]},
    ]
    found = made(store, items, unit=0.01, budget={"triangles": 3000})
    raisin, orange, ball = (world.max(axis=0) - world.min(axis=0) for _, world, *_ in instances(found.data))
    assert 0.012 < raisin.max() < 0.018
    assert 0.04 < orange.max() < 0.07
    assert abs(ball.max() - 0.02) < 1e-4
    assert found.report["triangles"] <= 3000
    etags = [mesh["extras"]["etag"] for mesh in parsed(found.data)[0]["meshes"]]
    again = made(store, items, unit=0.01, budget={"triangles": 3000}, known=etags)
    assert len(again.data) < 0.3 * len(found.data)
    with pytest.raises(OverBudget):
        made(store, items, budget={"triangles": 30})


def test_what_stands_on_a_fruit_is_drawn_and_bears_nothing(store: Store) -> None:
    """Threads rise from mould alone, stem and calyx stand at a pole, and it rests where it rests without them."""
    near = {"position": [0, 3, 5], "height": 2000, "width": 3000}
    floor = {"places": [{"name": "floor", "rule": "pile", "seed": 1}], "camera": near}
    item = {"run": ROTTEN, "stage": 5, "count": 2, "seed": 1, "place": "floor", "size": 1.0}
    bare, full = made(store, [item], **floor), made(store, [{**item, "full": True}], **floor)
    pairs = zip(instances(bare.data), instances(full.data), strict=True)
    for (_, plain, triangles, _), (_, dressed, more, _) in pairs:
        assert len(more) > len(triangles) + 100
        # a level's triangles are for all of it, so that its body may have lost some
        assert cKDTree(dressed).query(plain)[0].max() < 0.01
        standing = dressed[cKDTree(plain).query(dressed)[0] > 0.03]
        height = np.linalg.norm(standing - plain.mean(axis=0), axis=1)
        assert len(standing) > 50
        assert height.max() > 1.02 * np.linalg.norm(plain - plain.mean(axis=0), axis=1).max()
    sound = made(store, [{**item, "stage": 0, "full": True}], **floor)
    assert sound.report["triangles"] < full.report["triangles"]
    assert parsed(full.data)[0]["materials"][0]["doubleSided"]


def test_one_run_bare_and_dressed_is_two_shapes(store: Store) -> None:
    bare = {"run": ROTTEN, "stage": 5, "transforms": [{}]}
    dressed = {**bare, "full": True, "transforms": [{"position": [3, 0, 0]}]}
    found = made(store, [bare, dressed, {**dressed, "transforms": [{"position": [-3, 0, 0]}]}], "json").report
    assert found["kinds"] == 2


WRONG: list[tuple[dict[str, Any], str, str]] = [
    ({"run": "ffff0000"}, "no result has a key", "wizen results"),
    ({"run": "5" * 4}, "no result has a key", "wizen results"),
    ({"run": "5"}, "pattern", ""),
    ({"run": "0" * 64}, "nothing is stored", "wizen results"),
    ({"run": ROTTEN, "stage": 3}, "no stage 3", "0, 2, 5"),
    ({"run": ROTTEN, "preset": "orange"}, "leave out solver", ""),
    ({"run": NUMBERS}, "no whole surface", "position"),
    ({"run": ROTTEN, "shade": "plum"}, "no skin", ""),
    ({"preset": "orange", "stage": 500}, "outside", "range"),
    ({"preset": "mushroom", "stage": 1, "size": "real"}, "nobody knows how large", "size = 1.0"),
    ({"preset": "mushroom", "parameters": {"shape": "cube"}, "stage": 1}, "shape", ""),
    ({"preset": "raisin", "parameters": {"te": "thin"}, "stage": 0.1}, "numbers", "source"),
    ({"preset": "raisin", "quality": "fine", "stage": 0.1}, "quality", "source"),
    ({"preset": "raisin", "parameters": {"te": float("nan")}, "stage": 0.1}, "finite", ""),
    ({"preset": "raisin", "stage": 0.1, "full": True}, "nothing stands on what tables hold", "Leave it out"),
    ({"run": ROTTEN, "curve": [[0, 0], [1, 5]], "full": True}, "full and a curve exclude each other", ""),
]


@pytest.mark.parametrize(("item", "why", "advice"), WRONG)
def test_what_is_wrong_is_said(store: Store, item: dict[str, Any], why: str, advice: str) -> None:
    with pytest.raises(InvalidScene) as caught:
        made(store, [item], "json")
    assert why in caught.value.message
    assert advice in caught.value.advice
