"""Results cut open: what a plane leaves of each stage, closed by the cut face with what is known of the inside.

What lies below the skin is the solver's to say (`Looks.inside`): it is given the fields of the surface nearest to each
place of the cut face, how deep that lies, and where the result holds fields of the flesh itself (of the points at
`flesh_position`, in the tetrahedra `flesh_cell`) these as they are at the place. A solver that says nothing of its
inside cannot be cut open.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial import Delaunay, KDTree

from solver import meshes
from solver.arrays import Array
from solver.geometry.tetrahedra import within
from solver.meshes import Frame

from .errors import InvalidOption
from .pictures import colours, render
from .pictures.render import View

__all__ = ["Cut", "opened", "parsed", "picture"]

#: Points of the cut face along its longer side; neighbours that say what the skin above a place is like.
_ALONG, _NEIGHBOURS = 96, 4
#: Degrees from the normal that a picture is taken from.
_ASIDE, _ABOVE = -24.0, 14.0


class Cut(NamedTuple):
    """A plane: a point on it and its unit normal, which shows to the half that is taken away; lengths as in the run."""

    point: Array
    normal: Array


def parsed(text: str) -> Cut:
    """Return the plane that six numbers mean: X,Y,Z of a point and of the normal.

    Raises:
        InvalidOption: they mean none.

    """
    try:
        numbers = np.array([float(word) for word in text.split(",")])
    except ValueError:
        numbers = np.empty(0)
    if numbers.shape != (6,) or not np.isfinite(numbers).all() or not 1e-9 < np.linalg.norm(numbers[3:]) < 1e9:
        raise InvalidOption(
            f"cut {text[:60]!r} is no plane.",
            "Give six numbers, a point and the normal to the half that goes: 0,0,0,0,0,1.",
        )
    return Cut(numbers[:3], numbers[3:] / np.linalg.norm(numbers[3:]))


def opened(run: xr.Dataset, where: Cut) -> xr.Dataset:
    """Return a run whose stages are meshes cut open along a plane, closed by their cut faces.

    Raises:
        InvalidOption: its solver says nothing of its inside, it has no whole surface, or the plane misses it.

    """
    known = colours.looks(run)
    if known.inside is None:
        raise InvalidOption("nothing is known of the inside of this solver's results.", "Leave the cut out.")
    params = json.loads(run.attrs.get("params", "{}"))
    frames = []
    for index in range(run.sizes["stage"]):
        whole = _whole(run, index)
        half, rim = _halved(whole, where)
        if not len(rim):
            raise InvalidOption(
                f"the plane misses the fruit on stage {float(run['stage'][index]):g}.",
                "Move its point: the middle of the fruit is near 0,0,0.",
            )
        face = _face(half, rim, where)
        depth, above = _below(whole, face.vertices)
        told = known.inside({**above, **_held(run, index, face.vertices)}, depth, params)
        frames.append(_joined(half, face, told))
    attrs = {**run.attrs, "unit_of_length": run.attrs.get("unit_of_length", "r1")}
    stage = {name: run[name] for name in run.data_vars if run[name].dims == ("stage",)}
    return xr.Dataset({**stage, **meshes.changing(frames)}, {"stage": run["stage"]}, attrs)


def picture(run: xr.Dataset, where: Cut, *, title: str = "", symbol: str = "s", pixels: int = 360) -> bytes:
    """Return a PNG of all stages cut open side by side, seen from before the cut face.

    Raises:
        InvalidOption: as `opened`.

    """
    from .outputs import triangles
    from .pictures.sheet import sheet

    panels = triangles(opened(run, where))
    labels = [f"{symbol} = {float(stage):g}" for stage in run["stage"]]
    x, y, z = where.normal
    # a little from the side and from above, so that the skin is seen too
    level = float(np.degrees(np.arcsin(np.clip(y, -1, 1))))
    view = View(float(np.degrees(np.arctan2(z, x))) + _ASIDE, float(np.clip(level + _ABOVE, -80, 80)))
    return sheet([panels], title=title, column_labels=labels, pixels=pixels, view=view)


def _whole(run: xr.Dataset, index: int) -> Frame:
    """Return a stage's closed mesh with the scalar fields of its vertices."""
    if "mesh_position" in run:
        found = meshes.frame(run, index)
        fields = {name: np.asarray(x, float) for name, x in found.fields.items() if np.ndim(x) == 1}
        whole = Frame(found.vertices.astype(float), found.triangles, fields)
    elif "position" in run and json.loads(run.attrs.get("need", "{}")).get("region") is None:
        position = run["position"].values[index]
        points, triangles = render.mesh(position)
        fields = {}
        for name, variable in run.data_vars.items():
            if variable.dims == ("stage", "colatitude", "azimuth"):
                at = variable.values[index].astype(float)
                fields[str(name)] = np.concatenate([at.ravel(), [at[0].mean(), at[-1].mean()]])
        whole = Frame(points, triangles, fields)
    else:
        raise InvalidOption("there is no surface to cut.", "Ask for the field 'position' and no region.")
    edges = np.sort(whole.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    if (np.unique(edges, axis=0, return_counts=True)[1] != 2).any():
        raise InvalidOption("an open surface has no inside.", "Cut a closed mesh.")
    return whole


def _halved(whole: Frame, where: Cut) -> tuple[Frame, Array]:
    """Return what the plane leaves, and the edges (e, 2) of its rim: numbers of vertices of what is left."""
    x, t = whole.vertices, np.asarray(whole.triangles, np.int64)
    away = (x - where.point) @ where.normal
    away = np.where(np.abs(away) < 1e-9, -1e-9, away)  # no vertex lies in the plane
    out = away > 0
    count = out[t].sum(axis=1)
    crossed = t[(count == 1) | (count == 2)]
    # the corner that is alone on its side comes first; turning keeps which side is outside
    sides = out[crossed]
    alone = np.argmax(sides == (sides.sum(axis=1) == 1)[:, None], axis=1)
    a, b, c = np.take_along_axis(crossed, (alone[:, None] + [0, 1, 2]) % 3, axis=1).T
    ends = np.stack([np.stack([a, b], -1), np.stack([a, c], -1)])
    keys, number = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    share = (away[keys[:, 0]] / (away[keys[:, 0]] - away[keys[:, 1]]))[:, None]
    p, q = number.reshape(2, -1) + len(x)
    lone_out = out[a]
    kept = [
        t[count == 0],
        np.stack([a, p, q], -1)[~lone_out],
        np.stack([p, b, c], -1)[lone_out],
        np.stack([p, c, q], -1)[lone_out],
    ]
    rim = np.where(lone_out[:, None], np.stack([q, p], -1), np.stack([p, q], -1))

    def on(values: Array) -> Array:
        more = values[keys[:, 0]] * (1 - share[:, 0]) + values[keys[:, 1]] * share[:, 0]
        return np.concatenate([values, more])

    points = np.concatenate([x, x[keys[:, 0]] * (1 - share) + x[keys[:, 1]] * share])
    triangles = np.concatenate(kept)
    used, again = np.unique(triangles, return_inverse=True)
    place = np.full(len(points), -1)
    place[used] = np.arange(len(used))
    fields = {name: on(values)[used] for name, values in whole.fields.items()}
    return Frame(points[used], again.reshape(triangles.shape), fields), place[rim]


def _face(half: Frame, rim: Array, where: Cut) -> Frame:
    """Return the cut face: the rim's points and an even net within it, without fields."""
    numbers = np.unique(rim)
    outline = half.vertices[numbers]
    right = np.cross(where.normal, np.eye(3)[np.argmin(np.abs(where.normal))])
    right /= np.linalg.norm(right)
    up = np.cross(where.normal, right)
    flat = np.stack([(outline - where.point) @ right, (outline - where.point) @ up], -1)
    low, high = flat.min(axis=0), flat.max(axis=0)
    gap = float((high - low).max()) / _ALONG
    axes = [np.arange(low[k] + gap / 2, high[k], gap) for k in range(2)]
    net = np.stack(np.meshgrid(*axes), -1).reshape(-1, 2)
    place = np.full(int(numbers.max()) + 1, -1)
    place[numbers] = np.arange(len(numbers))
    segments = flat[place[rim]]
    # what is nearer to the rim than its own edges are long would hide them from Delaunay's triangles
    longest = float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).max())
    net = net[(KDTree(flat).query(net)[0] > 0.75 * longest) & _within(net, segments)]
    points = np.concatenate([flat, net])
    found = Delaunay(points).simplices
    corners = points[found]
    found = found[_within(corners.mean(axis=1), segments)]
    a, b, c = points[found].transpose(1, 0, 2)
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    found[turn < 0] = found[turn < 0][:, ::-1]
    found = found[np.abs(turn) > 1e-14]
    inside = where.point + net[:, :1] * right + net[:, 1:] * up
    return Frame(np.concatenate([outline, inside]), found, {})


