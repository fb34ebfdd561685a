"""Whole results in every format, read back by readers that are not ours."""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr
from pxr import Usd, UsdGeom

from service.errors import InvalidQuery, UnfitFormat
from service.sequences import EXPORTS, STILLS, Options, Sequence, of_run, prepared
from solver import meshes, registry
from solver.fruit import lattice
from sweeps.pictures import colours

from ._gltf import accessor, parsed
from ._runs import STAGES, made, rotting, shrinking, splitting


def vertices(run: xr.Dataset) -> list[np.ndarray]:
    return [surface.vertices for surface in of_run(run)]


def test_what_is_z_up_is_turned_and_not_mirrored() -> None:
    run = splitting()
    lying, standing = vertices(run), vertices(run.assign_attrs(up="z"))
    for one, other in zip(lying, standing, strict=True):
        np.testing.assert_array_equal(other[:, 1], one[:, 2])  # what was up is y
        np.testing.assert_array_equal(np.cross(other[0], other[1])[1], np.cross(one[0], one[1])[2])


def test_lengths_of_fields_are_scaled_as_points_are() -> None:
    ball = shrinking()
    moved = ball["position"] - ball["position"][0]
    run = ball.assign(displacement=moved.astype("f4"))
    plain, large = (trimesh.load(io.BytesIO(made(run, "ply", scale=k)), "ply", process=False) for k in (1, 20))
    fields = [one.metadata["_ply_raw"]["vertex"]["data"] for one in (plain, large)]
    assert np.abs(fields[0]["displacement_x"]).max() > 0.5
    for axis in "xyz":
        name = f"displacement_{axis}"
        np.testing.assert_allclose(fields[1][name], 20 * fields[0][name], rtol=1e-6)
        np.testing.assert_allclose(fields[1][axis], 20 * fields[0][axis], rtol=1e-6)


def half(rim: bool) -> xr.Dataset:
    """A ball whose triangles may change, or what is left of it without its lower half; seams split its vertices."""
    ball = trimesh.creation.icosphere(2)
    faces = np.array(ball.faces)
    faces = faces[ball.triangles_center[:, 1] > 0] if rim else faces
    points, corners = np.array(ball.vertices, "f4")[faces.ravel()], np.arange(3 * len(faces)).reshape(-1, 3)
    frames = [meshes.Frame(points * (1 + k), corners, {}) for k in range(2)]
    return xr.Dataset(meshes.changing(frames), {"stage": [0.0, 1.0]}, {"solver": "growth"})


@pytest.mark.parametrize("rim", [False, True])
def test_a_sheet_is_seen_from_both_sides_and_wears_no_fruits_skin(rim: bool, tmp_path: Path) -> None:
    document, _ = parsed(made(half(rim), "animation"))
    for material in document["materials"]:
        assert material.get("doubleSided", False) is rim
        red, green, blue, _ = material["pbrMetallicRoughness"]["baseColorFactor"]
        assert red < 1.5 * blue  # plain clay
        assert blue < green < red
    (tmp_path / "s.usdc").write_bytes(made(half(rim), "usdc"))
    stage = Usd.Stage.Open(str(tmp_path / "s.usdc"))
    assert bool(UsdGeom.Mesh(stage.GetDefaultPrim()).GetDoubleSidedAttr().Get()) is rim


# --- vertex caches: numpy's own records, from the layouts in the formats' documents -------------------------------


def test_pc2_is_the_documented_header_and_the_points() -> None:
    run = shrinking()
    data = made(run, "pc2", step=6)
    head = np.dtype([("mark", "S12"), ("version", "<i4"), ("points", "<i4"), ("start", "<f4"), ("rate", "<f4")])
    head = np.dtype([*head.descr, ("samples", "<i4")])
    said = np.frombuffer(data, head, 1)[0]
    assert head.itemsize == 32
    assert data[:12] == b"POINTCACHE2\0"
    assert (said["version"], said["points"], said["start"], said["rate"], said["samples"]) == (1, 130, 1, 6, 3)
    read = np.frombuffer(data, "<f4", offset=32).reshape(3, 130, 3)
    assert np.array_equal(read, vertices(run))


