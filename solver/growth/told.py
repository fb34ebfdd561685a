"""What is worth knowing of a run before it begins: places that no vertex sees, pictures that are finer than its mesh,
a mesh of one's own in another unit than its sheet, or too far away for the digits of what is handed over.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..contract import InvalidGeometry, Quality
from .own.textured import corners_of
from .params import GrowthParams
from .settings import choose
from .shapes import Ground, Mesh, start
from .tooling.places import Ball, Everywhere, Lines, Place
from .tooling.seen import Seen, seen
from .tooling.tools import Apex, HotCurve, HotSpot, HotStroke, HotSurface, HotTensors, Tool

__all__ = ["check_near", "note", "note_of_tool"]

#: What vertices may miss of a place: waves of two edges are still seen, a ball of four fifths of an edge hardly.
_MISSED = 0.6
#: Thickness over the size of a shape below which it is likely that they are in two units: the thinnest sheet of ours.
_THINNEST = 1 / 2500
#: Steps between two positions that can be handed over, over the mean edge: from the first on it is told, above the
#: second nothing is left of a shape.
_ROUGH, _LOST = 0.01, 0.05
#: Findings that are told, and dabs of a stroke that are looked at.
_MOST, _DABS = 5, 200


class _Asked(NamedTuple):
    """A place, the parameter that names it, the seed it is laid out by, and from which share on it does anything."""

    name: str
    place: Place
    seed: int
    least: float = 0.0
    kind: str = ""


def check_near(params: GrowthParams, dtype: str) -> None:
    """Refuse a mesh so far from the origin that positions in the precision that is asked for leave nothing of it.

    Raises:
        InvalidGeometry: it is, saying by how much it is to be moved.

    """
    mesh = params.mesh.shape() if params.mesh else None
    if mesh is not None and _step(mesh, dtype) > _LOST * _edge(mesh):
        raise InvalidGeometry(_far(mesh, dtype), advice=_nearer(mesh, dtype))


def note(params: GrowthParams, quality: Quality, dtype: str = "float32") -> str:
    """Return what a reader should know of a run of these parameters; nothing where there is nothing to tell.

    Places are looked at where they are when growth begins: of tools that start later nothing is told.

    Raises:
        InvalidInput: a place that the shape does not have, as the run would say.
        InvalidGeometry: as `check_near`.

    """
    check_near(params, dtype)
    mesh = params.mesh.shape() if params.mesh else start(params.shape, choose(quality).vertices, params.aspect)
    ground = Ground(mesh, _border(mesh.triangles), corners_of(params.mesh).get("uv"))
    found = list(_said(_places(params, ground), ground))
    told = [*_of_unit(params, mesh), *_of_place(mesh, dtype), *found[:_MOST]]
    if len(found) > _MOST:
        told.append(f"The same goes for {len(found) - _MOST} more.")
    return " ".join([*told, _advice(params, quality)] if found else told)


def note_of_tool(number: int, tool: Tool, params: GrowthParams, ground: Ground) -> str:
    """Return what to say of a tool that begins on this ground; nothing where all is well.

    Raises:
        InvalidInput: a place that the ground does not have.

    """
    at_once = tool.model_copy(update={"start": 0.0})
    return " ".join(_said(_of_tool(number, at_once, params, ground), ground))


def _unseen(asked: _Asked, of: Seen | None, ground: Ground) -> str:
    """Return what to say of a place that a mesh does not see as it was meant; nothing where it does."""
    if of is None:
        return ""
    edge, count = _edge(ground.mesh), len(ground.mesh.x)
    name = f"{asked.name} ({asked.kind or asked.place.kind})"
    if of.most <= 0 or of.most < asked.least:
        does = "holds" if asked.least else "touches"
        return f"{name} {does} none of the {count} vertices, which are {edge:.2g} apart, and so does nothing."
    if of.lost > _MISSED and not asked.least:
        return f"{name} is finer than the mesh, whose vertices are {edge:.2g} apart: it is missed or another pattern."
    return ""


def _advice(params: GrowthParams, quality: Quality) -> str:
    finer = "give a mesh of finer triangles" if params.mesh or quality == "fine" else "take a finer quality"
    return f"Move such a place onto the shape, make it wider or blur its picture, or {finer}."


def _of_unit(params: GrowthParams, mesh: Mesh) -> Iterator[str]:
    size = float(np.ptp(mesh.x, axis=0).max())
    if params.mesh and params.thickness < _THINNEST * size:
        yield (
            f"The mesh is {size:.4g} wide, and its sheet, with {params.thickness:g}, "
            f"{size / params.thickness:.0f} times thinner: is it in another unit? "
            "Thickness and tools are meant for a shape some 2 wide: "
            f"scale it by {float(f'{2 / size:.2g}'):g}, or take a larger `thickness`."
        )


def _of_place(mesh: Mesh, dtype: str) -> Iterator[str]:
    if _step(mesh, dtype) > _ROUGH * _edge(mesh):
        yield f"{_far(mesh, dtype).capitalize()} {_nearer(mesh, dtype)}"


def _far(mesh: Mesh, dtype: str) -> str:
    """Return a sentence on what becomes of a mesh where it lies."""
    return (
        f"the mesh lies {float(np.abs(mesh.x).max()):.2g} from the origin, where positions in {dtype} are "
        f"{_step(mesh, dtype):.2g} apart, and its vertices {_edge(mesh):.2g}."
    )


def _nearer(mesh: Mesh, dtype: str) -> str:
    """Return what to do about it."""
    by = ", ".join(f"{0.0 - x:.6g}" for x in ((mesh.x.min(axis=0) + mesh.x.max(axis=0)) / 2).tolist())
    also = ", or ask for float64 positions" if dtype == "float32" else ""
    return f"Move it to the origin, by ({by}){also}."


def _step(mesh: Mesh, dtype: str) -> float:
    """Return how far apart two positions are that can be handed over, where the mesh is furthest out."""
    return float(np.spacing(np.abs(mesh.x).max().astype(dtype)))


def _said(places: Iterable[_Asked], ground: Ground) -> Iterator[str]:
    for asked in places:
        if not isinstance(asked.place, Everywhere):
            said = _unseen(asked, seen(asked.place, ground, asked.seed), ground)
            if said:
                yield said


def _places(params: GrowthParams, ground: Ground) -> Iterator[_Asked]:
    """Yield the places that count when growth begins."""
    seed = params.seed
    for k, tool in enumerate(params.tools):
        if tool.start <= params.step - 1e-9:
            yield from _of_tool(k, tool, params, ground)
    for k, hold in enumerate(params.attached):
        yield _Asked(f"attached[{k}]", hold.where, seed, 0.5)
    for name, places in (
        ("thicknesses", [part.where for part in params.thicknesses]),
        ("ribs", [part.where for part in params.ribs]),
        ("colours", [part.where for part in params.colours]),
    ):
        for k, place in enumerate(places):
            yield _Asked(f"{name}[{k}]", place, seed + k)
    if params.bed:
        yield _Asked("bed", params.bed.where, seed)


def _of_tool(number: int, tool: Tool, params: GrowthParams, ground: Ground) -> Iterator[_Asked]:
    name, seed = f"tools[{number}]", params.seed + number
    if isinstance(tool, HotSurface):
        for called, place in (("", tool.where), (".later", tool.later), (".paced", tool.paced)):
            if place is not None:
                yield _Asked(name + called, place, seed)
    elif isinstance(tool, HotTensors):
        yield _Asked(name, tool.where, seed)
    elif isinstance(tool, HotSpot):
        yield _Asked(name, _ball(tool.at, tool.radius, ground), seed, kind=tool.kind)
    elif isinstance(tool, HotStroke):
        times = tool.times or (0.0,) * len(tool.points)
        for k, (point, time) in enumerate(zip(tool.points[:_DABS], times, strict=False)):
            if tool.start + time <= params.step - 1e-9:
                yield _Asked(f"{name}.points[{k}]", _ball(point, tool.radius, ground), seed, kind=tool.kind)
    elif isinstance(tool, HotCurve):
        line = _line(tool, params, ground)
        if line is not None:
            yield _Asked(name, line, seed, kind=tool.kind)


def _ball(at: tuple[float, float, float], radius: float, ground: Ground) -> Place:
    """Return a ball about the point of the surface that is nearest."""
    # kernels, which parameters must not load
    from .anchors import place

    x, y, z = place(np.array([at]), *ground.mesh).at(*ground.mesh)[0].tolist()
    return Ball(centre=(x, y, z), radius=radius)


def _line(tool: HotCurve, params: GrowthParams, ground: Ground) -> Place | None:
    """Return the lines that a curve begins as; None where what it follows does not begin with it."""
    from .anchors import place
    from .state import Spot
    from .tooling.placing import about

    mesh, apex = ground.mesh, tool.apex
    points = np.array(tool.points)
    if isinstance(apex, Apex):
        led = params.tools[apex.tool] if apex.tool is not None and apex.tool < len(params.tools) else None
        spots = {}
        if apex.tool is not None and isinstance(led, HotSpot) and led.start <= params.step - 1e-9:
            spots[apex.tool] = (Spot(place(np.array([led.at]), *mesh), led.radius),)
        points = about(apex, spots, mesh)
    there = place(points, *mesh).at(*mesh)
    closed = np.concatenate([there, there[:1]]) if tool.closed else there
    # a closed curve may have a point more than lines of a parameter file
    return Lines.model_construct(kind="lines", lines=(tuple(map(tuple, closed.tolist())),), width=tool.radius)


def _border(triangles: Ints) -> Ints:
    """Return the vertices of edges that have one triangle."""
    edges, n = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), int(triangles.max()) + 1
    found, count = np.unique(edges[:, 0] * n + edges[:, 1], return_counts=True)
    return np.unique(np.divmod(found[count == 1], n))


def _edge(mesh: Mesh) -> float:
    """Return the mean length of a mesh's edges."""
    sides: Floats = mesh.x[mesh.triangles] - mesh.x[np.roll(mesh.triangles, 1, axis=1)]
    return float(np.linalg.norm(sides, axis=-1).mean())
