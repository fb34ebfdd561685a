"""Results cut open: the outline of each stage in a plane, over that of the first, as a picture.

Solvers here know surfaces, not flesh: nothing is known of how deep a colour goes. So a cut shows the outline fresh
(dashed) and now, the colours of the surface as a band along it, whose width means nothing, and a rigid core.
"""

from __future__ import annotations

import io
import json
from typing import NamedTuple

import numpy as np
import xarray as xr

from solver import meshes, registry
from solver.arrays import Array

from ..errors import InvalidOption
from ..surfaced import positions
from . import colours
from .render import mesh
from .shading import BACKGROUND
from .sheet import fit

__all__ = ["Plane", "cut", "picture", "plane"]


_INK, _FLESH, _CORE = "#3a2a24", "#efe3c8", "#8a6a4c"
_PLAIN = np.array([0.36, 0.10, 0.06])
#: Of a stage's picture, along and down.
_PIXELS = 320


class Plane(NamedTuple):
    """A plane through the origin: unit vectors along the picture's right and upper edge, and what to call it."""

    right: Array
    up: Array
    title: str


def plane(word: str) -> Plane:
    """Return the plane that a word on the command line means: an azimuth in degrees, or `equator`.

    Raises:
        InvalidOption: it means none.

    """
    if word == "equator":
        return Plane(np.array([1.0, 0, 0]), np.array([0, 0, -1.0]), "cut at the equator")
    try:
        angle = np.radians(float(word))
    except ValueError:
        angle = np.nan
    if not np.isfinite(angle):
        raise InvalidOption(
            f"--cut {word!r} is no plane.",
            "Give an azimuth in degrees, e.g. --cut 35, equator, or a point and a normal, e.g. --cut 0,0,0,0,0,1.",
        )
    along = np.array([np.cos(angle), 0, np.sin(angle)])
    return Plane(along, np.array([0, 1.0, 0]), f"cut along azimuth {float(word):g} degrees")


def cut(vertices: Array, triangles: Array, where: Plane, values: Array | None = None) -> tuple[Array, Array | None]:
    """Return the segments (s, 2, 2) in which a mesh (v, 3), (f, 3) meets a plane, in the plane's own coordinates.

    values: (v, k) of the vertices; then their means (s, k) over the segments come as well.
    """
    away = vertices @ np.cross(where.right, where.up)
    away = np.where(away == 0, 1e-12 * max(float(np.abs(away).max()), 1e-300), away)  # no vertex lies in the plane
    above = away[triangles] > 0
    crossed = triangles[above.any(axis=1) & ~above.all(axis=1)]
    sides = away[crossed] > 0
    # the corner that is alone on its side comes first
    alone = np.argmax(sides == (sides.sum(axis=1) == 1)[:, None], axis=1)
    corners = np.take_along_axis(crossed, (alone[:, None] + [0, 1, 2]) % 3, axis=1)
    first, others = corners[:, :1], corners[:, 1:]
    share = (away[first] / (away[first] - away[others]))[..., None]
    points = vertices[first] * (1 - share) + vertices[others] * share
    segments = np.stack([points @ where.right, points @ where.up], axis=-1)
    if values is None:
        return segments, None
    return segments, (values[first] * (1 - share) + values[others] * share).mean(axis=1)


def picture(run: xr.Dataset, where: Plane, *, title: str = "", symbol: str = "s") -> bytes:
    """Return a PNG of all stages of a result cut along a plane, at one scale.

    Raises:
        InvalidOption: the result has no surface to cut.

    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    cuts = [_section(run, i, where) for i in range(run.sizes["stage"])]
    reach = 1.15 * max(float(np.abs(segments).max(initial=1e-9)) for segments, _ in cuts)
    core = _core(run, where)
    paper = tuple(BACKGROUND ** (1 / 2.2))
    width, height = 16 + _PIXELS * len(cuts) + 16, _PIXELS + 118
    figure = Figure(figsize=(width / 100, height / 100), dpi=100, facecolor=paper)
    canvas = FigureCanvasAgg(figure)
    for i, (segments, colour) in enumerate(cuts):
        axes = figure.add_axes(((16 + i * _PIXELS) / width, 34 / height, _PIXELS / width, _PIXELS / height))
        if "colatitude" in run.dims:  # seen whole from the centre, so the fan of triangles is the inside
            fan = np.concatenate([np.zeros((len(segments), 1, 2)), segments], axis=1)
            axes.add_collection(PolyCollection(list(fan), facecolors=_FLESH, edgecolors=_FLESH, linewidths=0.6))
        if core is not None:
            axes.add_patch(Polygon(core, closed=True, facecolor=_CORE, edgecolor="none"))
        shown = colours.encoded(_PLAIN if colour is None else colour) / 255
        axes.add_collection(LineCollection(list(segments), colors=shown, linewidths=4.5, capstyle="round"))
        if i:
            axes.add_collection(LineCollection(_dashes(cuts[0][0]), colors=_INK, linewidths=0.9))
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        axes.set_axis_off()
        label = f"{symbol} = {float(run['stage'][i]):g}"
        figure.text((16 + (i + 0.5) * _PIXELS) / width, 1 - 66 / height, label, fontsize=11, color=_INK, ha="center")
    heading = ", ".join(word for word in (title, where.title) if word)
    written = figure.text(16 / width, 1 - 28 / height, heading, fontsize=13, color=_INK, va="center", fontweight="bold")
    fit(written, 13, width - 24)
    note = "Band: the surface's colour, not a depth. Dashed: the first stage. The inside is not solved."
    figure.text(16 / width, 17 / height, note, fontsize=8.5, color=_INK, va="center")
    out = io.BytesIO()
    canvas.print_png(out)
    return out.getvalue()


def _section(run: xr.Dataset, index: int, where: Plane) -> tuple[Array, Array | None]:
    if "mesh_position" in run:
        frame = meshes.frame(run, index)
        skin = colours.painted(run, index, frame.fields)
        return cut(frame.vertices.astype(float), frame.triangles, where, None if skin is None else skin.colour)
    position = positions(run, index)
    if position is None or "colatitude" not in run.dims:
        raise InvalidOption("there is no surface to cut.", "Ask for the field 'position' and no region.")
    vertices, triangles = mesh(position)
    skin = colours.of_run(run, index)
    if skin is None:
        return cut(vertices, triangles, where)
    paint = skin.colour
    ends = np.stack([paint[0].mean(axis=0), paint[-1].mean(axis=0)])
    return cut(vertices, triangles, where, np.concatenate([paint.reshape(-1, 3), ends]))


def _core(run: xr.Dataset, where: Plane) -> Array | None:
    """Return the outline (m, 2) of the rigid core in a plane; None without one."""
    name = str(run.attrs.get("solver", ""))
    if "colatitude" not in run.dims or name not in registry.names():
        return None
    fresh = registry.get(name).fresh(json.loads(run.attrs.get("params", "{}")))
    angle = np.linspace(0, 2 * np.pi, 181)
    rays = np.cos(angle)[:, None] * where.right + np.sin(angle)[:, None] * where.up
    distance = None if fresh is None else fresh.core(rays)
    return None if distance is None else distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _dashes(segments: Array) -> list[Array]:
    """Return every other stretch of an outline about the origin, by angle: segments come in no order."""
    middle = segments.mean(axis=1)
    turn = np.degrees(np.arctan2(middle[:, 1], middle[:, 0]))
    return list(segments[np.mod(turn, 6) < 3])