def test_mdd_is_big_endian_with_times() -> None:
    run = shrinking()
    data = made(run, "mdd", step=6, fps=12)
    assert struct.unpack(">ii", data[:8]) == (3, 130)
    assert np.frombuffer(data, ">f4", 3, 8).tolist() == [0.0, 0.5, 1.0]
    assert np.array_equal(np.frombuffer(data, ">f4", offset=20).reshape(3, 130, 3), vertices(run))


@pytest.mark.parametrize("name", ["pc2", "mdd"])
def test_changing_triangles_have_no_cache(name: str) -> None:
    with pytest.raises(UnfitFormat) as caught:
        made(splitting(), name)
    assert "usdc" in caught.value.advice
    assert made(splitting(), name, stage=2.0)


def test_triangles_that_could_have_changed_and_did_not_have_a_cache() -> None:
    """A sheet that is never cut comes as one that is: with triangles of its own for each stage."""
    ball = trimesh.creation.icosphere(2)
    faces = np.array(ball.faces)
    places = [np.array(ball.vertices * (1 + k), "f4") for k in range(len(STAGES))]
    run = xr.Dataset(meshes.changing([meshes.Frame(x, faces, {}) for x in places]), {"stage": list(STAGES)})
    run.attrs["solver"] = "growth"
    data = made(run, "pc2")
    assert np.array_equal(np.frombuffer(data, "<f4", offset=32).reshape(3, -1, 3), places)
    assert np.array_equal(np.frombuffer(made(run, "mdd"), ">f4", offset=20).reshape(3, -1, 3), places)
    turned = [faces, np.roll(faces, 1, axis=0), faces]
    other = meshes.changing([meshes.Frame(x, f, {}) for x, f in zip(places, turned, strict=True)])
    with pytest.raises(UnfitFormat, match="change"):
        made(xr.Dataset(other, {"stage": list(STAGES)}, run.attrs), "pc2")


@pytest.mark.parametrize("name", ["exr", "png", "png-zip", "usdz", "pc2", "mdd"])
def test_what_is_advised_where_triangles_change_can_be_had(name: str) -> None:
    with pytest.raises(UnfitFormat) as caught:
        made(splitting(), name)
    named = [other for other in EXPORTS if re.search(rf"\b{other}\b(?!-)", caught.value.advice)]
    assert named
    for other in named:
        assert made(splitting(), other)


# --- USD, by its own library -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["usdc", "usda"])
def test_usd_keeps_one_topology_and_samples_points(kind: str, tmp_path: Path) -> None:
    run = rotting()
    (tmp_path / f"fruit.{kind}").write_bytes(made(run, kind))
    stage = Usd.Stage.Open(str(tmp_path / f"fruit.{kind}"))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (1, 25, 24)
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    assert mesh.GetPointsAttr().GetTimeSamples() == [1, 13, 25]
    assert mesh.GetFaceVertexIndicesAttr().GetNumTimeSamples() == 0
    assert UsdGeom.Mesh.ValidateTopology(
        mesh.GetFaceVertexIndicesAttr().Get(), mesh.GetFaceVertexCountsAttr().Get(), 130
    )
    for at, surface in zip((1, 13, 25), of_run(run), strict=True):
        assert np.array_equal(mesh.GetPointsAttr().Get(at), surface.vertices)
        assert np.allclose(mesh.GetDisplayColorAttr().Get(at), surface.colour)
        own = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("rot")
        assert np.allclose(own.Get(at), surface.fields["rot"])
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert len(st.ComputeFlattened()) == 3 * 4 * 8 * 8
    assert list(mesh.GetPrim().GetCustomDataByKey("stages")) == list(STAGES)


def test_usd_samples_triangles_that_change_and_knows_the_metre(tmp_path: Path) -> None:
    (tmp_path / "m.usdc").write_bytes(made(splitting(), "usdc", scale=10, step=1))
    stage = Usd.Stage.Open(str(tmp_path / "m.usdc"))
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    assert UsdGeom.GetStageMetersPerUnit(stage) == pytest.approx(0.001)
    for at, surface in enumerate(of_run(splitting()), 1):
        points, corners = mesh.GetPointsAttr().Get(at), mesh.GetFaceVertexIndicesAttr().Get(at)
        assert np.allclose(points, 10 * surface.vertices)
        assert np.array_equal(corners, surface.triangles.ravel())
        assert UsdGeom.Mesh.ValidateTopology(corners, mesh.GetFaceVertexCountsAttr().Get(at), len(points))


