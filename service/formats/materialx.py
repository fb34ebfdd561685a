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
_COLOURS = {"base_color": True, "specular_roughness": False, "coat": False, "coat_roughness": False}


def add(stage: Any, material: Any, inputs: Mapping[str, Source]) -> None:
    """Give a material (UsdShade.Material) a standard surface with these inputs, by MaterialX's names.

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
        wanted = surface.CreateInput(name, Sdf.ValueTypeNames.Color3f if coloured else Sdf.ValueTypeNames.Float)
        if isinstance(source, str):
            wanted.ConnectToSource(_of_vertices(stage, path.AppendChild(f"{name}_of_vertices"), source, coloured))
        elif isinstance(source, int | float):
            wanted.Set(float(source))
        elif isinstance(source, tuple):
            wanted.Set(Gf.Vec3f(*source))
        else:
            wanted.ConnectToSource(_pictured(stage, path.AppendChild(f"{name}_of_pictures"), source, coloured))
    material.CreateSurfaceOutput("mtlx").ConnectToSource(surface.CreateOutput("out", Sdf.ValueTypeNames.Token))


def _of_vertices(stage: Any, path: Any, primvar: str, coloured: bool) -> Any:
    from pxr import Gf, Sdf, UsdShade

    kinds = Sdf.ValueTypeNames
    kind = kinds.Color3f if coloured else kinds.Float
    reader = UsdShade.Shader.Define(stage, path)
    reader.CreateIdAttr(f"ND_geompropvalue_{'color3' if coloured else 'float'}")
    reader.CreateInput("geomprop", kinds.String).Set(primvar)
    reader.CreateInput("default", kind).Set(Gf.Vec3f(0.5) if coloured else 0.5)
    return reader.CreateOutput("out", kind)


def _pictured(stage: Any, path: Any, pictures: Sequence[tuple[float, str]], coloured: bool) -> Any:
    from pxr import Sdf, UsdShade

    kinds = Sdf.ValueTypeNames
    place = UsdShade.Shader.Define(stage, path.GetParentPath().AppendChild("texcoord"))  # one for all
    place.CreateIdAttr("ND_geompropvalue_vector2")
    place.CreateInput("geomprop", kinds.String).Set("st")
    picture = UsdShade.Shader.Define(stage, path)
    picture.CreateIdAttr(f"ND_image_{'color3' if coloured else 'float'}")
    file = picture.CreateInput("file", kinds.Asset)
    file.Set(Sdf.AssetPath(pictures[-1][1]))
    if len(pictures) > 1:
        for at, name in pictures:
            file.Set(Sdf.AssetPath(name), at)
    file.GetAttr().SetColorSpace("srgb_texture" if coloured else "raw")
    picture.CreateInput("uaddressmode", kinds.String).Set("periodic")
    picture.CreateInput("vaddressmode", kinds.String).Set("clamp")
    picture.CreateInput("texcoord", kinds.Float2).ConnectToSource(place.CreateOutput("out", kinds.Float2))
    return picture.CreateOutput("out", kinds.Color3f if coloured else kinds.Float)
