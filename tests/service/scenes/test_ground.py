"""Things that stand on a mesh: as many as its area asks for, along its normals, apart, and refused where none can."""

from __future__ import annotations

import io
import json
import math
import struct
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from service.cli import app
from service.errors import TimedOut
from service.limits import waited
from service.scenes import scattering
from service.scenes.errors import InvalidScene
from service.scenes.ground import across
from service.scenes.request import parse
from solver.registry import surface
from store import starter
from store.lookup import ShapeTable

from .._gltf import parsed
from .._shapes import RAISIN_AT
from ._reading import instances, placed
from .test_scenes import made

HILL = trimesh.creation.icosphere(subdivisions=3, radius=6.0)
AWAY = {"position": [0, 0, 40], "fov": 40, "width": 640, "height": 480}


def given(mesh: trimesh.Trimesh) -> dict[str, Any]:
    return {"points": mesh.vertices.tolist(), "faces": mesh.faces.tolist()}


def on(mesh: dict[str, Any], count: int, seed: int = 1, size: float = 0.4, **more: Any) -> dict[str, Any]:
    item = {"preset": "raisin", "stage": 0.2, "size": size, "count": count, "seed": 5, "vary": 0.2, "place": "hill"}
    place = {"name": "hill", "rule": "scatter", "mesh": mesh, "seed": seed, **more}
    return {"items": [item], "places": [place], "camera": AWAY, "cull": False}


def scattered(mesh: dict[str, Any], count: int, to: str = "glb", **more: Any) -> Any:
    return made(to=to, **on(mesh, count, **more))