# --- animated glTF, by trimesh and by its JSON --------------------------------------------------------------------


def test_a_moving_shape_is_one_mesh_with_morph_targets() -> None:
    document, binary = parsed(made(shrinking(), "animation"))
    (primitive,) = document["meshes"][0]["primitives"]
    base = accessor(document, binary, primitive["attributes"]["POSITION"])
    copies = of_run(shrinking()).seam.copies
    for target, wanted in zip(primitive["targets"], vertices(shrinking())[1:], strict=True):
        assert np.allclose(base + accessor(document, binary, target["POSITION"]), wanted[copies], atol=1e-6)
    (sampler,) = document["animations"][0]["samplers"]
    assert accessor(document, binary, sampler["input"]).ravel().tolist() == [0.0, 0.5, 1.0]
    assert accessor(document, binary, sampler["output"]).ravel().tolist() == [0, 0, 1, 0, 0, 1]
    assert document["meshes"][0]["extras"]["targetNames"] == ["2", "5"]


@pytest.mark.parametrize("run", [rotting(), splitting()], ids=["colours", "triangles"])
def test_other_changes_switch_between_meshes(run: xr.Dataset) -> None:
    data = made(run, "animation")
    document, binary = parsed(data)
    scene = trimesh.load(io.BytesIO(data), file_type="glb", process=False)
    assert len(scene.geometry) == 3
    for mesh, surface in zip(scene.geometry.values(), of_run(run), strict=True):
        assert len(mesh.faces) == len(surface.triangles)
        assert np.allclose(mesh.bounds, [surface.vertices.min(axis=0), surface.vertices.max(axis=0)], atol=1e-6)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        assert mesh.is_watertight
    # at any time exactly one stage is there
    for time in (0.0, 0.4, 0.5, 0.99, 1.0, 1.5):
        shown = []
        for channel, sampler in zip(*(document["animations"][0][k] for k in ("channels", "samplers")), strict=True):
            assert channel["target"]["path"] == "scale"
            keys = accessor(document, binary, sampler["input"]).ravel()
            values = accessor(document, binary, sampler["output"])[:, 0]
            shown.append(values[max(np.searchsorted(keys, time, side="right") - 1, 0)])
        assert sorted(shown) == [0, 0, 1]
        assert shown[min(int(time / 0.5), 2)] == 1


def test_vertex_colours_are_linear_light() -> None:
    document, binary = parsed(made(rotting(), "animation", stage=5.0))
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    sequence = of_run(rotting())
    last = list(sequence)[-1]
    assert np.allclose(accessor(document, binary, attributes["COLOR_0"]), last.colour[sequence.seam.copies])
    assert np.allclose(accessor(document, binary, attributes["_ROT"])[:, 0], last.fields["rot"][sequence.seam.copies])
    assert "animations" not in document


def test_textures_hold_what_the_vertices_do() -> None:
    scene = trimesh.load(io.BytesIO(made(rotting(32), "animation", stage=5.0, textures=64)), file_type="glb")
    (mesh,) = scene.geometry.values()
    material = mesh.visual.material
    picture = np.asarray(material.baseColorTexture.convert("RGB"))
    assert picture.shape == (64, 64, 3)
    run = rotting(32)
    skin = colours.of_run(run, 2)
    assert np.abs(picture[1::2, 0].astype(int) - colours.encoded(skin.colour[:, 0])).max() <= 12
    # the rotten and mouldy pole on top is rougher than the fresh one below
    rough = np.asarray(material.metallicRoughnessTexture.convert("RGB"))
    assert rough[0, 0, 1] > rough[-1, 0, 1] + 50
    assert rough[..., 2].max() == 0
    with pytest.raises(UnfitFormat, match="textures"):
        made(splitting(), "animation", textures=64)


