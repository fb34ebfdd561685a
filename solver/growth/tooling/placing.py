"""Where tools begin on the shape, and what becomes of hot spots when they split: in rings, or by an L-system."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ... import shell
from ...arrays import Floats, Ints
from ...contract import Context, InvalidInput
from ..anchors import Anchors, place
from ..shapes import Ground, Mesh
from ..state import Spot, State
from .painted import laid_tensors
from .places import share
from .tools import Apex, HotCurve, HotSpot, HotStroke, HotSurface, HotTensors, Tool, clocked

__all__ = ["about", "border", "branched", "started"]


#: Control points of a curve about an apex; and how far ahead a heading is marked, over the spot's radius.
_AROUND, _AHEAD = 24, 0.2
#: Cosine of the angle to the normal, 6 degrees, within which a frame is none.
_STEEP = 0.9945


def border(mesh: shell.Topology) -> Ints:
    """Return the vertices of the surface's edge."""
    return np.unique(mesh.edges[mesh.border])


def started(state: State, tools: Sequence[Tool], step: float, seed: int) -> State:
    """Return the state with the tools placed that start in the next step, on the shape at its beginning.

    Raises:
        InvalidInput: a place that the shape does not have, an apex without its hot spot.

    """
    shares, spots, curves = dict(state.shares), dict(state.spots), dict(state.curves)
    mesh = Mesh(state.x, state.mesh.triangles)
    ground = Ground(mesh, border(state.mesh), state.corners.get("uv"))
    later = state.time > 1e-9
    for number, tool in enumerate(tools):
        if isinstance(tool, HotStroke):
            if tool.start <= state.time + step - 1e-9:
                spots[number] = _dabs(tool, spots.get(number, ()), state.time, step, mesh)
            continue
        if number in shares or number in spots or number in curves or tool.start > state.time + step - 1e-9:
            continue
        if isinstance(tool, HotSurface):
            shares[number] = share(tool.where, ground, seed + number)
            _check_direction(number, tool, shares[number], mesh)
            if clocked(tool):
                clocks = (
                    share(p, ground, seed + number) if p else np.zeros(len(mesh.x)) for p in (tool.later, tool.paced)
                )
                shares[number] = np.stack([shares[number], *clocks], -1)
        elif isinstance(tool, HotTensors):
            shares[number] = laid_tensors(number, tool, ground, seed + number)
        elif isinstance(tool, HotCurve):
            if tool.apex is None:
                curves[number] = _on(number, "a point", np.array(tool.points), tool.radius, mesh, later)
            else:
                curves[number] = place(about(tool.apex, spots, mesh), *mesh)
        else:
            spots[number] = (_first(number, tool, mesh, later),)
    return replace(state, shares=shares, spots=spots, curves=curves)


def branched(state: State, tools: Mapping[int, Tool], seed: int) -> State:
    """Return the state with the spots split whose time has come."""
    spots = dict(state.spots)
    for number, tool in tools.items():
        if not isinstance(tool, HotSpot) or not spots.get(number):
            continue
        while spots[number] and (done := spots[number][0].splits) < len(tool.splits):
            if state.time - tool.start < tool.splits[done] - 1e-9:
                break
            chance = Context.generator(seed + 1000 * number + done)
            spots[number] = tuple(
                child
                for spot in spots[number]
                for child in (_written(state, spot, tool, chance) if tool.rules else _ring(state, spot, tool))
            )
    return replace(state, spots=spots)


def _dabs(tool: HotStroke, laid: tuple[Spot, ...], time: float, step: float, mesh: Mesh) -> tuple[Spot, ...]:
    """Return the dabs of a stroke that act in a step: those that lie there already, and new ones."""
    there = {spot.dab: spot for spot in laid}
    # their times rise: what is neither over nor to come is a run of them
    times = np.array(tool.times or (0.0,) * len(tool.points)) + tool.start
    first, last = np.searchsorted(times, [time + 1e-9 - tool.hold, time + step - 1e-9])
    return tuple(
        there.get(k) or Spot(place(np.array([tool.points[k]]), *mesh), tool.radius, dab=k)
        for k in range(int(first), int(last))
    )


def _on(number: int, what: str, points: Floats, reach: float, mesh: Mesh, later: bool) -> Anchors:
    """Return the nearest points of the surface to points that a tool begins at.

    Raises:
        InvalidInput: they are not on it: further off than the tool reaches, or than the shape may have moved meanwhile.

    """
    anchors = place(points, *mesh)
    there = anchors.at(*mesh)
    away = np.linalg.norm(there - points, axis=1)
    far = int(away.argmax())
    if away[far] > (max(reach, float(np.ptp(mesh.x, axis=0).max())) if later else reach):
        near = ", ".join(f"{value:.3g}" for value in there[far])
        raise InvalidInput(
            f"tool {number}: {what} lies {away[far]:.3g} off the surface, further than it reaches ({reach:g}).",
            advice=f"The nearest point of the surface is ({near}).",
        )
    return anchors


def _check_frame(number: int, tool: HotSpot, anchor: Anchors, mesh: Mesh) -> None:
    """Refuse a frame that stands on the surface, where along and across differ.

    Raises:
        InvalidInput: it has no direction along the surface.

    """
    frame = np.array(tool.frame)
    size = float(np.linalg.norm(frame))
    if tool.stretch[0] != tool.stretch[1] and abs(_normal(anchor, mesh) @ frame) >= _STEEP * size:
        side, _ = _plane(_normal(anchor, mesh), np.eye(3)[int(np.argmin(np.abs(frame)))])
        raise InvalidInput(
            f"tool {number}: its frame {tool.frame} stands on the surface there: it has no direction along it.",
            advice=f"Give a direction along the surface, such as ({_named(side)}).",
        )


