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
from scipy.spatial import KDTree

from solver import meshes
from solver.arrays import Array
from solver.geometry.halved import Halved, face, halved
from solver.geometry.tetrahedra import within
from solver.meshes import Frame

from .errors import InvalidOption
from .pictures import colours, render
from .pictures.render import View
from .surfaced import positions

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
        half = halved(whole.vertices, whole.triangles, *where)
        if not len(half.rim):
            raise InvalidOption(
                f"the plane misses the fruit on stage {float(run['stage'][index]):g}.",
                "Move its point: the middle of the fruit is near 0,0,0.",
            )
        found = face(half, *where, _gap(half, where))
        depth, above = _below(whole, found.points)
        told = known.inside({**above, **_held(run, index, found.points)}, depth, params)
        left = Frame(half.points, half.triangles, {name: half.taken @ x for name, x in whole.fields.items()})
        frames.append(_joined(left, Frame(found.points, found.triangles, {}), told))
    attrs = {**run.attrs, "unit_of_length": run.attrs.get("unit_of_length", "r1")}
    stage = {name: run[name] for name in run.data_vars if run[name].dims == ("stage",)}
    return xr.Dataset({**stage, **meshes.changing(frames)}, {"stage": run["stage"]}, attrs)


def picture(run: xr.Dataset, where: Cut, *, title: str = "", symbol: str = "s") -> bytes:
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
    return sheet([panels], title=title, column_labels=labels, pixels=360, view=view)


def _whole(run: xr.Dataset, index: int) -> Frame:
    """Return a stage's closed mesh with the scalar fields of its vertices."""
    if "mesh_position" in run:
        found = meshes.frame(run, index)
        fields = {name: np.asarray(x, float) for name, x in found.fields.items() if np.ndim(x) == 1}
        whole = Frame(found.vertices.astype(float), found.triangles, fields)
    elif (
        json.loads(run.attrs.get("need", "{}")).get("region") is None
        and (position := positions(run, index)) is not None
    ):
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


def _gap(half: Halved, where: Cut) -> float:
    """Return how far apart points of a cut face are: a share of its longer side."""
    outline = half.points[np.unique(half.rim)] - where.point
    right = np.cross(where.normal, np.eye(3)[np.argmin(np.abs(where.normal))])
    right /= np.linalg.norm(right)
    return float(max(np.ptp(outline @ right), np.ptp(outline @ np.cross(where.normal, right)))) / _ALONG


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