def _within(points: Array, segments: Array) -> Array:
    """Return which points (k, 2) an outline of segments (s, 2, 2) in any order encloses, by crossings to the right."""
    (ax, ay), (bx, by) = segments[:, 0].T, segments[:, 1].T
    found = np.empty(len(points), np.bool_)
    for begin in range(0, len(points), 2048):
        x, y = points[begin : begin + 2048, 0, None], points[begin : begin + 2048, 1, None]
        spans = (ay > y) != (by > y)
        where = ax + (y - ay) / np.where(by == ay, 1.0, by - ay) * (bx - ax)
        found[begin : begin + 2048] = (spans & (where > x)).sum(axis=1) % 2 == 1
    return found


def _below(whole: Frame, places: Array) -> tuple[Array, dict[str, Array]]:
    """Return how deep places (k, 3) are below the skin, and the skin's fields above them."""
    far, near = (np.asarray(found) for found in KDTree(whole.vertices).query(places, k=_NEIGHBOURS))
    weight = 1 / np.maximum(far, 1e-9) ** 2
    weight /= weight.sum(axis=1, keepdims=True)
    return far[:, 0], {name: (values[near] * weight).sum(axis=1) for name, values in whole.fields.items()}


def _held(run: xr.Dataset, index: int, places: Array) -> dict[str, Array]:
    """Return the flesh's own fields of a stage at places (k, 3); none where the result has none."""
    if not {"flesh_position", "flesh_cell"} <= set(run.variables):
        return {}
    matrix = within(run["flesh_position"].values[index], run["flesh_cell"].values, places)
    return {
        str(name): matrix @ variable.values[index].astype(float)
        for name, variable in run.data_vars.items()
        if variable.dims == ("stage", "flesh_point")
    }


def _joined(half: Frame, face: Frame, told: Mapping[str, Array]) -> Frame:
    """Return both as one mesh; the rim's points are there twice, for skin and flesh have other colours."""
    fields = {}
    for name in sorted({*half.fields, *told}):
        skin = half.fields.get(name, np.zeros(len(half.vertices)))
        fields[name] = np.concatenate([skin, told.get(name, np.zeros(len(face.vertices)))])
    triangles = np.concatenate([half.triangles, face.triangles + len(half.vertices)])
    return Frame(np.concatenate([half.vertices, face.vertices]), triangles, fields)
