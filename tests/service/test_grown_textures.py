"""A textured mesh that grows, from OBJ to GLB and OBJ, by plain code: corners keep their place on its map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from pxr import Usd, UsdGeom, UsdShade

from service.sequences import EXPORTS, STILLS, Options, prepared, write
from solver.contract import Need
from solver.growth import SOLVER
from sweeps.commands.terminal.meshfile import read

from ._gltf import accessor, parsed

#: Lengths are twice those of the start.
GROWN = 2.0
STAGES = (0.0, 1.0)


def on_map(chart: int, x, y):
    return (0.2 + 0.15 * x, 0.5 + 0.3 * y) if chart == 0 else (0.9 - 0.3 * y, 0.1 + 0.25 * x)


def written(path: Path, count: int = 7, on_map=on_map) -> dict:
    """Write a square in two charts, left and right of x = 0, of two materials; the right one is turned."""
    lines = []
    ticks = np.linspace(-1, 1, count)
    for y in ticks:
        lines += [f"v {x:.9g} {y:.9g} 0" for x in ticks]
    for chart in (0, 1):
        for y in ticks:
            lines += [f"vt {u:.9g} {v:.9g}" for u, v in (on_map(chart, x, y) for x in ticks)]
    for chart, name in enumerate(("left", "right")):
        lines.append(f"usemtl {name}")
        half = range(count // 2) if chart == 0 else range(count // 2, count - 1)
        for j in range(count - 1):
            for i in half:
                square = [j * count + i, j * count + i + 1, (j + 1) * count + i + 1, (j + 1) * count + i]
                lines.append("f " + " ".join(f"{k + 1}/{k + 1 + chart * count * count}" for k in square))
    path.write_text("\n".join(lines) + "\n")
    return read(path)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    mesh = written(tmp_path_factory.mktemp("square") / "square.obj")
    tool = {"kind": "surface", "where": {"kind": "everywhere"}, "stretch": (GROWN, GROWN)}
    held = {"where": {"kind": "everywhere"}, "axes": ["z"]}
    values = {"mesh": mesh, "tools": [tool], "imperfection": 0.0, "remesh": 1.5, "step": 0.1, "attached": [held]}
    need = Need(fields=("mesh_position", "red", "green", "blue"), stages=STAGES, quality="preview")
    found = SOLVER.solve(SOLVER.parse(values), need)
    assert found.vertex_count.values[1] > 2 * found.vertex_count.values[0]
    assert found.attrs["materials"] == '["left", "right"]'
    return found


def check(points, uv, chart: int, scale: float) -> None:
    """Corners (m, 3), y up, of a chart; the square may have been shifted as a whole, its middle is where it was."""
    x, y = points[:, 0] / scale, -points[:, 2] / scale
    u, v = on_map(chart, x, y)
    assert np.abs(uv - np.stack([u, v], -1)).max() < 2e-3
    assert (x * (1 if chart else -1)).min() > -0.01


def test_glb_has_each_stage_s_corners_on_the_map(run):
    document, binary = parsed(write(prepared(run, Options()), EXPORTS["animation"], Options()))
    assert [m["name"] for m in document["materials"]] == ["left", "right"]
    meshes = [m["primitives"] for m in document["meshes"]]
    assert len(meshes) == len(STAGES)
    for primitives, scale in zip(meshes, (1.0, GROWN), strict=True):
        assert [p["material"] for p in primitives] == [0, 1]
        for chart, part in enumerate(primitives):
            corners = accessor(document, binary, part["indices"]).ravel()
            points = accessor(document, binary, part["attributes"]["POSITION"])[corners]
            uv = accessor(document, binary, part["attributes"]["TEXCOORD_0"])[corners]
            # v runs down in glTF
            check(points, np.stack([uv[:, 0], 1 - uv[:, 1]], -1), chart, scale)


def test_obj_has_them_too(run):
    text = STILLS["obj"](prepared(run, Options(), 1.0, single=True), Options()).decode()
    rows = [line.split() for line in text.splitlines()]
    points, uv = (np.array([r[1:4] for r in rows if r[0] == w], float) for w in ("v", "vt"))
    corners = np.array([[[int(n) - 1 for n in w.split("/")] for w in r[1:]] for r in rows if r[0] == "f"])
    assert corners.shape == (run.face_count.values[1], 3, 2)
    places, shown = points[corners[:, :, 0]], uv[corners[:, :, 1]]
    right = places[:, :, 0].mean(axis=1) > 0
    for chart in (0, 1):
        own = right == chart
        check(places[own].reshape(-1, 3), shown[own].reshape(-1, 2), chart, GROWN)


def test_a_textured_file_without_growth_keeps_its_numbers(run, tmp_path: Path):
    """The first stage is cut nowhere: every corner has the file's own pair."""
    mesh = written(tmp_path / "square.obj")
    uv, corners = np.array(mesh["uv"])[np.array(mesh["uv_faces"])], run.texture_triangle.values
    first = int(run.face_count.values[0])
    assert first == len(mesh["faces"])
    assert np.array_equal(run.texture_coordinate.values[corners[:first]], uv)


