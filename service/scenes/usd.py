"""A scene as USD: one prototype mesh for each distinct level of a shape, and a PointInstancer that places them.

Mirror images are prototypes of their own: an instancer's scales mirror the points and not the winding.
An item's variants are those of its prototypes: whoever opens the file chooses among them, without asking again.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from solver.arrays import Array
from sweeps.errors import installing

from ..errors import Unavailable
from ..formats import materialx
from . import props
from .kinds import Kind
from .moving import FPS
from .placing import Instances

__all__ = ["usda", "usdc"]

#: Name of the variant set of a prototype that can be had at several stages.
_VARIANTS = "stage"


def _encode(
    suffix: str,
    kinds: Sequence[Kind],
    seen: Instances,
    n: Array,
    held: Sequence[props.Prop],
    unit: float,
    _: bool,
) -> bytes:
    """Return the layer's bytes.

    Raises:
        Unavailable: usd-core is not installed.

    """
    try:
        from pxr import Gf, Sdf, Usd, UsdGeom, Vt
    except ImportError:
        raise Unavailable("USD needs the package usd-core.", advice=f"{installing('usd')} Or ask for glb.") from None
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    moments = [seconds for kind in kinds for seconds, _ in kind.curve]
    if moments:
        stage.SetTimeCodesPerSecond(FPS)
        stage.SetFramesPerSecond(FPS)
        stage.SetStartTimeCode(FPS * min(moments))
        stage.SetEndTimeCode(FPS * max(moments))
    root = UsdGeom.Xform.Define(stage, "/scene")
    stage.SetDefaultPrim(root.GetPrim())
    materials: dict[str, Any] = {}
    if len(n):
        instancer = UsdGeom.PointInstancer.Define(stage, "/scene/fruits")
        UsdGeom.Scope.Define(stage, "/scene/fruits/prototypes")
        groups, number = np.unique(np.stack([seen.kind, n, seen.mirrored.astype(int)]), axis=1, return_inverse=True)
        for place, (k, size, mirrored) in enumerate(groups.T):
            kind = kinds[k]
            path = f"/scene/fruits/prototypes/shape{place}"
            for one in (kind, *kind.variants):
                _material(stage, materials, one)
            _prototype(stage, path, kind, int(size), bool(mirrored), materials)
            instancer.GetPrototypesRel().AddTarget(Sdf.Path(path))
        instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(number.ravel().astype(np.int32)))
        instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(seen.centre, np.float32)))
        turns = [Gf.Quath(float(w), Gf.Vec3h(float(x), float(y), float(z))) for x, y, z, w in seen.turn]
        instancer.CreateOrientationsAttr(Vt.QuathArray(turns))
        scales = np.repeat(seen.scale[:, None], 3, axis=1).astype(np.float32)
        instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(scales))
        _bound(instancer, moments)
    for place, prop in enumerate(held):
        _prop(stage, f"/scene/{prop.name}{place}", prop, materials)
    with tempfile.TemporaryDirectory(prefix="wizen-") as folder:
        path_ = Path(folder) / f"scene.{suffix}"
        stage.GetRootLayer().Export(str(path_))
        return path_.read_bytes()


usdc, usda = partial(_encode, "usdc"), partial(_encode, "usda")


def _bound(instancer: Any, moments: Sequence[float]) -> None:
    """Write a box that holds all instances: at every knot of curves, and whichever variants are chosen."""
    from pxr import Usd

    times = [Usd.TimeCode.Default(), *(Usd.TimeCode(time) for time in sorted({FPS * seconds for seconds in moments}))]
    prims = [instancer.GetPrim().GetStage().GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetTargets()]
    choices = [prim.GetVariantSets().GetVariantSet(_VARIANTS) for prim in prims if prim.HasVariantSets()]
    chosen, names = [one.GetVariantSelection() for one in choices], [one.GetVariantNames() for one in choices]
    boxes = []
    for place in range(max(map(len, names), default=1)):
        for choice, offered in zip(choices, names, strict=True):
            choice.SetVariantSelection(offered[min(place, len(offered) - 1)])
        boxes.append([np.array(instancer.ComputeExtentAtTime(time, time)) for time in times])
    for choice, name in zip(choices, chosen, strict=True):
        choice.SetVariantSelection(name)
    for time, low, high in zip(times, np.min(boxes, axis=0)[:, 0], np.max(boxes, axis=0)[:, 1], strict=True):
        instancer.CreateExtentAttr().Set(_vectors(np.stack([low, high])), time)


def _prototype(stage: Any, path: str, kind: Kind, n: int, mirrored: bool, material: Any) -> None:
    from pxr import UsdGeom

    prim = UsdGeom.Mesh.Define(stage, path).GetPrim()
    prim.SetDisplayName(kind.label)
    if not kind.variants:
        _filled(stage, path, kind, n, mirrored, material[kind.prim])
        return
    # what stands outside of variants is stronger than they are: all of the mesh is in them
    choice = prim.GetVariantSets().AddVariantSet(_VARIANTS)
    for one in (*kind.variants, kind):
        name = _word(one.label)
        choice.AddVariant(name)
        choice.SetVariantSelection(name)
        with choice.GetVariantEditContext():
            _filled(stage, path, one, min(n, one.finest), mirrored, material[one.prim])


def _word(label: str) -> str:
    """Return a label as the name of a variant: letters, digits, and underscores for all else."""
    return "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in label)


def _filled(stage: Any, path: str, kind: Kind, n: int, mirrored: bool, material: Any) -> None:
    from pxr import UsdGeom

    across = np.array([-1 if mirrored else 1, 1, 1], np.float32)
    surfaces = [(points * across, normal * across) for points, normal in kind.surfaces(n)]
    colours = kind.colours(n)
    triangles = kind.triangles(n)[:, :: -1 if mirrored else 1]
    found = _mesh(stage, path, *surfaces[0], triangles, material)
    for (seconds, _), (points, normal) in zip(kind.curve, surfaces, strict=False):
        found.GetPointsAttr().Set(_vectors(points), FPS * seconds)
        found.GetNormalsAttr().Set(_vectors(normal), FPS * seconds)
        found.GetExtentAttr().Set(_vectors(np.stack([points.min(axis=0), points.max(axis=0)])), FPS * seconds)
    if kind.skin.thin:
        found.CreateDoubleSidedAttr(True)
    paint = UsdGeom.Mesh.Get(stage, path).CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    paint.Set(_vectors(colours[0]))
    for (seconds, _), colour in zip(kind.curve if kind.fades else (), colours, strict=False):
        paint.Set(_vectors(colour), FPS * seconds)


def _vectors(values: Array) -> Any:
    from pxr import Vt

    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def _mesh(stage: Any, path: str, points: Array, normal: Array, triangles: Array, material: Any) -> Any:
    from pxr import UsdGeom, UsdShade, Vt

    found = UsdGeom.Mesh.Define(stage, path)
    found.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    found.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32)))
    found.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normal, np.float32)))
    found.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    found.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
    found.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(triangles.ravel(), np.int32)))
    ends = np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float32)
    found.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(ends)))
    UsdShade.MaterialBindingAPI.Apply(found.GetPrim()).Bind(material)
    return found


def _material(stage: Any, made: dict[str, Any], kind: Kind) -> Any:
    name = kind.prim
    if name not in made:
        made[name] = _shader(stage, f"/scene/looks/{name}", kind.skin.roughness, kind.skin.coat, None)
    return made[name]


def _shader(stage: Any, path: str, roughness: float, coat: float, colour: tuple[float, float, float] | None) -> Any:
    """Define a preview surface, of one colour or of the vertices' own."""
    from pxr import Gf, Sdf, UsdGeom, UsdShade

    if not stage.GetPrimAtPath("/scene/looks"):
        UsdGeom.Scope.Define(stage, "/scene/looks")
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    if coat:
        shader.CreateInput("clearcoat", Sdf.ValueTypeNames.Float).Set(coat)
        shader.CreateInput("clearcoatRoughness", Sdf.ValueTypeNames.Float).Set(0.3)
    diffuse = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if colour is not None:
        diffuse.Set(Gf.Vec3f(*colour))
    else:
        reader = UsdShade.Shader.Define(stage, f"{path}/colour")
        reader.CreateIdAttr("UsdPrimvarReader_float3")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
        diffuse.ConnectToSource(reader.CreateOutput("result", Sdf.ValueTypeNames.Float3))
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    looks: dict[str, materialx.Source] = {"base_color": colour or "displayColor", "specular_roughness": roughness}
    materialx.add(stage, material, {**looks, **({"coat": coat, "coat_roughness": 0.3} if coat else {})})
    return material


def _prop(stage: Any, path: str, prop: props.Prop, made: dict[str, Any]) -> None:
    from pxr import Gf, UsdGeom

    if "glaze" not in made:
        made["glaze"] = _shader(stage, "/scene/looks/glaze", 0.35, 0.0, (0.8, 0.77, 0.7))
    found = _mesh(stage, path, prop.points, prop.normal, prop.triangles, made["glaze"])
    UsdGeom.XformCommonAPI(found.GetPrim()).SetTranslate(Gf.Vec3d(*prop.at))
