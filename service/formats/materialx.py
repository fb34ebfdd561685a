"""MaterialX beside a preview surface: a material's output `mtlx:surface`, which renderers that know it prefer.

A standard surface (Autodesk, nodes of MaterialX 1.38 and later) under the names that its inputs have there. What is not
one number or colour is read from the mesh or from pictures, as the preview surface reads it. Needs usd-core.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

__all__ = ["Source", "add"]

#: A number, a colour in linear light, the name of a primvar, or pictures: time and path of each; the last is for all.
Source: TypeAlias = "float | tuple[float, float, float] | str | Sequence[tuple[float, str]]"
#: Of the inputs that we give: whether it is a colour.
_COLOURS = {
    **dict.fromkeys(("base_color", "subsurface_color", "subsurface_radius"), True),
    **dict.fromkeys(("specular_roughness", "coat", "coat_roughness", "subsurface", "sheen"), False),
}


def add(
    stage: Any,
    material: Any,
    inputs: Mapping[str, Source],
    normal: Sequence[tuple[float, str]] | None = None,
    height: tuple[Sequence[tuple[float, str]], float] | None = None,
) -> None:
    """Give a material (UsdShade.Material) a standard surface with these inputs, by MaterialX's names.

    normal: pictures of a normal map. height: pictures, and the length that white stands for.

    Raises:
        KeyError: an input of another name.

    """
    from pxr import Gf, Sdf, UsdShade

    path = material.GetPath()
    surface = UsdShade.Shader.Define(stage, path.AppendChild("standard_surface"))
    surface.CreateIdAttr("ND_standard_surface_surfaceshader")
    # else a fifth of the light is lost: the standard's own default is .8
    surface.CreateInput("base", Sdf.ValueTypeNames.Float).Set(1.0)
    for name, source in inputs.items():
        coloured = _COLOURS[name]
        kind = "color3" if coloured else "float"
        wanted = surface.CreateInput(name, Sdf.ValueTypeNames.Color3f if coloured else Sdf.ValueTypeNames.Float)
        if isinstance(source, str):
            wanted.ConnectToSource(_of_vertices(stage, path.AppendChild(f"{name}_of_vertices"), source, coloured))
        elif isinstance(source, int | float):
            wanted.Set(float(source))
        elif isinstance(source, tuple):
            wanted.Set(Gf.Vec3f(*source))
        else:
            wanted.ConnectToSource(_pictured(stage, path.AppendChild(f"{name}_of_pictures"), source, kind))
    if normal is not None:
        kinds = Sdf.ValueTypeNames
        bent = UsdShade.Shader.Define(stage, path.AppendChild("normalmap"))
        bent.CreateIdAttr("ND_normalmap_float")  # the name since 1.39
        read = _pictured(stage, path.AppendChild("normal_of_pictures"), normal, "vector3")
        bent.CreateInput("in", kinds.Float3).ConnectToSource(read)
        surface.CreateInput("normal", kinds.Float3).ConnectToSource(bent.CreateOutput("out", kinds.Float3))
    if height is not None:
        _displaced(stage, material, *height)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(surface.CreateOutput("out", Sdf.ValueTypeNames.Token))


def _displaced(stage: Any, material: Any, pictures: Sequence[tuple[float, str]], tall: float) -> None:
    from pxr import Sdf, UsdShade

    kinds, path = Sdf.ValueTypeNames, material.GetPath()
    moved = UsdShade.Shader.Define(stage, path.AppendChild("displaced"))
    moved.CreateIdAttr("ND_displacement_float")
    read = _pictured(stage, path.AppendChild("height_of_pictures"), pictures, "float")
    moved.CreateInput("displacement", kinds.Float).ConnectToSource(read)
    moved.CreateInput("scale", kinds.Float).Set(tall)
    material.CreateDisplacementOutput("mtlx").ConnectToSource(moved.CreateOutput("out", kinds.Token))


def _of_vertices(stage: Any, path: Any, primvar: str, coloured: bool) -> Any:
    from pxr import Gf, Sdf, UsdShade

    kinds = Sdf.ValueTypeNames
    kind = kinds.Color3f if coloured else kinds.Float
    reader = UsdShade.Shader.Define(stage, path)
    reader.CreateIdAttr(f"ND_geompropvalue_{'color3' if coloured else 'float'}")
    reader.CreateInput("geomprop", kinds.String).Set(primvar)
    reader.CreateInput("default", kind).Set(Gf.Vec3f(0.5) if coloured else 0.5)
    return reader.CreateOutput("out", kind)


def _pictured(stage: Any, path: Any, pictures: Sequence[tuple[float, str]], kind: str) -> Any:
    from pxr import Sdf, UsdShade

    kinds = Sdf.ValueTypeNames
    given = {"color3": kinds.Color3f, "float": kinds.Float, "vector3": kinds.Float3}[kind]
    place = UsdShade.Shader.Define(stage, path.GetParentPath().AppendChild("texcoord"))  # one for all
    place.CreateIdAttr("ND_geompropvalue_vector2")
    place.CreateInput("geomprop", kinds.String).Set("st")
    picture = UsdShade.Shader.Define(stage, path)
    picture.CreateIdAttr(f"ND_image_{kind}")
    file = picture.CreateInput("file", kinds.Asset)
    file.Set(Sdf.AssetPath(pictures[-1][1]))
    if len(pictures) > 1:
        for at, name in pictures:
            file.Set(Sdf.AssetPath(name), at)
    file.GetAttr().SetColorSpace("srgb_texture" if kind == "color3" else "raw")
    picture.CreateInput("uaddressmode", kinds.String).Set("periodic")
    picture.CreateInput("vaddressmode", kinds.String).Set("clamp")
    picture.CreateInput("texcoord", kinds.Float2).ConnectToSource(place.CreateOutput("out", kinds.Float2))
    return picture.CreateOutput("out", given)