def poses(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle and the own y axis of every instance."""
    document, binary = parsed(data)
    root = document["nodes"][document["scenes"][0]["nodes"][0]]
    at, up = [], []
    for node in (document["nodes"][i] for i in root["children"]):
        if "etag" in document["meshes"][node["mesh"]].get("extras", {}):
            (move, turn, _), mirror = placed(document, binary, node)
            at.append(move * mirror)
            up.append(Rotation.from_quat(turn).apply([0, 1, 0]) * mirror)
    return np.concatenate(at), np.concatenate(up)


def below(mesh: trimesh.Trimesh, middle: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return where a line along `up` through a point meets the triangle that has `up` as its normal."""
    for face in np.flatnonzero(mesh.face_normals @ up > 1 - 1e-6):
        a, b, c = mesh.triangles[face]
        shares = np.linalg.solve(np.stack([b - a, c - a, up], axis=1), middle - a)
        if shares[:2].min() > -1e-3 and shares[:2].sum() < 1 + 1e-3 and shares[2] > 0:
            return np.asarray(middle - shares[2] * up)
    raise AssertionError("it stands on none of the triangles")


def test_things_stand_on_a_hill_along_its_normals_apart() -> None:
    scene = scattered(given(HILL), 60, at=[1.0, 2.0, 3.0])
    middles, ups = poses(scene.data)
    assert len(middles) == 60
    found = instances(scene.data)
    shape = ShapeTable.open(starter.ROOT, "raisin", surfaces=surface).at(RAISIN_AT, 0.2, resolution=128)
    assert shape.position is not None
    whole = np.concatenate([shape.position.reshape(-1, 3), shape.poles])
    moved = HILL.copy().apply_translation([1, 2, 3])
    feet = []
    for (_, world, *_), middle, up in zip(found, middles, ups, strict=True):
        # straight below its middle is the triangle whose normal it has
        foot = below(moved, middle, up)
        size = np.ptp(world @ up) / np.ptp(whole[:, 1])
        # it touches that plane with its lowest point, as near as its lattice of so few colatitudes has that point
        assert np.min((world - foot) @ up) == pytest.approx(0, abs=0.02 * size)
        feet.append((foot, size * np.hypot(whole[:, 0], whole[:, 2]).max()))
    for i, (a, p) in enumerate(feet):
        assert all(np.linalg.norm(a - b) > 0.98 * (p + q) for b, q in feet[:i])
    document, _ = parsed(scene.data)
    assert "ground" in {mesh["name"] for mesh in document["meshes"]}


def test_places_follow_the_area_and_the_seed() -> None:
    # one square of 30 x 30, and one of 30 x 90 cut into many small triangles: a quarter stands on the first
    first = [[0, 0, 0], [30, 0, 0], [30, 30, 0], [0, 30, 0]]
    grid = [[40 + 90 * i / 20, 30 * j / 20, 0] for i in range(21) for j in range(21)]
    faces = [[0, 1, 2], [0, 2, 3]]
    for i in range(20):
        for j in range(20):
            a, b = 4 + 21 * i + j, 4 + 21 * (i + 1) + j
            faces += [[a, b, b + 1], [a, b + 1, a + 1]]
    mesh = {"points": first + grid, "faces": faces}
    count = 1200
    one = scattered(mesh, count, size=0.2)
    middles, ups = poses(one.data)
    share = float((middles[:, 0] < 35).mean())
    assert share == pytest.approx(0.25, abs=4 * math.sqrt(0.25 * 0.75 / count))
    assert ups[:, 2].min() > 1 - 1e-6
    # within a square all is even: quarters of its width
    quarters = np.histogram(middles[middles[:, 0] > 35, 0], np.linspace(40, 130, 5))[0] / (0.75 * count)
    assert np.abs(quarters - 0.25).max() < 0.06
    assert scattered(mesh, count, size=0.2).data == one.data
    assert scattered(mesh, count, size=0.2, seed=2).data != one.data


@pytest.mark.parametrize("seed", range(8))
def test_feet_stand_where_all_that_stand_already_are_looked_at(seed: int) -> None:
    """Feet of all sizes on triangles of all sizes, near the origin or far from it, with room for all or not."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(30, 3)) * 10.0 ** (seed - 4) + seed % 2 * 100.0
    faces = np.arange(30).reshape(-1, 3)
    area = np.linalg.norm(across(points, faces), axis=1)
    wide = np.sqrt((0.05 + 0.1 * seed) * area.sum() / 500)
    feet = np.sort(wide * 10.0 ** random.uniform(-(seed % 3), 0, 250))[::-1]
    at, on = scattering._apart(np.random.default_rng(seed), points, faces, area, feet)
    again, stood = np.random.default_rng(seed), 0
    share = np.cumsum(area) / area.sum()
    for foot in feet:
        for _ in range(200):
            triangle, (u, v) = np.searchsorted(share, again.random(), side="right"), again.random(2)
            u, v = (1 - u, 1 - v) if u + v > 1 else (u, v)
            a, b, c = points[faces[triangle]]
            place = a + u * (b - a) + v * (c - a)
            if (((at[:stood] - place) ** 2).sum(axis=1) >= (feet[:stood] + foot) ** 2).all():
                break
        else:
            break
        assert (at[stood] == place).all()
        assert on[stood] == triangle
        stood += 1
    assert len(at) == stood


SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


def spread(count: int) -> int:
    """Return how many of so many feet stood on a square of which they need two fifths."""
    feet = np.full(count, math.sqrt(0.4 / math.pi / count))
    faces, area = np.array([[0, 1, 2], [0, 2, 3]]), np.ones(2)
    return len(scattering._apart(np.random.default_rng(0), SQUARE, faces, area, feet)[0])


def test_who_waits_no_more_stops_what_is_scattered() -> None:
    with waited.begin({}) as wait:
        wait.over = True
        with pytest.raises(TimedOut):
            spread(10)


def test_eight_times_as_many_take_about_eight_times_as_long() -> None:
    """64 times where each is held against all others."""
    times = []
    for count in (700, 5600):
        begin = time.process_time()
        assert spread(count) > 0.9 * count
        times.append(time.process_time() - begin)
    assert times[1] < 20 * times[0]


def test_usd_has_the_mesh_and_what_stands_on_it() -> None:
    pxr = pytest.importorskip("pxr.Usd")
    data = scattered(given(HILL), 8, to="usda").data.decode()
    from pxr import Sdf, UsdGeom

    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(data)
    stage = pxr.Stage.Open(layer)
    ground = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/ground0"))
    assert np.allclose(ground.GetPointsAttr().Get(), HILL.vertices, atol=1e-5)
    assert len(UsdGeom.PointInstancer(stage.GetPrimAtPath("/scene/fruits")).GetPositionsAttr().Get()) == 8


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"rule": "bowl", "radius": 3.0}, "has no mesh"),
        ({"radius": 3.0}, "exclude"),
        ({"mesh": None}, "a radius or a mesh"),
        ({"mesh": {"points": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 3]]}}, "not there"),
        ({"mesh": {"points": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 10**30]]}}, "not there"),
        ({"mesh": {"points": [[0, 0, 0], [1, 0, 0], [2, 0, 0]], "faces": [[0, 1, 2]]}}, "no area"),
        ({"mesh": {"points": [[0, 0, math.nan], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}}, "finite"),
        ({"mesh": {"points": [[0, 0, 1e300], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}}, "another unit"),
        ({"mesh": "hill.obj"}, "points and faces"),
    ],
)
def test_meshes_that_nothing_can_stand_on_are_refused(change: dict[str, Any], word: str) -> None:
    scene = on(given(HILL), 3)
    scene["places"] = [{**scene["places"][0], **change}]
    with pytest.raises(InvalidScene) as refused:
        parse(scene)
    assert word in str(refused.value)


def test_a_mesh_that_is_too_small_says_how_many_it_holds() -> None:
    with pytest.raises(InvalidScene, match=r"200 things .* found room for \d+ on the mesh"):
        scattered(given(HILL), 200, size=2.0)


def test_the_command_reads_a_file_beside_the_scene(tmp_path: Path) -> None:
    (tmp_path / "hill.stl").write_bytes(HILL.export(file_type="stl"))
    text = """
    [camera]
    position = [0, 0, 40]
    [[places]]
    name = "hill"
    rule = "scatter"
    mesh = "NAME"
    [[items]]
    preset = "raisin"
    stage = 0.2
    size = 0.4
    count = 12
    seed = 1
    place = "hill"
    """
    (tmp_path / "good.toml").write_text(text.replace("NAME", "hill.stl"))
    out = tmp_path / "out.glb"
    done = CliRunner().invoke(app, ["scene", str(tmp_path / "good.toml"), "--out", str(out), "--plain"])
    assert done.exit_code == 0, done.output
    whole = trimesh.load_scene(io.BytesIO(out.read_bytes()), file_type="glb")
    assert any(len(one.faces) == len(HILL.faces) for one in whole.geometry.values())
    # one that promises more than it holds
    (tmp_path / "evil.stl").write_bytes(bytes(80) + struct.pack("<I", 10**9) + bytes(50))
    (tmp_path / "bad.toml").write_text(text.replace("NAME", "evil.stl"))
    refused = CliRunner().invoke(app, ["scene", str(tmp_path / "bad.toml")])
    assert refused.exit_code != 0
    gone = CliRunner().invoke(app, ["scene", str(tmp_path / "gone.toml")])
    assert "cannot be read: No such file" in " ".join(gone.output.split())
    assert "Errno" not in gone.output


def test_parameters_of_an_item_bring_the_files_beside_them(tmp_path: Path) -> None:
    folder = tmp_path / "plants"
    folder.mkdir()
    (folder / "bud.stl").write_bytes(HILL.export(file_type="stl"))
    (folder / "bud.toml").write_text('mesh = "@bud.stl"\ntools = []\nthickness = 0.01\n')
    file = tmp_path / "scene.toml"
    file.write_text(
        '[camera]\nposition = [0, 0, 40]\n[[items]]\nsolver = "growth"\nparams = "plants/bud.toml"\nstage = 1\n'
    )
    done = CliRunner().invoke(app, ["scene", str(file), "--json"])
    assert done.exit_code == 0, done.output
    [item] = json.loads(done.stdout)["items"]
    assert item["placeholder"] == "a box as large as it is at the start"
    assert item["missing"]["why"]


@pytest.mark.parametrize("where", ["nowhere/out.glb", "there.glb"])
def test_where_it_is_to_be_written_is_looked_at_before_work(tmp_path: Path, where: str) -> None:
    (tmp_path / "there.glb").mkdir()
    file = tmp_path / "scene.toml"
    file.write_text('[camera]\nposition = [0, 0, 40]\n[[items]]\npreset = "raisin"\nstage = 0.2\n')
    done = CliRunner().invoke(app, ["scene", str(file), "--out", str(tmp_path / where)])
    assert done.exit_code == 2
    assert "Create it first." in done.stderr if "nowhere" in where else "is a directory" in done.stderr
    assert not (tmp_path / "nowhere").exists()
