"""Texture coordinates and materials of a mesh of one's own ride on the sheet through remeshing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.contract import InvalidInput
from solver.growth.engine import Engine
from solver.growth.fresh import fresh
from solver.growth.params import GrowthParams
from solver.growth.remeshing.collapses import collapse
from solver.growth.remeshing.cuts import cut
from solver.growth.remeshing.flips import flip
from solver.growth.shapes import Ground, Mesh
from solver.growth.tooling.textures import laid

#: Vertices along a side.
COUNT = 9
#: Two charts, each an affine map of the plane; what is right of x = 0 is of the second material.
CHARTS = (np.array([[0.4, 0.1], [-0.2, 0.3]]), np.array([0.5, 0.5])), (np.array([[0.1, 0.7], [0.6, 0.2]]), np.zeros(2))


def of_chart(number: int, points):
    turn, shift = CHARTS[number]
    return points[..., :2] @ turn + shift


def mapped(near: bool = False) -> dict:
    """Return a square in two charts with a seam at x = 0; near: two edges have a vertex near one end."""
    ticks = np.linspace(-1, 1, COUNT)
    points = np.stack([*np.meshgrid(ticks, ticks), np.zeros((COUNT, COUNT))], -1).reshape(-1, 3)
    corner = (np.arange(COUNT - 1) + COUNT * np.arange(COUNT - 1)[:, None]).ravel()
    square = np.stack([corner, corner + 1, corner + COUNT + 1, corner + COUNT], -1)
    faces = np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])
    middle = COUNT * (COUNT // 2) + COUNT // 2
    for i, j in ((middle, middle + 1), (middle - 3 - 2 * COUNT, middle - 2 - 2 * COUNT)) if near else ():
        new, points = len(points), np.concatenate([points, [0.9 * points[i] + 0.1 * points[j]]])
        beside = (faces == i).any(axis=1) & (faces == j).any(axis=1)
        halves = [np.where(faces[beside] == end, new, faces[beside]) for end in (i, j)]
        faces = np.concatenate([faces[~beside], *halves])
    right = (points[faces].mean(axis=1)[:, 0] > 0).astype(int)
    uv = np.concatenate([of_chart(0, points), of_chart(1, points)])
    return {
        "points": points.tolist(),
        "faces": faces.tolist(),
        "uv": uv.tolist(),
        "uv_faces": (faces + len(points) * right[:, None]).tolist(),
        "materials": ["left", "right"],
        "face_materials": right.tolist(),
    }


def begun(near: bool = False):
    params = GrowthParams.parse({"mesh": mapped(near), "tools": [], "imperfection": 0.0})
    return fresh(params, params.mesh.shape())


def check(state) -> None:
    """Every corner is where its chart has its vertex, and the seam is where it was."""
    places = state.x[state.mesh.triangles]
    for number in (0, 1):
        own = state.faces["material"] == number
        assert own.any()
        assert np.abs(state.corners["uv"][own] - of_chart(number, places[own])).max() < 1e-12
        side = places[own][:, :, 0] * (1 if number else -1)
        assert side.min() >= -1e-12


def test_cuts_interpolate_within_a_chart():
    state, _ = cut(begun(), 0.2)
    assert len(state.x) > 2 * len(begun().x)
    check(state)


def test_flips_turn_no_seam_over():
    """Sheared sideways the diagonals are wrong everywhere; so are edges on the seam."""
    state = begun()
    for axis, shear in ((1, -3.0), (0, -2.0)):
        corners = state.x.copy()
        corners[:, axis] += shear * state.x[:, 1 - axis]
        turned = flip(replace(state, g=shell.metric(corners, state.mesh.triangles)))
        before, now = ({tuple(edge) for edge in mesh.edges.tolist()} for mesh in (state.mesh, turned.mesh))
        assert len(now - before) > 10
        check(turned)


def test_collapses_leave_seams_and_move_corners():
    state = begun(near=True)
    coarser, left = collapse(state, 0.05)
    assert len(left) == COUNT**2
    assert COUNT**2 not in left, "the one beside the seam goes, not the one on it"
    assert np.isin(np.flatnonzero(state.x[:, 0] == 0), left).all()
    check(coarser)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"uv_faces": []}, "uv without uv_faces"),
        ({"uv": [[0, 0]]}, "of numbers below 1"),
        ({"face_materials": [0]}, "a row for each of the 128 triangles"),
    ],
)
def test_what_belongs_to_no_triangle_is_refused(words, said):
    with pytest.raises(InvalidInput, match=said):
        GrowthParams.parse({"mesh": mapped() | words})


def picture(field, size: int = 128) -> list:
    """Return a field of u and v as a picture: values at the middles of its pixels, the first row at v near 1."""
    middles = (np.arange(size) + 0.5) / size
    return field(middles[None, :], middles[::-1, None]).tolist()


def on_chart(points):
    """Return the coordinates (n, 2) of points that are on one side of the seam."""
    right = points[:, :1] > 0
    return np.where(right, of_chart(1, points), of_chart(0, points))


def wavy(u, v):
    """Return a field that repeats, as pictures do."""
    return 0.5 + 0.2 * np.sin(2 * np.pi * u) + 0.25 * np.cos(2 * np.pi * v)


def test_a_picture_lies_by_the_mesh_s_own_coordinates():
    """Also on what remeshing made, for a tool that starts late; a vertex on the seam has the mean of both charts."""
    place = {"kind": "texture", "picture": picture(wavy), "projection": "uv"}
    tool = {"kind": "surface", "where": place, "start": 0.2}
    grown = {"kind": "surface", "where": {"kind": "everywhere"}, "stretch": (3.0, 3.0), "duration": 0.15}
    values = {"mesh": mapped(), "tools": [grown, tool], "imperfection": 0.0, "remesh": 1.2, "step": 0.1}
    held = [{"where": {"kind": "everywhere"}, "axes": ["z"]}]
    made = Engine(GrowthParams.parse(values | {"attached": held, "ribs": [{"where": place}]}), 100)
    begun = made.state
    made.advance(np.inf, until=0.3)
    state = made.state
    assert len(state.x) > 1.2 * len(begun.x)
    scale = np.ptp(state.x[:, 0]) / 2
    for found, points in ((begun.matter["stiff"] / np.log(30), begun.x), (state.shares[1], state.x / scale)):
        points = points - (points.min(axis=0) + points.max(axis=0)) / 2
        off = np.abs(points[:, 0]) > 0.01
        assert np.abs(found[off] - wavy(*on_chart(points[off]).T)).max() < 0.01
        sides = [wavy(*of_chart(number, points[~off]).T) for number in (0, 1)]
        assert len(sides[0]) >= COUNT
        assert np.abs(sides[0] - sides[1]).max() > 0.1, "the charts say the same"
        assert (found[~off] > np.minimum(*sides) - 0.01).all()
        assert (found[~off] < np.maximum(*sides) + 0.01).all()
        inner = np.abs(points[~off][:, 1]) < 0.9
        assert np.abs(found[~off] - np.mean(sides, axis=0))[inner].max() < 0.06


def test_coordinates_beyond_the_picture_repeat_it():
    """To the right of 1 it begins anew at its left, above 1 at its bottom."""
    values = np.arange(20.0).reshape(4, 5) / 20
    x, triangles = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    corners = np.array([[[0.3, 0.375], [1.3, 0.375], [0.3, 1.375]]])
    found = laid(values, Ground(Mesh(x, triangles), np.empty(0, np.int64), corners), "uv")
    assert found == pytest.approx(values[1, 1])
    edge = np.array([[[0.0, 0.375], [0.3, 0.0], [0.3, 1.0]]])
    found = laid(values, Ground(Mesh(x, triangles), np.empty(0, np.int64), edge), "uv")
    assert found == pytest.approx([(values[1, 0] + values[1, 4]) / 2, values[0, 1], values[3, 1]])
