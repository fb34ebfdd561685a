"""`full`: stem, threads, and pictures finer than the mesh, as plain parsers find them in GLB and USDZ."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade

from service.sequences import EXPORTS, Options, of_run, write
from service.sequences.skins import slopes
from solver import registry
from solver.contract import Need

from . import _materialx
from ._gltf import accessor, parsed

FULL = Options(full=True, textures=512, threads=800)


@pytest.fixture(scope="module")
def run() -> xr.Dataset:
    solver = registry.get("decay")
    need = Need(fields=(*solver.default_fields, "position"), stages=(0.0, 5.0), quality="preview", resolution=32)
    wounds = {"wounds": [{"colatitude": 60, "radius": 0.3}], "humidity": 90, "exocarp_thickness": 0.02}
    return solver.solve(solver.parse(wounds, preset="orange"), need)


def picture(document: dict, binary: bytes, texture: int) -> np.ndarray:
    image = document["images"][document["textures"][texture]["source"]]
    view = document["bufferViews"][image["bufferView"]]
    start = view.get("byteOffset", 0)
    return np.asarray(Image.open(io.BytesIO(binary[start : start + view["byteLength"]]))).astype(float)


def test_slopes_are_those_of_a_height_on_a_ball() -> None:
    n = 240
    down, along = (np.arange(n) + 0.5) * np.pi / n, (np.arange(n) + 0.5) * 2 * np.pi / n
    colatitude, azimuth = np.meshgrid(down, along, indexing="ij")
    x, y, z = np.sin(colatitude) * np.cos(azimuth), np.cos(colatitude), np.sin(colatitude) * np.sin(azimuth)
    places = 1.7 * np.stack([x, y, z], axis=-1)
    inner = slice(n // 12, -n // 12)
    for height, by_u, up in (
        (0.1 * y, 0 * x, 0.1 * np.sin(colatitude)),
        (0.1 * x, -0.1 * np.sin(azimuth), -0.1 * np.cos(colatitude) * np.cos(azimuth)),
    ):
        found = slopes(places, height, wraps=True)
        assert np.abs(found[inner, :, 0] - by_u[inner] / 1.7).max() < 1e-3
        assert np.abs(found[inner, :, 1] - up[inner] / 1.7).max() < 1e-3


def test_a_glb_has_stem_calyx_threads_and_pictures_for_each_stage(run: xr.Dataset) -> None:
    document, binary = parsed(write(of_run(run), EXPORTS["animation"], FULL))
    names = [[document["materials"][p["material"]]["name"] for p in mesh["primitives"]] for mesh in document["meshes"]]
    assert names == [["skin 0", "stem", "calyx"], ["skin 5", "stem", "calyx", "hyphae"]]
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:  # tips of sepals too, which have no area
            upright = accessor(document, binary, primitive["attributes"]["NORMAL"])
            assert np.abs(np.linalg.norm(upright, axis=1) - 1).max() < 1e-5
        skin = document["materials"][mesh["primitives"][0]["material"]]
        pbr = skin["pbrMetallicRoughness"]
        assert pbr["roughnessFactor"] == 1.0
        assert pbr["metallicFactor"] == 0.0
        normal = picture(document, binary, skin["normalTexture"]["index"]) / 127.5 - 1
        assert np.abs(np.linalg.norm(normal, axis=-1) - 1).max() < 0.02
        assert 0.02 < normal[..., :2].std() < 0.5
        points = accessor(document, binary, mesh["primitives"][0]["attributes"]["POSITION"])
        stem = accessor(document, binary, mesh["primitives"][1]["attributes"]["POSITION"])
        pole = points[np.argmax(points[:, 1])]
        assert np.linalg.norm(stem - pole, axis=1).max() < 0.2
        assert stem[:, 1].max() > pole[1] + 0.03
    # felt is dull where the field has mould, and nowhere is it duller than felt
    skin = document["materials"][document["meshes"][1]["primitives"][0]["material"]]
    rough = picture(document, binary, skin["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"])[..., 1]
    mould = of_run(run).baked(np.r_[run["mould"].values[1].ravel(), 0, 0], 512)
    rot = of_run(run).baked(np.r_[run["rot"].values[1].ravel(), 0, 0], 512)
    assert rough[mould > 0.6].min() > 250
    wet = rough[(rot > 0.3) & (mould < 0.02)]
    assert len(wet) > 50
    assert np.abs(wet.mean() / 255 - 0.42) < 0.03


def test_without_it_files_are_as_they_were(run: xr.Dataset) -> None:
    document, _ = parsed(write(of_run(run), EXPORTS["animation"], Options()))
    assert [len(mesh["primitives"]) for mesh in document["meshes"]] == [1, 1]
    assert "images" not in document
    first, second = (document["materials"][mesh["primitives"][0]["material"]] for mesh in document["meshes"])
    dull = [m["pbrMetallicRoughness"]["roughnessFactor"] for m in (first, second)]
    assert dull == pytest.approx([s.roughness.mean() for s in of_run(run)], abs=0.006)
    assert dull[1] > dull[0] + 0.03


def test_usdz_has_normals_height_and_light_below_the_skin(run: xr.Dataset, tmp_path: Path) -> None:
    path = tmp_path / "run.usdz"
    path.write_bytes(write(of_run(run), EXPORTS["usdz"], FULL))
    stage = Usd.Stage.Open(str(path))
    for name in ("stem", "calyx"):
        assert len(UsdGeom.Mesh(stage.GetPrimAtPath(f"/decay/{name}")).GetPointsAttr().Get(13)) > 50
    assert len(UsdGeom.BasisCurves(stage.GetPrimAtPath("/decay/hyphae")).GetPointsAttr().Get(13)) > 0
    found = _materialx.materials(stage)
    assert [_materialx.complaints(material) for material in found] == [""] * len(found)
    skin = next(m for m in found if m.GetPath().name == "material0")
    _, values = _materialx.read(skin)
    assert values["standard_surface"]["subsurface"] == pytest.approx(0.25)
    surface = UsdShade.Shader(stage.GetPrimAtPath("/decay/material0/surface"))
    for word, kind in (("normal", "normal"), ("displacement", "displacement"), ("roughness", "roughness")):
        source = UsdShade.Shader(surface.GetInput(word).GetConnectedSources()[0][0].source)
        assert source.GetPath().name == kind
        assert source.GetInput("file").GetAttr().GetTimeSamples() == [1.0, 13.0]
    scale = UsdShade.Shader(stage.GetPrimAtPath("/decay/material0/normal"))
    assert tuple(scale.GetInput("scale").Get()) == (2, 2, 2, 2)
    assert tuple(scale.GetInput("bias").Get()) == (-1, -1, -1, -1)
    with zipfile.ZipFile(path) as archive:
        height, normal = (
            np.asarray(Image.open(io.BytesIO(archive.read(f"{name}0.png"))), float)
            for name in ("displacement", "normal")
        )
    # what rises to the right leans to the left, and what rises upwards leans down
    belt = slice(100, -100)
    for channel, axis, sign in ((0, 1, -1), (1, 0, 1)):
        rise = np.gradient(height, axis=axis)[belt]
        assert np.corrcoef(sign * rise.ravel(), normal[belt, :, channel].ravel())[0, 1] > 0.8
    # pores are as deep as the peel says, and felt stands out
    tall = UsdShade.Shader(stage.GetPrimAtPath("/decay/material0/displacement"))
    assert tall.GetInput("bias").Get(1.0)[0] == pytest.approx(-0.006, abs=5e-4)
    span, low = tall.GetInput("scale").Get(13.0)[0], tall.GetInput("bias").Get(13.0)[0]
    assert 0.003 < span + low < 0.0096


def test_full_says_nothing_more_of_a_mesh_without_coordinates_or_of_other_colours(run: xr.Dataset) -> None:
    from dataclasses import replace

    document, _ = parsed(write(replace(of_run(run), colour="rot"), EXPORTS["animation"], FULL))
    assert all(len(mesh["primitives"]) == 1 for mesh in document["meshes"])


def test_a_bowl_of_several_kinds_has_each_ones_skin_stems_and_the_bowl() -> None:
    solver = registry.get("decay")
    kinds = [{"preset": "apple"}, {"preset": "pear"}, {"preset": "orange"}]
    heap = {"kinds": kinds, "places": [(0, 1.6, 0), (2.6, 1.9, 0), (-2.7, 1.8, 0)], "bowl": 5.0, "infected": [0, 2]}
    params = solver.parse({"heap": heap, "wounds": [{"colatitude": 60}]}, preset="apple")
    found = solver.solve(params, Need(stages=(0.0, 6.0), quality="preview"))
    sequence = of_run(found)
    document, binary = parsed(write(sequence, EXPORTS["animation"], FULL))
    names = [[document["materials"][p["material"]]["name"] for p in mesh["primitives"]] for mesh in document["meshes"]]
    assert names == [["skin 0", "bowl", "stem", "calyx"], ["skin 6", "bowl", "stem", "calyx", "hyphae"]]
    first = document["meshes"][0]["primitives"]
    bowl, stems = (accessor(document, binary, part["attributes"]["POSITION"]) for part in first[1:3])
    assert np.isclose(bowl[:, 1].min(), 0, atol=1e-6)
    # a stem of each fruit, and at each one's top
    points = found["mesh_position"].values[0]
    count = len(stems) // 3
    for b in range(3):
        own, stem = points[found["fruit"].values == b], stems[count * b : count * (b + 1)]
        top = own[np.argmax(own[:, 1])]
        assert np.linalg.norm(stem[:, [0, 2]] - top[[0, 2]], axis=1).max() < 0.35
        assert stem[:, 1].max() > top[1] + 0.03
    # fresh skins: the pear's is greener than it is red, the orange's and the apple's are not
    surface = next(iter(sequence))
    tint = [surface.colour[found["fruit"].values == b].mean(axis=0) for b in range(3)]
    assert tint[1][1] > 0.8 * tint[1][0]
    assert tint[2][0] > 2.5 * tint[2][1]
    assert tint[0][0] > 4 * tint[0][1]
    # pores belong to places of each fruit, in its own frame
    fresh = sequence.fresh
    for b in range(3):
        assert np.abs(fresh[found["fruit"].values == b].mean(axis=0)).max() < 0.2
