"""Meshes of one's own with 100,000 vertices, by the documented commands: seconds, memory, and what of them is kept.

    python -m benchmarks.decay.own [FOLDER] [PYTHON_WITH_BPY] [mesh ...]

A ring, a banana and a rabbit, each of 400 rows of 250 points with texture coordinates and two materials as OBJ. Each
goes through `wizen solve` (a body, three stages) and `wizen export` to GLB, USDZ (pictures of 1024 pixels) and USDC, in
processes of their own: seconds are those of the processor, memory is the most a process held. Compared with the OBJ,
bit by bit: order of points and triangles, texture coordinates, materials. With a Python that has Blender's `bpy`, each
file is opened there as well.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade

from benchmarks.figures import Sheet
from sweeps.commands.terminal.meshfile import read

Array = NDArray[np.float64]
ROWS, AROUND = 400, 250
STAGES, KINDS = (0, 5, 10), ("glb", "usdz", "usdc")
#: Where the rabbit's first row lies. Half a row from its end, edges of 6e-5 r1 would make steps of rot 100 times dearer
#: than the ring's: what is explicit pays for the shortest edge.
TIP = 0.01
#: Ball and rods of the rabbit: both ends, radii there.
_RABBIT = (
    ((-0.15, -0.1, 0), (0.15, 0.0, 0), 0.62, 0.55),
    ((0.34, 0.44, 0), (0.50, 0.48, 0), 0.36, 0.26),
    ((0.24, 0.65, 0.12), (0.40, 1.36, 0.30), 0.15, 0.10),
    ((0.24, 0.65, -0.12), (0.40, 1.36, -0.30), 0.15, 0.10),
    ((-0.66, -0.15, 0), (-0.76, -0.13, 0), 0.18, 0.18),
    ((0.30, -0.45, 0.25), (0.42, -0.55, 0.30), 0.18, 0.14),
    ((0.30, -0.45, -0.25), (0.42, -0.55, -0.30), 0.18, 0.14),
)


def ring(a: Array, b: Array) -> Array:
    """Return points of a ring that lies on the floor; a, b: 0 to 1 about it and about its tube."""
    a, b = 2 * np.pi * a, 2 * np.pi * b
    far = 0.7 + 0.3 * np.cos(b)
    return np.stack([far * np.cos(a), 0.3 * np.sin(b), far * np.sin(a)], axis=-1)


def banana(a: Array, b: Array) -> Array:
    """Return points of a tube along an arc, five-sided as a banana is; a: 0 to 1 along it, b about it."""
    turn, about = 2.0 * (a - 0.5), 2 * np.pi * b
    thick = 0.24 * np.sin(np.pi * a) ** 0.4 * (1 + 0.03 * np.cos(5 * about))
    far = 1.1 + thick * np.cos(about)
    return np.stack([far * np.sin(turn), -far * np.cos(turn), thick * np.sin(about)], axis=-1)


def rabbit(a: Array, b: Array) -> Array:
    """Return points of rounded rods that flow together, seen from the middle of the largest; a: from above down."""
    theta, phi = np.pi * a, 2 * np.pi * b
    ray = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    far = np.full(a.shape, 2.5)
    for _ in range(120):  # inwards from outside, by the distance that is surely free
        far -= 0.5 * _outside(far[..., None] * ray)
    return np.asarray(far[..., None] * ray)


def _outside(points: Array) -> Array:
    """Return how far points are from the rabbit, about."""
    gaps = []
    for start, end, wide, slim in _RABBIT:
        way = np.subtract(end, start)
        along = np.clip((points - start) @ way / (way @ way), 0, 1)
        away = np.linalg.norm(points - start - along[..., None] * way, axis=-1)
        gaps.append(away - wide - along * (slim - wide))
    soft = 0.06
    return np.asarray(-soft * np.log(np.sum(np.exp(-np.array(gaps) / soft), axis=0)))


def text(shape: Any, closed: bool) -> str:
    """Return an OBJ of rows and columns; closed: rows go round, too, and otherwise end in a point each."""
    tip = TIP if shape is rabbit else 0.5 / ROWS
    rows = np.arange(ROWS) / ROWS if closed else np.linspace(tip, 1 - tip, ROWS)
    points = shape(*np.meshgrid(rows, np.arange(AROUND) / AROUND, indexing="ij")).reshape(-1, 3)
    # numbers that no float holds
    u, v = 0.013 + 0.97 * np.arange(AROUND + 1) / AROUND, 0.021 + 0.93 * np.arange(ROWS + 2) / (ROWS + 1)
    uv = np.stack(np.meshgrid(v, u, indexing="ij")[::-1], axis=-1).reshape(-1, 2)
    if not closed:
        points = np.concatenate([points, shape(np.array([0.0, 1.0]), np.zeros(2))])
    points = points - (points.max(axis=0) + points.min(axis=0)) / 2
    points *= 2 / np.ptp(points, axis=0).max()
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points.tolist()]
    lines += [f"vt {x:.9g} {y:.9g}" for x, y in uv.tolist()]
    last, at, first = (ROWS, AROUND + 1, 0) if closed else (ROWS - 1, AROUND + 1, 1)
    for i in range(last):
        if i in (0, ROWS // 2):
            lines.append(f"usemtl {'peel' if i == 0 else 'other half'}")
        for j in range(AROUND):
            corners = ((i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j))
            words = [f"{a % ROWS * AROUND + b % AROUND + 1}/{(a + first) * at + b + 1}" for a, b in corners]
            lines.append("f " + " ".join(words))
    for row, tip, column in () if closed else ((0, ROWS * AROUND + 1, 0), (ROWS - 1, ROWS * AROUND + 2, ROWS + 1)):
        for j in range(AROUND):
            rim = [f"{row * AROUND + k % AROUND + 1}/{(row + 1) * at + k + 1}" for k in (j, j + 1)]
            end = f"{tip}/{column * at + j + 1}"
            lines.append("f " + " ".join([end, *(rim if row else rim[::-1])]))
    return "\n".join(lines) + "\n"


def volume(points: Array, faces: NDArray[np.integer[Any]]) -> float:
    """Return the volume within triangles (f, 3) of points (v, 3), whichever way they are wound."""
    a, b, c = points.astype(float)[faces].transpose(1, 0, 2)
    return abs(float(np.sum(a * np.cross(b, c)))) / 6


def timed(*words: str) -> tuple[float, float]:
    """Run a command; return its processor seconds and the most memory it held [MB]."""
    started = subprocess.Popen([sys.executable, "-m", "service.cli", *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(started.pid, 0)
    if status:
        raise RuntimeError(f"wizen {' '.join(words)} ended with {status}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3


def kept_in_glb(given: dict[str, Any], fresh: Array, path: Path) -> list[str]:
    """Return what of a mesh, whose points are settled at `fresh` (v, 3), a GLB of its first stage has not kept.

    A GLB has a point for each texture coordinate, in their order: corners are compared.
    """
    again = read(path)
    wrong = [name for name in ("materials", "face_materials") if again[name] != given[name]]
    ours, theirs = (np.array(one["uv"])[np.array(one["uv_faces"]).ravel()] for one in (given, again))
    # a GLB counts v from above
    ours[:, 1] = 1 - (1 - ours[:, 1]).astype("f4").astype(float)
    wrong += [] if np.array_equal(np.stack([ours[:, 0].astype("f4"), ours[:, 1]], axis=1), theirs) else ["uv"]
    there, here = np.array(again["points"])[np.array(again["faces"])], fresh[np.array(given["faces"])]
    return wrong + ([] if there.shape == here.shape and np.array_equal(there, here) else ["corners"])


def kept_in_usd(given: dict[str, Any], fresh: Array, path: Path) -> list[str]:
    """Return what of a mesh, whose points are settled at `fresh` (v, 3), a USD file has not kept."""
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(next(p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)))
    flat = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").ComputeFlattened())
    corners = np.array(given["uv_faces"]).ravel()
    wrong = [] if flat.tobytes() == np.array(given["uv"], "f4")[corners].tobytes() else ["uv"]
    same = np.array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), given["faces"])
    wrong += [] if same else ["faces"]
    sizes = [len(s.GetIndicesAttr().Get()) for s in UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()]
    wrong += [] if sizes == np.bincount(given["face_materials"]).tolist() else ["materials"]
    return wrong + ([] if np.array_equal(np.array(mesh.GetPointsAttr().Get(1)), fresh) else ["points"])


def pictures(path: Path) -> int:
    """Return how many different pictures a USDZ holds."""
    archive = zipfile.ZipFile(path)
    found = [archive.read(name) for name in archive.namelist() if name.endswith(".png")]
    assert all(Image.open(io.BytesIO(data)).size == (1024, 1024) for data in found)
    return len(set(found))


BLENDER = """
import json, sys, bpy
found = []
for path in sys.argv[1:]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    (bpy.ops.import_scene.gltf if path.endswith("glb") else bpy.ops.wm.usd_import)(filepath=path)
    bodies = [one.data for one in bpy.data.objects if one.type == "MESH"]
    found.append([len(bodies[0].vertices), len(bodies[0].polygons), len(bodies[0].uv_layers)])
