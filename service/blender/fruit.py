"""A fruit in the scene: a mesh whose vertices follow the object's own sliders, which may be animated as any number."""

from __future__ import annotations

import math
from array import array
from typing import Any

import bpy

from .client import Points, Refused
from .lattice import triangles, upright
from .state import STATE

__all__ = ["ask", "dress", "follow", "insert", "is_fruit", "sliders", "values"]

#: Names of what an object remembers besides its sliders.
_SOLVER, _TABLE, _AXES, _STAGE, _N = "wizen_solver", "wizen_table", "wizen_axes", "wizen_stage", "wizen_n"
#: Share of the wrinkles' height from which on a mesh holds them.
_ALL_HELD = 0.995


def is_fruit(thing: Any) -> bool:
    """Return whether an object is one of ours."""
    return thing is not None and thing.type == "MESH" and _TABLE in thing


def sliders(thing: Any) -> list[str]:
    """Return the names of a fruit's sliders, the stage last."""
    return [*filter(None, str(thing[_AXES]).split(",")), str(thing[_STAGE])]


def values(thing: Any) -> dict[str, float]:
    """Return what a fruit's sliders say, the stage last."""
    return {axis: float(thing[axis]) for axis in sliders(thing)}


def dress(thing: Any, name: str, scale: tuple[float, ...]) -> None:
    """Make a run's object as large as the fruit that it was asked for, and give it the skin of that, if it is there."""
    thing.scale = scale
    fruit = bpy.data.objects.get(name)
    if is_fruit(fruit):
        for material in fruit.data.materials:
            thing.data.materials.append(material)


def insert(name: str, n: int = 64) -> Any:
    """Put a fruit of a family at the 3D cursor, a ball until its shape has come, and return its object.

    Raises:
        Refused: there is no such family.

    """
    family = STATE.family(name)
    solver = STATE.solvers[family["solver"]]
    symbol = solver["stages"]["symbol"]
    mesh = bpy.data.meshes.new(name)
    _lattice(mesh, n)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(thing)
    thing.location = bpy.context.scene.cursor.location
    thing.scale = (STATE.size(family),) * 3
    thing[_SOLVER], thing[_TABLE], thing[_N] = family["solver"], name, n
    thing[_AXES], thing[_STAGE] = ",".join(family["axes"]), symbol
    stages = [one["stage"] for one in family["stages"]]
    ranges = {axis: (said["lowest"], said["highest"]) for axis, said in family["axes"].items()}
    ranges[symbol] = min(0.0, *stages), max(0.0, *stages)
    words = {axis: label["name"] for axis, label in solver["looks"]["labels"].items()}
    for axis, (low, high) in ranges.items():
        thing[axis] = float(family["portrait"][axis])
        thing.id_properties_ui(axis).update(
            min=low, max=high, soft_min=low, soft_max=high, description=words.get(axis, axis), precision=4
        )
    mesh.materials.append(_skin(family, solver))
    for other in bpy.context.selected_objects:
        other.select_set(False)
    thing.select_set(True)
    bpy.context.view_layer.objects.active = thing
    ask(thing)
    return thing


def ask(thing: Any) -> None:
    """Ask for the shape that a fruit's sliders say."""
    solver, table, n, name = thing[_SOLVER], thing[_TABLE], int(thing[_N]), thing.name
    said = values(thing)
    STATE.asked[name] = (n, *said.values())
    STATE.begin(("shape", name), lambda service: service.shape(solver, table, said, n), lambda p: _take(name, p))


def follow() -> int:
    """Ask for what has changed of any fruit since it was asked for last, and return how many there are."""
    count = 0
    for thing in bpy.data.objects:
        if is_fruit(thing):
            count += 1
            said = (int(thing[_N]), *values(thing).values())
            if STATE.asked.get(thing.name) != said:
                ask(thing)
    return count


def _take(name: str, found: Points) -> None:
    """Give a fruit its shape; one that was deleted meanwhile is none."""
    thing = bpy.data.objects.get(name)
    if not is_fruit(thing):
        return
    mesh = thing.data
    if len(mesh.polygons) != 4 * found.n**2:  # of another resolution, or of the quads that older versions made
        mesh.clear_geometry()
        _lattice(mesh, found.n)
    mesh.vertices.foreach_set("co", upright(found.positions))
    mesh.update()
    thing.update_tag()
    error = found.about.get("expected_error") or {}
    trust = "a run" if found.about.get("exact") else "between runs"
    rough = error.get("rgh")
    STATE.trust = f"{name}: {trust}" + ("" if rough is None else f", roughness to {100 * rough:.1f} %")
    held = found.about.get("held")
    if held is not None and held < _ALL_HELD:
        STATE.trust += f"; this mesh holds at least {100 * held:.0f} % of the wrinkles' height"


def _lattice(mesh: Any, n: int) -> None:
    """Fill an empty mesh with the closed lattice as a ball."""
    corners = triangles(n)
    positions = array("f")
    for i in range(n):
        theta = (i + 0.5) * math.pi / n
        for j in range(2 * n):
            phi = j * math.pi / n
            positions.extend((math.sin(theta) * math.cos(phi), -math.sin(theta) * math.sin(phi), math.cos(theta)))
    positions.extend((0, 0, 1, 0, 0, -1))
    mesh.vertices.add(len(positions) // 3)
    mesh.vertices.foreach_set("co", positions)
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(len(corners) // 3)
    mesh.polygons.foreach_set("loop_start", array("i", range(0, len(corners), 3)))
    mesh.update(calc_edges=True)
    mesh.validate()
    mesh.shade_smooth()


def _skin(family: dict[str, Any], solver: dict[str, Any]) -> Any:
    """Return the material of a family's skin, half dried: the shade whose name begins its preset's, else the last."""
    shades = solver["looks"]["shades"]
    name = next((s for s in shades for p in family["presets"] if p.startswith(s)), next(reversed(shades), ""))
    title = f"wizen {name or 'skin'}"
    material = bpy.data.materials.get(title)
    if material is None:
        material = bpy.data.materials.new(title)
        material.use_nodes = True
        node = next(one for one in material.node_tree.nodes if one.type == "BSDF_PRINCIPLED")
        if name:
            shade = shades[name]
            base = [0.5 * (a + b) for a, b in zip(*map(_linear, shade["ridge"]), strict=True)]
            node.inputs["Base Color"].default_value = (*base, 1)
            node.inputs["Roughness"].default_value = sum(shade["roughness"]) / 2
            node.inputs["Coat Weight"].default_value = shade["coat"]
            material.diffuse_color = (*base, 1)
    return material


def _linear(text: str) -> list[float]:
    """Return a colour #rrggbb in linear light."""
    if len(text) != 7:
        raise Refused(f"{text!r} is no colour.")
    shares = [int(text[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in shares]
