"""Materials of USD files: preview surfaces, and MaterialX beside them, of vertices' primvars or of pictures.

Light below the skin is MaterialX alone: a preview surface knows none. Needs usd-core.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from solver.contract import Matter

from ..formats import materialx

if TYPE_CHECKING:
    from .view import Sequence

__all__ = ["Pictures", "bind", "dressed"]

#: Paths in the file by time.
Files = list[tuple[float, str]]
_COLOUR = ("diffuseColor",)


class Pictures(NamedTuple):
    """What a material takes from pictures, by what it is in a preview surface: time and path in the file of each.

    heights: length that black and white of `displacement` stand for, by time.
    """

    files: dict[str, Files]
    heights: list[tuple[float, float, float]]


def dressed(stage: Any, mesh: Any, sequence: Sequence, pictures: Pictures | None, said: Matter | None) -> None:
    """Bind materials under the mesh's own names, which take what they show from pictures, else from the vertices."""
    from pxr import UsdGeom, UsdShade, Vt

    if not sequence.coloured and sequence.worn() is None:
        return
    # where triangles change from stage to stage none of them stays in its part
    parts = sequence.materials if sequence.kept else (("", np.empty(0, int)),)
    api = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim())
    for number, ((name, faces), prim) in enumerate(zip(parts, _prims([name for name, _ in parts]), strict=True)):
        material = _material(stage, mesh.GetPath().AppendChild(prim), name, pictures, said)
        if len(parts) == 1:
            api.Bind(material)
            continue
        indices = Vt.IntArray.FromNumpy(faces.astype(np.int32))
        subset = api.CreateMaterialBindSubset(f"part{number}", indices, UsdGeom.Tokens.face)
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(material)


def _prims(names: list[str]) -> list[str]:
    """Return what materials' prims are called: as the materials are, where USD lets them."""
    from pxr import Tf

    found: list[str] = []
    taken = {f"part{number}" for number in range(len(names))}
    for number, name in enumerate(names):
        own = Tf.MakeValidIdentifier(name) if name else f"material{number}"
        while own in taken:
            own += "_"
        taken.add(own)
        found.append(own)
    return found


def bind(stage: Any, prim: Any, path: Any, roughness: float) -> None:
    """Bind a material to a prim that takes its colour from the vertices and has one roughness."""
    from pxr import Sdf, UsdShade

    known = bool(stage.GetPrimAtPath(path))
    material = UsdShade.Material.Define(stage, path)
    if not known:
        shader = UsdShade.Shader.Define(stage, path.AppendChild("surface"))
        shader.CreateIdAttr("UsdPreviewSurface")
        colour = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        colour.ConnectToSource(_read(stage, path, "diffuseColor"))
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(roughness)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        materialx.add(stage, material, {"base_color": "displayColor", "specular_roughness": roughness})
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def _material(stage: Any, path: Any, name: str, pictures: Pictures | None, said: Matter | None) -> Any:
    from pxr import Sdf, UsdShade

    kinds, files = Sdf.ValueTypeNames, pictures.files if pictures else {}
    material = UsdShade.Material.Define(stage, path)
    material.GetPrim().SetDisplayName(name or "skin")
    shader = UsdShade.Shader.Define(stage, path.AppendChild("surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    for what in ("diffuseColor", "roughness"):
        kind = kinds.Color3f if what in _COLOUR else kinds.Float
        found = _pictured(stage, path, what, files[what]) if what in files else _read(stage, path, what)
        shader.CreateInput(what, kind).ConnectToSource(found)
    if "normal" in files:
        bent = _pictured(stage, path, "normal", files["normal"], [(0.0, 2.0, -1.0)])
        shader.CreateInput("normal", kinds.Normal3f).ConnectToSource(bent)
    if "displacement" in files and pictures:
        spans = [(at, high - low, low) for at, low, high in pictures.heights]
        tall = _pictured(stage, path, "displacement", files["displacement"], spans)
        shader.CreateInput("displacement", kinds.Float).ConnectToSource(tall)
        material.CreateDisplacementOutput().ConnectToSource(shader.ConnectableAPI(), "displacement")
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    inputs: dict[str, materialx.Source] = {
        "base_color": files.get("diffuseColor", "displayColor"),
        "specular_roughness": files.get("roughness", "roughness"),
    }
    if said is not None:
        inputs |= {"subsurface": said.subsurface, "subsurface_color": inputs["base_color"]}
        inputs |= {"subsurface_radius": said.reach, "sheen": said.sheen}
    height = None
    if "displacement" in files and pictures:
        height = (files["displacement"], max(high - low for _, low, high in pictures.heights))
    materialx.add(stage, material, inputs, files.get("normal"), height)
    return material


def _read(stage: Any, path: Any, what: str) -> Any:
    """Return the output of a reader of the vertices' colour or roughness."""
    from pxr import Gf, Sdf, UsdShade

    colour = what in _COLOUR
    kind = Sdf.ValueTypeNames.Float3 if colour else Sdf.ValueTypeNames.Float
    reader = UsdShade.Shader.Define(stage, path.AppendChild(what))
    reader.CreateIdAttr("UsdPrimvarReader_float3" if colour else "UsdPrimvarReader_float")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor" if colour else what)
    reader.CreateInput("fallback", kind).Set(Gf.Vec3f(0.5) if colour else 0.5)
    return reader.CreateOutput("result", kind)


def _pictured(
    stage: Any, path: Any, what: str, pictures: Files, spans: list[tuple[float, float, float]] | None = None
) -> Any:
    """Return the output of a texture whose picture changes from stage to stage.

    spans: time, scale and bias of its values, where they are not the picture's own.
    """
    from pxr import Gf, Sdf, UsdShade

    kinds = Sdf.ValueTypeNames
    reader = UsdShade.Shader.Define(stage, path.AppendChild("st"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", kinds.String).Set("st")
    texture = UsdShade.Shader.Define(stage, path.AppendChild(what))
    texture.CreateIdAttr("UsdUVTexture")
    file = texture.CreateInput("file", kinds.Asset)
    # who does not follow pictures in time sees the last
    file.Set(Sdf.AssetPath(pictures[-1][1]))
    if len(pictures) > 1:
        for at, name in pictures:
            file.Set(Sdf.AssetPath(name), at)
    texture.CreateInput("sourceColorSpace", kinds.Token).Set("sRGB" if what in _COLOUR else "raw")
    texture.CreateInput("wrapS", kinds.Token).Set("repeat")
    texture.CreateInput("wrapT", kinds.Token).Set("clamp")
    texture.CreateInput("st", kinds.Float2).ConnectToSource(reader.CreateOutput("result", kinds.Float2))
    for word, column in (("scale", 1), ("bias", 2)) if spans else ():
        assert spans is not None
        given = texture.CreateInput(word, kinds.Float4)
        given.Set(Gf.Vec4f(spans[-1][column]))
        for span in spans if len(spans) > 1 else ():
            given.Set(Gf.Vec4f(span[column]), span[0])
    flat = what in ("roughness", "displacement")
    return texture.CreateOutput("r", kinds.Float) if flat else texture.CreateOutput("rgb", kinds.Float3)