print(json.dumps(found))
"""


def opened(python: str, *paths: Path) -> list[list[int]]:
    """Return vertices, triangles and texture layers of files as Blender has them."""
    said = subprocess.run([python, "-c", BLENDER, *map(str, paths)], capture_output=True, text=True, check=True)
    found: list[list[int]] = json.loads(next(line for line in said.stdout.splitlines()[::-1] if line.startswith("[[")))
    return found


def measured(shape: Any, where: Path) -> dict[str, Any]:
    """Solve and export a mesh, and return seconds, memory and what the run says; what a folder has is not run again."""
    name = shape.__name__
    kept = where / f"{name}.json"
    if kept.exists():
        row: dict[str, Any] = json.loads(kept.read_text())
        return row
    source, run = where / f"{name}.obj", where / f"{name}.h5"
    source.write_text(text(shape, shape is ring))
    said = ["--preset", "apple", "--set", f"mesh=@{source}", "--set", "body=quasi-static"]
    said += ["--set", 'wounds=[{"vertex":40000}]', "--stages", ",".join(map(str, STAGES)), "--out", str(run)]
    row = dict(zip(("solve_s", "solve_mb"), timed("solve", "decay", *said), strict=True))
    with xr.open_dataset(run, engine="h5netcdf") as found:
        assert found.converged.all()
        fresh, *_, last = (volume(points, found.triangle.values) for points in found.mesh_position.values)
        row |= {"volume": last / fresh, "rotten": float(found.rotten_share[-1])}
        row |= {"budget": float(found.budget_error.max()), "body_residual": float(found.body_residual.max())}
    for kind in KINDS:
        path, textures = where / f"{name}.{kind}", () if kind == "usdc" else ("--textures", "1024")
        row[f"{kind}_s"], row[f"{kind}_mb"] = timed("export", str(run), *textures, "--out", str(path))
        row[f"{kind}_bytes"] = path.stat().st_size
    timed("export", str(run), "--stage", "0", "--out", str(where / f"{name}-fresh.glb"))
    kept.write_text(json.dumps(row))
    return row


def main(folder: str = "own", python: str | None = None, *chosen: str) -> None:
    """See the module."""
    where = Path(folder)
    where.mkdir(parents=True, exist_ok=True)
    head = ("mesh", "points", "triangles", "solve", "memory", "rotten, day 10", "volume", "out of balance", "budget")
    sheet = Sheet("decay-own", (*head, *(kind.upper() for kind in KINDS), "not kept"), "decay")
    for shape in (ring, banana, rabbit):
        name = shape.__name__
        if chosen and name not in chosen:
            continue
        row = measured(shape, where)
        given = read(where / f"{name}.obj")
        row |= {"points": len(given["points"]), "triangles": len(given["faces"])}
        with xr.open_dataset(where / f"{name}.h5", engine="h5netcdf") as found:
            fresh = found.mesh_position.values[0]
        files = [where / f"{name}.{kind}" for kind in KINDS]
        lost = kept_in_glb(given, fresh, where / f"{name}-fresh.glb")
        row["lost"] = sum((kept_in_usd(given, fresh, path) for path in files[1:]), lost)
        row["pictures"] = pictures(files[1])
        if python:
            row["blender"] = opened(python, *files)
        written = [f"{row[f'{kind}_s']:.0f} s, {row[f'{kind}_bytes'] / 1e6:.0f} MB" for kind in KINDS]
        sheet.add(
            (name, row["points"], row["triangles"], f"{row['solve_s']:.0f} s", f"{row['solve_mb'] / 1e3:.1f} GB",
             f"{100 * row['rotten']:.0f} %", f"{row['volume']:.3f}", f"{row['body_residual']:.0e}",
             f"{row['budget']:.0e}", *written, ", ".join(row["lost"]) or "nothing"),
            mesh=name, **row,
        )  # fmt: skip
    sheet.keep()


if __name__ == "__main__":
    main(*sys.argv[1:])
