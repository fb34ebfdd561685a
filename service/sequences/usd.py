"""Universal Scene Description: one mesh whose points, and if need be triangles, are sampled over time.

y is up and the unit of length is written where it is known. Colours are `displayColor` in linear light, fields of the
vertices are primvars under their own names. Materials are preview surfaces, and MaterialX beside them. Texture
coordinates are face-varying, v upwards. Needs usd-core.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweeps.errors import installing

from ..errors import Unavailable
from .matter import Pictures, bind, dressed
from .options import Options
from .skins import matter
from .standing import Extra, stems

if TYPE_CHECKING:
    from solver.contract import Worn
    from sweeps.pictures.fur import Threads

    from .seam import Seam
    from .view import Sequence, Surface

__all__ = ["composed", "usda", "usdc"]


def composed(sequence: Sequence, options: Options, pictures: Pictures | None = None) -> Any:
    """Return a sequence as a stage in memory; pictures: what its materials take colour and roughness from.

    Raises:
        Unavailable: usd-core is not installed.

    """
    try:
        from pxr import Usd, UsdGeom
    except ImportError:
        raise Unavailable("USD needs the package usd-core.", advice=installing("usd")) from None
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    if sequence.unit:
        UsdGeom.SetStageMetersPerUnit(stage, sequence.unit)
    stage.SetTimeCodesPerSecond(options.fps)
    stage.SetFramesPerSecond(options.fps)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(1 + (len(sequence) - 1) * options.step)
    name = str(sequence.about["solver"]) or "result"
    mesh = UsdGeom.Mesh.Define(stage, f"/{name}")
    stage.SetDefaultPrim(mesh.GetPrim())
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    if sequence.is_open:
        mesh.CreateDoubleSidedAttr(True)
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    about = sequence.about
    mesh.GetPrim().SetCustomData(
        {"solver": name, "length": about["units"]["length"], "stageUnits": about["stages"]["units"]}
    )
    mesh.GetPrim().SetCustomDataByKey("stages", _doubles(about["stages"]["values"]))
    if sequence.seam is not None:
        _texture(mesh, sequence.seam)
    dressed(stage, mesh, sequence, pictures, matter(sequence) if options.full else None)
    for number, surface in enumerate(sequence):
        at = 1 + number * options.step
        if number == 0 or not sequence.kept:
            # triangles that stay have no time of their own
            _triangles(mesh, surface, None if sequence.kept else at)
        if surface.seam is not None:
            _texture(mesh, surface.seam, at)
        _sample(mesh, surface, at)
        if surface.colour is None:
            _wear(mesh, sequence.worn(sequence.stages[number]), at)
        _threads(stage, mesh, sequence.threads(surface, options.grown), at)
        for one in stems(sequence, surface, options):
            _stem(stage, mesh, one, at)
    return stage


def _encode(suffix: str, sequence: Sequence, options: Options) -> bytes:
    """Return a sequence as a USD file of the kind that the suffix names.

    Raises:
        Unavailable: usd-core is not installed.

    """
    stage = composed(sequence, options)
    with tempfile.TemporaryDirectory(prefix="wizen-") as folder:
        path = Path(folder) / f"result.{suffix}"
        stage.GetRootLayer().Export(str(path))
        return path.read_bytes()


usdc, usda = partial(_encode, "usdc"), partial(_encode, "usda")


def _doubles(values: Any) -> Any:
    from pxr import Vt

    return Vt.DoubleArray.FromNumpy(np.asarray(values, float))


def _triangles(mesh: Any, surface: Surface, at: float | None) -> None:
    from pxr import Usd, Vt

    when = Usd.TimeCode.Default() if at is None else at
    count = len(surface.triangles)
    mesh.CreateFaceVertexCountsAttr().Set(Vt.IntArray.FromNumpy(np.full(count, 3, np.int32)), when)
    corners = np.ascontiguousarray(surface.triangles.ravel(), np.int32)
    mesh.CreateFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(corners), when)


def _sample(mesh: Any, surface: Surface, at: float) -> None:
    from pxr import Sdf, UsdGeom, Vt

    points = surface.vertices
    mesh.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points)), at)
    mesh.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(surface.normals()), at)
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    mesh.CreateExtentAttr().Set(Vt.Vec3fArray.FromNumpy(ends), at)
    if surface.colour is not None:
        colour = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
        colour.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(surface.colour)), at)
    primvars = UsdGeom.PrimvarsAPI(mesh)
    more = {} if surface.roughness is None else {"roughness": surface.roughness}
    for name, values in {**surface.fields, **more}.items():
        own = primvars.CreatePrimvar(name, Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex)
        own.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(values)), at)


def _wear(mesh: Any, worn: Worn | None, at: float) -> None:
    """Write the one colour and roughness of a surface that has none of its own at its vertices."""
    from pxr import Gf, Sdf, UsdGeom, Vt

    if worn is None:
        return
    colour = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant)
    colour.Set(Vt.Vec3fArray([Gf.Vec3f(*map(float, worn.smooth))]), at)
    rough = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("roughness", Sdf.ValueTypeNames.Float, UsdGeom.Tokens.constant)
    rough.Set(worn.roughness, at)


def _threads(stage: Any, mesh: Any, threads: Threads | None, at: float) -> None:
    """Write the threads of a stage as curves below the mesh, and their heads as points."""
    from pxr import Gf, UsdGeom, Vt

    if threads is None:
        return
    curves = UsdGeom.BasisCurves.Define(stage, mesh.GetPath().AppendChild("hyphae"))
    curves.CreateTypeAttr(UsdGeom.Tokens.linear)
    count, steps = threads.points.shape[:2]
    points = np.ascontiguousarray(threads.points.reshape(-1, 3), np.float32)
    curves.CreateCurveVertexCountsAttr().Set(Vt.IntArray.FromNumpy(np.full(count, steps, np.int32)), at)
    curves.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(points), at)
    wide = np.broadcast_to(threads.width, count)
    narrow = (wide[:, None] * np.linspace(1, 0.35, steps)).ravel().astype(np.float32)
    curves.CreateWidthsAttr().Set(Vt.FloatArray.FromNumpy(narrow), at)
    curves.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
    share = np.linspace(0, 1, steps)[None, :, None]
    colour = (threads.low[:, None] * (1 - share) + threads.high[:, None] * share).reshape(-1, 3)
    paint = curves.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    paint.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(colour, np.float32)), at)
    headed = threads.heads > 0
    heads = UsdGeom.Points.Define(stage, mesh.GetPath().AppendChild("heads"))
    tips = np.ascontiguousarray(threads.points[headed, -1], np.float32)
    heads.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(tips), at)
    heads.CreateWidthsAttr().Set(Vt.FloatArray.FromNumpy((2 * threads.heads[headed]).astype(np.float32)), at)
    heads.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([Gf.Vec3f(0.03, 0.03, 0.03)])
    for prim in (curves, heads):
        bind(stage, prim.GetPrim(), mesh.GetPath().AppendChild("felt"), 1.0)


def _stem(stage: Any, mesh: Any, one: Extra, at: float) -> None:
    """Write a small mesh that stands on the fruit, as it stands there at a time."""
    from pxr import UsdGeom, Vt

    path = mesh.GetPath().AppendChild(one.name)
    small = UsdGeom.Mesh.Define(stage, path)
    small.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    small.CreateDoubleSidedAttr(True)
    small.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    counts = np.full(len(one.triangles), 3, np.int32)
    small.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
    small.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(one.triangles.ravel(), np.int32)))
    small.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(one.vertices)), at)
    small.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(one.normals)), at)
    ends = np.stack([one.vertices.min(axis=0), one.vertices.max(axis=0)])
    small.CreateExtentAttr().Set(Vt.Vec3fArray.FromNumpy(ends), at)
    paint = small.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    paint.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(one.colour)), at)
    bind(stage, small.GetPrim(), path.AppendChild("material"), one.roughness)


def _texture(mesh: Any, seam: Seam, at: float | None = None) -> None:
    """Write texture coordinates, those of a time where triangles change."""
    from pxr import Sdf, Usd, UsdGeom, Vt

    when = Usd.TimeCode.Default() if at is None else at
    primvars = UsdGeom.PrimvarsAPI(mesh)
    st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    st.Set(Vt.Vec2fArray.FromNumpy(np.column_stack([seam.uv[:, 0], 1 - seam.uv[:, 1]]).astype("f4")), when)
    st.SetIndices(Vt.IntArray.FromNumpy(np.ascontiguousarray(seam.triangles.ravel(), np.int32)), when)
