"""Materials of a USD stage as the MaterialX library sees them: its own nodes, its own generator of shaders."""

from __future__ import annotations

from functools import cache
from typing import Any

import MaterialX as mx
import MaterialX.PyMaterialXGenGlsl as glsl
import MaterialX.PyMaterialXGenShader as gen
from pxr import Sdf, Usd, UsdShade

KINDS = {"asset": "filename", "color3f": "color3", "float2": "vector2", "float3": "vector3", "token": "surfaceshader"}


@cache
def library() -> Any:
    found = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), found)
    return found


def read(material: UsdShade.Material) -> tuple[Any, dict[str, dict[str, Any]]]:
    """Return a material's network as a document, and what is not connected: values by node and input."""
    document, values, nodes = mx.createDocument(), {}, {}
    document.importLibrary(library())
    shaders = [UsdShade.Shader(p) for p in Usd.PrimRange(material.GetPrim()) if p.IsA(UsdShade.Shader)]
    shaders = [s for s in shaders if s.GetIdAttr().Get().startswith("ND_")]
    for shader in shaders:
        definition = library().getNodeDef(shader.GetIdAttr().Get())
        assert definition is not None, shader.GetIdAttr().Get()
        nodes[shader.GetPath()] = document.addNodeInstance(definition, shader.GetPrim().GetName())
    for shader in shaders:
        node, own = nodes[shader.GetPath()], values.setdefault(shader.GetPrim().GetName(), {})
        for given in shader.GetInputs():
            kind = str(given.GetTypeName())
            wanted = node.addInput(given.GetBaseName(), KINDS.get(kind, kind))
            sources, _ = given.GetConnectedSources()
            if sources:
                assert sources[0].sourceName == "out"
                wanted.setConnectedNode(nodes[sources[0].source.GetPath()])
                continue
            value = own[given.GetBaseName()] = given.Get()
            plain = value.path if isinstance(value, Sdf.AssetPath) else value
            wanted.setValueString(",".join(map(str, plain)) if kind == "color3f" else str(plain))
    surface = material.GetSurfaceOutput("mtlx").GetConnectedSources()[0][0].source
    document.addMaterialNode("of_it", nodes[surface.GetPath()])
    return document, values


def complaints(material: UsdShade.Material) -> str:
    """Return what MaterialX finds wrong with a material: names, kinds, and whether a shader can be made of it."""
    document, _ = read(material)
    valid, message = document.validate()
    if not valid:
        return str(message)
    generator = glsl.GlslShaderGenerator.create()
    context = gen.GenContext(generator)
    context.registerSourceCodeSearchPath(mx.getDefaultDataSearchPath())
    (element,) = gen.findRenderableElements(document)
    shader = generator.generate(element.getName(), element, context)
    return "" if "standard_surface" in shader.getSourceCode("pixel") else "no standard surface in the shader"


def materials(stage: Usd.Stage) -> list[UsdShade.Material]:
    return [UsdShade.Material(p) for p in stage.Traverse() if p.IsA(UsdShade.Material)]