# --- PLY and OBJ, by trimesh -------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", [rotting(), splitting()], ids=["lattice", "meshes"])
@pytest.mark.parametrize("kind", ["ply", "obj"])
def test_zips_hold_a_mesh_per_stage(run: xr.Dataset, kind: str) -> None:
    data = made(run, f"{kind}-zip")
    assert data == made(run, f"{kind}-zip")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        about = json.loads(archive.read("stages.json"))
        assert list(about["files"].values()) == list(STAGES)
        for name, surface in zip(about["files"], of_run(run), strict=True):
            mesh = trimesh.load(io.BytesIO(archive.read(name)), file_type=kind, process=False, maintain_order=True)
            closed = trimesh.Trimesh(mesh.vertices, mesh.faces)
            assert closed.is_watertight
            assert closed.volume == pytest.approx(trimesh.Trimesh(surface.vertices, surface.triangles).volume, rel=1e-5)


def test_ply_has_colours_and_fields() -> None:
    mesh = trimesh.load(io.BytesIO(made(rotting(), "ply")), file_type="ply", process=False)
    last = list(of_run(rotting()))[-1]
    assert np.array_equal(mesh.vertices.astype("f4"), last.vertices)
    assert np.array_equal(mesh.visual.vertex_colors[:, :3], colours.encoded(last.colour))
    rows = mesh.metadata["_ply_raw"]["vertex"]["data"]
    assert np.array_equal(rows["rot"].ravel(), last.fields["rot"])


def test_obj_gives_the_order_of_a_cache() -> None:
    sequence, options = of_run(rotting()), Options()
    words = [line.split() for line in STILLS["obj"](sequence.at(0), options).decode().splitlines()]
    read = np.float32([w[1:] for w in words if w[0] == "v"])
    assert np.array_equal(read[:, :3], vertices(rotting())[0])
    assert np.allclose(read[:, 3:], colours.encoded(next(iter(sequence)).colour) / 255)


# --- the view ----------------------------------------------------------------------------------------------------


def test_a_field_colours_the_whole_sequence_on_one_scale() -> None:
    sequence = prepared(splitting(), Options.parse({"colour": "heat"}))
    low, high = colours.by_field(np.array([-1.0, 1.0]), -1, 1)
    ball = list(sequence)[1]
    assert np.allclose(ball.colour[ball.fields["heat"].argmax()], high, atol=1e-6)
    assert np.allclose(ball.colour[ball.fields["heat"].argmin()], low, atol=1e-6)
    with pytest.raises(InvalidQuery, match="moss"):
        made(splitting(), "ply", colour="moss")


def test_displacement_alone_is_laid_on_the_fresh_fruit() -> None:
    params = registry.get("dehydration").parse({}, "plum1")
    fresh = params.surface(*lattice(12))
    data = {"displacement": (("stage", "colatitude", "azimuth", "component"), -0.1 * fresh[None].astype("f4"))}
    attrs = {"solver": "dehydration", "params": params.model_dump_json()}
    run = xr.Dataset(data, {"stage": [0.1]}, attrs)
    (surface,) = of_run(run)
    assert np.allclose(surface.vertices[:-2].reshape(12, 24, 3), 0.9 * fresh, atol=1e-6)


def test_results_without_a_surface_are_refused() -> None:
    with pytest.raises(UnfitFormat, match="whole surface"):
        of_run(xr.Dataset({"mean_rot": ("stage", [0.0])}, {"stage": [0.0]}))
    part = rotting().assign_attrs(need=json.dumps({"region": {"colatitude": [0, 90]}}))
    with pytest.raises(UnfitFormat, match="region"):
        of_run(part)


@pytest.mark.parametrize("wrong", [{"fps": 0}, {"textures": 1}, {"size": 10**6}, {"scale": float("nan")}, {"hue": 1}])
def test_wrong_choices_are_named(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidQuery, match=next(iter(wrong))):
        Options.parse(wrong)


def test_progress_is_told_by_stage() -> None:
    told: list[float] = []
    base = of_run(rotting())
    list(Sequence(base.run, base.indices, base.kept, base.lattice, observe=told.append))
    assert told == pytest.approx([1 / 3, 2 / 3, 1])