def test_usd_binds_one_material_where_triangles_change(run, tmp_path: Path):
    """Parts of a mesh are numbers of triangles, which are others at each stage."""
    path = tmp_path / "square.usdc"
    path.write_bytes(write(prepared(run, Options()), EXPORTS["usdc"], Options()))
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    assert not UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
    assert UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0]


def test_ply_has_them_for_the_corners_of_its_faces(run):
    data = write(prepared(run, Options(), 1.0, single=True), EXPORTS["ply"], Options())
    head, body = data.split(b"end_header\n", 1)
    words = [line.split() for line in head.decode().splitlines()]
    assert ["property", "list", "uchar", "float", "texcoord"] in words
    counts = {w[1]: int(w[2]) for w in words if w[0] == "element"}
    kinds = [("<f4" if w[1] == "float" else "u1", w[2]) for w in words if w[0] == "property" and w[1] != "list"]
    rows = np.frombuffer(body, [(name, kind) for kind, name in kinds], counts["vertex"])
    face = np.dtype([("three", "u1"), ("corner", "<i4", 3), ("six", "u1"), ("uv", "<f4", 6)])
    faces = np.frombuffer(body[rows.nbytes :], face)
    assert len(faces) == counts["face"] == run.face_count.values[1]
    assert set(faces["three"]) == {3}
    assert set(faces["six"]) == {6}
    places = np.stack([rows[axis] for axis in "xyz"], -1)[faces["corner"]]
    right = places[:, :, 0].mean(axis=1) > 0
    for chart in (0, 1):
        own = right == chart
        check(places[own].reshape(-1, 3), faces["uv"][own].reshape(-1, 2), chart, GROWN)


def test_a_library_reads_the_ply(run, tmp_path: Path):
    """And a mesh without texture coordinates has the faces that it had."""
    trimesh = pytest.importorskip("trimesh")
    path = tmp_path / "square.ply"
    for one in (run, run.drop_vars(["texture_coordinate", "texture_triangle", "texture_count"])):
        path.write_bytes(write(prepared(one, Options(), 1.0, single=True), EXPORTS["ply"], Options()))
        assert len(trimesh.load_mesh(path, process=False).faces) == run.face_count.values[1]
    assert b"texcoord" not in path.read_bytes()


def test_usd_has_them_at_each_time(run, tmp_path: Path):
    path = tmp_path / "square.usdc"
    path.write_bytes(write(prepared(run, Options()), EXPORTS["usdc"], Options()))
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert st.GetInterpolation() == UsdGeom.Tokens.faceVarying
    times = mesh.GetPointsAttr().GetTimeSamples()
    assert len(times) == len(STAGES)
    for at, scale in zip(times, (1.0, GROWN), strict=True):
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(at))
        places, uv = np.array(mesh.GetPointsAttr().Get(at))[corners], np.array(st.ComputeFlattened(at))
        assert len(uv) == len(corners)
        right = places.reshape(-1, 3, 3)[:, :, 0].mean(axis=1) > 0
        for chart in (0, 1):
            own = np.repeat(right == chart, 3)
            check(places[own], uv[own], chart, scale)
