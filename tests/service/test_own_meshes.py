"""A mesh of one's own through to GLB and USD: texture coordinates to the bit, order, materials; maps on them."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade

from service.sequences import EXPORTS, STILLS, Options, of_run, prepared, write
from service.sequences.matter import _prims
from solver.contract import Need
from solver.decay import SOLVER
from sweeps.commands.terminal.meshfile import read

from . import _materialx
from ._gltf import parsed


def ring(path: Path, around: int = 24, across: int = 12) -> dict:
    """Write a ring with a seam both ways and two materials as OBJ, and return what is read of it."""
    lines = []
    for i in range(around):
        for j in range(across):
            a, b = 2 * np.pi * i / around, 2 * np.pi * j / across
            far = 1 + 0.4 * np.cos(b)
            lines.append(f"v {far * np.cos(a):.9g} {0.4 * np.sin(b):.9g} {far * np.sin(a):.9g}")
    # numbers that no float holds
    lines += [
        f"vt {0.013 + 0.97 * i / around:.9g} {0.021 + 0.93 * j / across:.9g}"
        for i in range(around + 1)
        for j in range(across + 1)
    ]
    for i in range(around):
        if i in (0, around // 2):
            lines.append(f"usemtl {'peel' if i == 0 else 'other half'}")
        for j in range(across):
            corners = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
            words = [f"{(a % around) * across + b % across + 1}/{a * (across + 1) + b + 1}" for a, b in corners]
            lines.append("f " + " ".join(words))
    path.write_text("\n".join(lines) + "\n")
    return read(path)


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> dict:
    return ring(tmp_path_factory.mktemp("ring") / "ring.obj")


@pytest.fixture(scope="module")
def rotten(given: dict) -> xr.Dataset:
    params = SOLVER.parse({"mesh": given, "wounds": [{"vertex": 40}]}, preset="apple")
    need = Need(fields=SOLVER.default_fields, stages=(0.0, 9.0), quality="preview")
    return SOLVER.solve(params, need)


def test_what_is_read_keeps_order_corners_and_materials(given: dict) -> None:
    assert np.shape(given["points"]) == (24 * 12, 3)
    assert np.shape(given["uv"]) == (25 * 13, 2)
    assert given["uv_faces"][0] == [0, 1, 14]
    assert given["materials"] == ["peel", "other half"]
    assert np.bincount(given["face_materials"]).tolist() == [288, 288]


def test_glb_and_usd_hold_the_mesh_s_own_texture_coordinates(given: dict, rotten: xr.Dataset, tmp_path: Path) -> None:
    uv, corners = np.array(given["uv"]), np.array(given["uv_faces"])
    path = tmp_path / "ring.usdc"
    path.write_bytes(write(of_run(rotten), EXPORTS["usdc"], Options()))
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    flat = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").ComputeFlattened())
    assert flat.tobytes() == uv.astype("f4")[corners.ravel()].tobytes()
    assert np.allclose(np.array(mesh.GetPointsAttr().Get(1)), given["points"], atol=1e-6)
    assert np.array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), given["faces"])
    subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
    assert [len(subset.GetIndicesAttr().Get()) for subset in subsets] == [288, 288]
    bound = [UsdShade.MaterialBindingAPI(s).ComputeBoundMaterial()[0].GetPrim().GetDisplayName() for s in subsets]
    assert bound == ["peel", "other half"]
    # Blender shows the prim's name, and no other
    prims = [UsdShade.MaterialBindingAPI(s).ComputeBoundMaterial()[0].GetPrim().GetName() for s in subsets]
    assert prims == ["peel", "other_half"]
    # written as glTF and read again, nothing has moved by a bit
    path = tmp_path / "ring.glb"
    path.write_bytes(write(prepared(rotten, Options(), 0.0), EXPORTS["animation"], Options()))
    again = read(path)
    down = (1 - uv[:, 1]).astype("f4").astype(float)
    assert np.array_equal(np.array(again["uv"])[:, 0], uv[:, 0].astype("f4").astype(float))
    assert np.array_equal(1 - np.array(again["uv"])[:, 1], down)
    assert again["uv_faces"] == given["uv_faces"]
    assert again["materials"] == given["materials"]
    path.write_bytes(write(prepared(fresh(again), Options(), 0.0), EXPORTS["animation"], Options()))
    assert read(path)["uv"] == again["uv"]


def test_obj_says_of_which_material_each_triangle_is(given: dict, rotten: xr.Dataset, tmp_path: Path) -> None:
    path = tmp_path / "ring.obj"
    path.write_bytes(STILLS["obj"](prepared(rotten, Options(), 9.0), Options()))
    again = read(path)
    assert again["materials"] == given["materials"]
    assert again["face_materials"] == given["face_materials"]
    assert again["faces"] == given["faces"]
    run = rotten.assign_attrs(materials=json.dumps(["two\nlines", ""]))
    words = [line for line in STILLS["obj"](prepared(run, Options(), 9.0), Options()).splitlines() if b"usemtl" in line]
    assert words == [b"usemtl two lines", b"usemtl skin"]


def fresh(given: dict) -> xr.Dataset:
    need = Need(fields=("rot",), stages=(0.0,), quality="preview")
    return SOLVER.solve(SOLVER.parse({"mesh": given, "wounds": [{"vertex": 4}]}, preset="apple"), need)


def test_textures_and_maps_lie_on_them(given: dict, rotten: xr.Dataset) -> None:
    options = Options(map="rot", size=256)
    sequence = prepared(rotten, options, 9.0)
    picture = Image.open(io.BytesIO(write(sequence, EXPORTS["png"], options)))
    drawn = np.asarray(picture, float) / 65535
    rot, uv = rotten.rot[1].values, np.array(given["uv"])
    of_corner = np.zeros(len(uv), int)
    of_corner[np.array(given["uv_faces"])] = given["faces"]
    column, row = (256 * uv[:, 0]).astype(int), (256 * (1 - uv[:, 1])).astype(int)
    assert rot.max() > 0.5
    assert np.abs(drawn[row, column] - rot[of_corner]).max() < 0.25  # a texel off where the front is steep
    assert np.abs(drawn[row, column] - rot[of_corner]).mean() < 0.01
    document, _ = parsed(write(prepared(rotten, Options(), 9.0), EXPORTS["animation"], Options(textures=64)))
    assert len(document["images"]) == 2
    assert [m["name"] for m in document["materials"]] == ["peel 9", "other half 9"]
    assert len(document["meshes"][0]["primitives"]) == 2


def test_a_mesh_without_texture_coordinates_is_unwrapped(tmp_path: Path) -> None:
    pytest.importorskip("xatlas")
    ball = trimesh.creation.icosphere(subdivisions=2)
    run = fresh({"points": np.asarray(ball.vertices).tolist(), "faces": np.asarray(ball.faces).tolist()})
    sequence = of_run(run)
    assert sequence.seam is None
    seam = sequence.unwrapped().seam
    assert seam is not None
    assert np.array_equal(seam.copies[seam.triangles], run.triangle.values)
    assert seam.uv.min() >= 0
    assert seam.uv.max() <= 1
    drawn = sequence.unwrapped().baked(np.full(len(ball.vertices), 0.7, "f4"), 64)
    assert drawn == pytest.approx(0.7)  # between the charts too


def test_a_usdz_has_each_stage_s_textures_on_the_mesh_s_own_coordinates(
    given: dict, rotten: xr.Dataset, tmp_path: Path
) -> None:
    path = tmp_path / "ring.usdz"
    path.write_bytes(write(of_run(rotten), EXPORTS["usdz"], Options(textures=64, step=12)))
    stage = Usd.Stage.Open(str(path))
    st = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/decay")).GetPrimvar("st")
    assert np.array(st.Get()).tobytes() == np.array(given["uv"], np.float32).tobytes()
    assert np.array_equal(np.array(st.GetIndices()).reshape(-1, 3), given["uv_faces"])
    shaders = [UsdShade.Shader(p) for p in stage.Traverse() if p.IsA(UsdShade.Shader)]
    textures = [s for s in shaders if s.GetIdAttr().Get() == "UsdUVTexture"]
    assert len(textures) == 2 * 2  # colour and roughness of two materials
    asset = next(t for t in textures if t.GetPath().name == "diffuseColor").GetInput("file").GetAttr()
    assert list(asset.GetTimeSamples()) == [1, 13]
    archive = zipfile.ZipFile(path)
    assert archive.namelist()[0] == "result.usdc"
    assert all(info.compress_type == zipfile.ZIP_STORED and _data(path, info) % 64 == 0 for info in archive.infolist())
    fresh, old = (
        np.asarray(Image.open(io.BytesIO(archive.read(asset.Get(at).path))), float).reshape(-1, 3) for at in (1, 13)
    )
    assert len(fresh) == 64**2
    # it rots: a quarter of the texels are no longer red
    assert (fresh[:, 0] > 2 * fresh[:, 1]).mean() > 0.9
    assert (old[:, 0] > 2 * old[:, 1]).mean() < 0.85


@pytest.mark.parametrize("name", ["usdc", "usdz"])
def test_materials_are_materialx_too(rotten: xr.Dataset, tmp_path: Path, name: str) -> None:
    """As its own library reads them: from the vertices, or from the pictures that the preview surface takes."""
    path = tmp_path / f"ring.{name}"
    path.write_bytes(write(of_run(rotten), EXPORTS[name], Options(textures=64, step=12)))
    found = _materialx.materials(stage := Usd.Stage.Open(str(path)))
    assert len(found) == 2
    for material in found:
        assert _materialx.complaints(material) == ""
        _, values = _materialx.read(material)
        assert values["standard_surface"] == {"base": 1.0}
        if name == "usdc":
            assert values["base_color_of_vertices"]["geomprop"] == "displayColor"
            assert values["specular_roughness_of_vertices"]["geomprop"] == "roughness"
            assert stage.GetPrimAtPath("/decay").HasAttribute("primvars:roughness")
            continue
        for ours, theirs, space in (
            ("base_color", "diffuseColor", "srgb_texture"),
            ("specular_roughness", "roughness", "raw"),
        ):
            file = stage.GetPrimAtPath(f"{material.GetPath()}/{ours}_of_pictures").GetAttribute("inputs:file")
            other = stage.GetPrimAtPath(f"{material.GetPath()}/{theirs}").GetAttribute("inputs:file")
            assert [file.Get(at).path for at in (1, 13)] == [other.Get(at).path for at in (1, 13)]
            assert file.GetColorSpace() == space
            assert values["texcoord"]["geomprop"] == "st"


def _data(path: Path, info: zipfile.ZipInfo) -> int:
    """Return where a file's data begin in an archive: USDZ wants multiples of 64."""
    head = path.read_bytes()[info.header_offset : info.header_offset + 30]
    return info.header_offset + 30 + sum(struct.unpack("<HH", head[26:30]))


def test_materials_of_one_name_and_of_none_have_prims_of_their_own() -> None:
    assert _prims(["peel red", "peel_red", "", "part1"]) == ["peel_red", "peel_red_", "material2", "part1_"]