def _check_direction(number: int, tool: HotSurface, share: Floats, mesh: Mesh) -> None:
    """Refuse a frame that stands on the surface wherever it acts, where along and across differ.

    Raises:
        InvalidInput: it has no direction along the surface.

    """
    same = tool.stretch[0] == tool.stretch[1] and tool.curl[0] == tool.curl[1]
    some = mesh.triangles[share[mesh.triangles].any(axis=1)]
    if same or tool.frame == "around" or not len(some):
        return
    frame = np.array(tool.frame)
    p = mesh.x[some]
    normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    if (np.abs(normals @ frame) >= _STEEP * np.linalg.norm(normals, axis=1) * np.linalg.norm(frame)).all():
        side, _ = _plane(normals[0] / np.linalg.norm(normals[0]), np.eye(3)[int(np.argmin(np.abs(frame)))])
        raise InvalidInput(
            f"tool {number}: its frame {tool.frame} stands on the surface wherever it acts: it has no direction there.",
            advice=f"Give a direction along the surface, such as ({_named(side)}), or 'around'.",
        )


def _named(way: Floats) -> str:
    return ", ".join(f"{value:.2g}" for value in way)


def _first(number: int, tool: HotSpot, mesh: Mesh, later: bool) -> Spot:
    anchor = _on(number, "the spot", np.array([tool.at]), tool.radius, mesh, later)
    _check_frame(number, tool, anchor, mesh)
    if not tool.rules:
        return Spot(anchor, tool.radius)
    centre, normal = anchor.at(*mesh)[0], _normal(anchor, mesh)
    side, _ = _plane(normal, np.array(tool.frame))
    return Spot(_headed(centre, side, tool.radius, mesh), tool.radius, 0, tool.axiom)


def _headed(centre: Floats, way: Floats, radius: float, mesh: Mesh) -> Anchors:
    return place(np.stack([centre, centre + _AHEAD * radius * way]), *mesh)


def _normal(anchor: Anchors, mesh: Mesh) -> Floats:
    p = mesh.x[mesh.triangles[anchor.faces[0]]]
    normal = np.cross(p[1] - p[0], p[2] - p[0])
    return np.asarray(normal / np.linalg.norm(normal))


def _plane(normal: Floats, frame: Floats) -> tuple[Floats, Floats]:
    """Return two directions at right angles in the plane of a normal, the first as near to `frame` as can be."""
    side = frame - (normal @ frame) * normal
    if np.linalg.norm(side) < 1e-6:
        side = np.eye(3)[np.argmin(np.abs(normal))]
        side = side - (normal @ side) * normal
    side = side / np.linalg.norm(side)
    return side, np.cross(normal, side)


def about(apex: Apex, spots: Mapping[int, tuple[Spot, ...]], mesh: Mesh) -> Floats:
    """Return the control points of a curve about an apex.

    Raises:
        InvalidInput: it follows a tool that is no hot spot, or one that has not started.

    """
    if apex.tool is not None:
        if not spots.get(apex.tool):
            raise InvalidInput(
                f"an apex follows tool {apex.tool}, which is no hot spot that has started.",
                advice="Give a hot spot's number that stands before the curve in the list.",
            )
        anchor = spots[apex.tool][0].anchor
    else:
        anchor = place(np.array([apex.at]), *mesh)
    centre = anchor.at(*mesh)[0]
    side, other = _plane(_normal(anchor, mesh), np.array(apex.frame))
    if apex.across:
        found: Floats = centre + apex.radius * np.linspace(-1, 1, _AROUND)[:, None] * side
        return found
    turns = np.radians(apex.arc) * np.linspace(0, 1, _AROUND, endpoint=apex.arc < 360)
    return np.asarray(centre + apex.radius * (np.cos(turns)[:, None] * side + np.sin(turns)[:, None] * other))


def _ring(state: State, spot: Spot, tool: HotSpot) -> Iterator[Spot]:
    """Yield the spots around one; every generation splits at right angles to the one before."""
    mesh = Mesh(state.x, state.mesh.triangles)
    centre = spot.anchor.at(*mesh)[0]
    other, side = _plane(_normal(spot.anchor, mesh), np.array(tool.frame))
    for k in range(tool.branches):
        turn = 2 * np.pi * k / tool.branches + (np.pi / 2 if spot.splits % 2 else 0.0)
        target = centre + tool.spread * spot.radius * (np.cos(turn) * side - np.sin(turn) * other)
        yield Spot(place(target[None], *mesh), spot.radius * tool.shrink, spot.splits + 1)


def _written(state: State, spot: Spot, tool: HotSpot, chance: np.random.Generator) -> Iterator[Spot]:
    """Yield the spots that a letter's rule writes, by a turtle in the plane of the spot; without a rule, itself."""
    words = tool.rules.get(spot.letter, (spot.letter,))
    word = words[int(chance.integers(len(words)))]
    mesh = Mesh(state.x, state.mesh.triangles)
    centre, ahead = spot.anchor.at(*mesh)
    normal = _normal(spot.anchor, mesh)
    side, other = _plane(normal, ahead - centre)
    at, heading, radius = centre, 0.0, spot.radius
    kept: list[tuple[Floats, float, float]] = []
    for sign in word:
        way = np.cos(heading) * side + np.sin(heading) * other
        if sign == "f":
            at = at + tool.spread * radius * way
        elif sign in "+-":
            heading += np.radians(tool.turn) * (1 if sign == "+" else -1)
        elif sign == "!":
            radius *= tool.shrink
        elif sign == "[":
            kept.append((at, heading, radius))
        elif sign == "]":
            at, heading, radius = kept.pop()
        else:
            yield Spot(_headed(at, way, radius, mesh), radius, spot.splits + 1, sign)
