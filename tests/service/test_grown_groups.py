"""Vertex groups of a mesh that grows, from OBJ, GLB and PLY to GLB, PLY, OBJ and USD, by plain code."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from pxr import Usd, UsdGeom

from service.sequences import EXPORTS, STILLS, Options, prepared, write
from solver.contract import InvalidInput, Need
from solver.growth import SOLVER
from sweeps.commands.terminal.meshfile import read
from sweeps.errors import InvalidOption

from ._gltf import accessor, parsed

COUNT, GROWN, STAGES = 7, 2.0, (0.0, 1.0)
TICKS = np.linspace(-1, 1, COUNT)
POINTS = np.stack([*np.meshgrid(TICKS, TICKS), np.zeros((COUNT, COUNT))], -1).reshape(-1, 3)
_AT = (np.arange(COUNT - 1) + COUNT * np.arange(COUNT - 1)[:, None]).ravel()
SQUARES = np.stack([_AT, _AT + 1, _AT + COUNT + 1, _AT + COUNT], -1)
FACES = np.concatenate([SQUARES[:, [0, 1, 2]], SQUARES[:, [0, 2, 3]]])


def slope(x, y):
    """Return a weight that is linear, so that cutting edges cannot change it."""
    return 0.5 + 0.3 * x - 0.2 * y


def as_glb(path: Path) -> dict:
    """Write the square with an attribute _PACE."""
    parts = [POINTS.astype("<f4"), FACES.ravel().astype("<u4"), slope(*POINTS.T[:2]).astype("<f4")]
    starts = np.cumsum([0, *(part.nbytes for part in parts)]).tolist()
    kinds = [("VEC3", 5126, len(POINTS)), ("SCALAR", 5125, FACES.size), ("SCALAR", 5126, len(POINTS))]
    views = [{"buffer": 0, "byteOffset": s, "byteLength": p.nbytes} for s, p in zip(starts, parts, strict=False)]
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "_PACE": 2}, "indices": 1}]}],
        "buffers": [{"byteLength": starts[-1]}],
        "bufferViews": views,
        "accessors": [
            {"bufferView": k, "type": kind, "componentType": of, "count": n} for k, (kind, of, n) in enumerate(kinds)
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = b"".join(part.tobytes() for part in parts)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return read(path)


def grow(mesh: dict) -> xr.Dataset:
    tool = {"kind": "surface", "where": {"kind": "everywhere"}, "stretch": (GROWN, GROWN)}
    held = {"where": {"kind": "everywhere"}, "axes": ["z"]}
    values = {"mesh": mesh, "tools": [tool], "imperfection": 0.0, "remesh": 1.5, "step": 0.1, "attached": [held]}
    need = Need(fields=("mesh_position",), stages=STAGES, quality="preview")
    found = SOLVER.solve(SOLVER.parse(values), need)
    assert found.vertex_count.values[1] > 2 * found.vertex_count.values[0]
    return found


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    found = grow(as_glb(tmp_path_factory.mktemp("groups") / "square.glb"))
    assert found.attrs["groups"] == '["PACE"]'
    return found


def check(points, weights, scale: float) -> None:
    """Points (n, 3), y up."""
    assert np.abs(weights - slope(points[:, 0] / scale, -points[:, 2] / scale)).max() < 2e-3


def test_glb_has_them_at_each_stage(run):
    document, binary = parsed(write(prepared(run, Options()), EXPORTS["animation"], Options()))
    for mesh, scale in zip(document["meshes"], (1.0, GROWN), strict=True):
        found = mesh["primitives"][0]["attributes"]
        points, weights = (accessor(document, binary, found[name]) for name in ("POSITION", "_PACE"))
        check(points, weights.ravel(), scale)


def test_ply_has_them_and_is_read_again(run, tmp_path: Path):
    data = write(prepared(run, Options(), 1.0, single=True), EXPORTS["ply"], Options())
    head, body = data.split(b"end_header\n", 1)
    words = [line.split() for line in head.decode().splitlines()]
    names = [w[2] for w in words if w[:2] == ["property", "float"]]
    assert names[-1] == "PACE"
    rows = np.frombuffer(body, np.dtype([(name, "<f4") for name in names]), run.vertex_count.values[1])
    check(np.stack([rows[axis] for axis in "xyz"], -1), rows["PACE"], GROWN)
    path = tmp_path / "grown.ply"
    path.write_bytes(data)
    again = read(path)
    assert list(again["groups"]) == ["PACE"]
    check(np.array(again["points"]), np.array(again["groups"]["PACE"]), GROWN)


def test_usd_has_them_at_each_time(run, tmp_path: Path):
    path = tmp_path / "square.usdc"
    path.write_bytes(write(prepared(run, Options()), EXPORTS["usdc"], Options()))
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    weights = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("PACE")
    for at, scale in zip(mesh.GetPointsAttr().GetTimeSamples(), (1.0, GROWN), strict=True):
        check(np.array(mesh.GetPointsAttr().Get(at)), np.array(weights.Get(at)), scale)


def test_obj_keeps_whole_groups(tmp_path: Path):
    """Triangles left of x = 0 in two groups, some of them in none: a border moves by half an edge at most."""
    path = tmp_path / "square.obj"
    lines = [f"v {x:.9g} {y:.9g} 0" for x, y, _ in POINTS]
    for face in FACES:
        x, y = POINTS[face].mean(axis=0)[:2]
        lines += [
            "g " + ("left low" if y < 0 else "left") if x < 0 else "g off",
            "f " + " ".join(str(k + 1) for k in face),
        ]
    path.write_text("\n".join(lines))
    mesh = read(path)
    assert list(mesh["groups"]) == ["left", "low"]
    assert np.array_equal(np.array(mesh["groups"]["left"]) == 1, POINTS[:, 0] <= 1e-9)
    data = STILLS["obj"](prepared(grow(mesh), Options(), 1.0, single=True), Options()).decode()
    points, inside, places, named = [], [], [], []
    for words in (line.split() for line in data.splitlines()):
        if words[0] == "v":
            points.append([float(w) for w in words[1:4]])
        elif words[0] == "g":
            named = words[1:]
        elif words[0] == "f":
            places.append(np.mean([points[int(w.split("/")[0]) - 1] for w in words[1:]], axis=0))
            inside.append(["left" in named, "low" in named])
    x, y = np.array(places)[:, 0] / GROWN, -np.array(places)[:, 2] / GROWN
    inside = np.array(inside)
    # weights fall from 1 to 0 over the edges beyond the border
    edge = 2 / (COUNT - 1)
    clear = ((x < -1e-3) | (x > 0.75 * edge)) & ((y < -1e-3) | (y > 0.75 * edge))
    assert clear.sum() > 50
    assert np.array_equal(inside[clear], np.stack([x < 0, (x < 0) & (y < 0)], -1)[clear])


def test_a_point_that_no_triangle_has_leaves_with_its_weight():
    points, weights = [[9.0, 9.0, 9.0], *POINTS.tolist()], [7.0, *slope(*POINTS.T[:2]).tolist()]
    mesh = {"points": points, "faces": (FACES + 1).tolist(), "groups": {"pace": weights}}
    run = SOLVER.solve(
        SOLVER.parse({"mesh": mesh, "tools": []}), Need(fields=("mesh_position",), stages=(0.0,), quality="preview")
    )
    assert run.group_weight.values[:, 0] == pytest.approx(weights[1:], rel=1e-6)


def test_groups_that_do_not_fit_are_refused():
    mesh = {"points": POINTS.tolist(), "faces": FACES.tolist()}
    for groups, said in (
        ({"rim": [1.0]}, "1 weights for 49 points"),
        ({"rim": [1.0] * 49, "RIM": [1.0] * 49}, "rename one"),
        ({"?": [1.0] * 49}, "letters and digits"),
        ({"rim": [1.0] * 48 + [np.nan]}, "finite number"),
        ({"rim": [1.0] * 48 + [-1e31]}, "weight -1e[+]31 at point 48; give numbers up to"),
    ):
        with pytest.raises(InvalidInput, match=said):
            SOLVER.parse({"mesh": mesh | {"groups": groups}, "tools": []})


def test_a_group_by_the_name_of_something_else_gets_a_longer_one():
    mesh = {"points": POINTS.tolist(), "faces": FACES.tolist(), "groups": {"x": [0.25] * 49, "2nd edge": [0.5] * 49}}
    run = SOLVER.solve(
        SOLVER.parse({"mesh": mesh, "tools": []}), Need(fields=("mesh_position",), stages=(0.0,), quality="preview")
    )
    fields = next(iter(prepared(run, Options(), 0.0, single=True))).fields
    assert {name: float(values[0]) for name, values in fields.items()} == {"group_x": 0.25, "group_2nd_edge": 0.5}


@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_a_file_of_more_groups_than_a_mesh_may_have_is_refused_and_none_is_left_out(kind, tmp_path: Path):
    def written(count):
        path = tmp_path / f"{count}.{kind}"
        if kind == "obj":
            lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in POINTS]
            for k, face in enumerate(FACES):
                lines += [f"g part{k % count}", "f " + " ".join(str(v + 1) for v in face)]
        else:
            lines = ["ply", "format ascii 1.0", f"element vertex {len(POINTS)}"]
            lines += [f"property float {name}" for name in ["x", "y", "z", *(f"part{k}" for k in range(count))]]
            lines += [f"element face {len(FACES)}", "property list uchar int vertex_indices", "end_header"]
            lines += [" ".join(f"{v:.6f}" for v in point) + " 0.5" * count for point in POINTS]
            lines += ["3 " + " ".join(map(str, face)) for face in FACES]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    assert len(read(written(64))["groups"]) == 64
    with pytest.raises(InvalidOption, match="65 vertex groups, more than 64") as caught:
        read(written(65))
    assert "at most" in caught.value.advice


@pytest.mark.parametrize("kind", ["glb", "ply"])
@pytest.mark.parametrize("weight", [np.nan, -np.inf])
def test_a_weight_that_is_no_number_is_refused_with_its_group_and_point(kind, weight, tmp_path: Path):
    """It was dropped with its whole group, and without a word."""
    weights = slope(*POINTS.T[:2]).astype("<f4")
    path = tmp_path / f"square.{kind}"
    if kind == "glb":
        as_glb(path)
        data = path.read_bytes()
        assert data.count(weights.tobytes()) == 1
        broken = weights.copy()
        broken[[5, 17]] = weight
        path.write_bytes(data.replace(weights.tobytes(), broken.tobytes()))
    else:
        lines = ["ply", "format ascii 1.0", f"element vertex {len(POINTS)}"]
        lines += [f"property float {name}" for name in ("x", "y", "z", "PACE")]
        lines += [f"element face {len(FACES)}", "property list uchar int vertex_indices", "end_header"]
        for k, point in enumerate(POINTS):
            lines += [" ".join(f"{v:.6f}" for v in point) + f" {weight if k in (5, 17) else weights[k]}"]
        path.write_text("\n".join(lines + ["3 " + " ".join(map(str, face)) for face in FACES]) + "\n", encoding="utf-8")
    with pytest.raises(InvalidOption, match="'PACE' has no finite weight at 2 of 49 points") as caught:
        read(path)
    assert "Give every point a number" in caught.value.advice
