"""Meshes cut by planes through their vertices, along their edges and in their flats: each edge twice, once each way."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from solver.arrays import Array
from solver.decay.surfaces.surface import geodesic
from solver.geometry.halved import face, halved
from solver.geometry.outlined import bordered, filled, flipped

Mesh = tuple[Array, Array]
AXES = np.eye(3)


def grid(rows: int, columns: int) -> Array:
    """Triangles of a net that closes both ways."""
    i, j = (each.ravel() for each in np.meshgrid(range(rows), range(columns), indexing="ij"))

    def at(a: Array, b: Array) -> Array:
        number: Array = (a % rows) * columns + b % columns
        return number

    corners = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    found: Array = np.concatenate([np.stack([corners[k] for k in pick], -1) for pick in ((0, 1, 2), (0, 2, 3))])
    return found


def torus(rows: int = 48, columns: int = 24) -> Mesh:
    u, v = np.meshgrid(np.arange(rows) * 2 * np.pi / rows, np.arange(columns) * 2 * np.pi / columns, indexing="ij")
    far = 1 + 0.4 * np.cos(v)
    return np.stack([far * np.cos(u), far * np.sin(u), 0.4 * np.sin(v)], -1).reshape(-1, 3), grid(rows, columns)


def globe(rows: int = 12, columns: int = 16) -> Mesh:
    """A ball by latitude and longitude, whose meridians and circles are rows of vertices."""
    made = trimesh.creation.uv_sphere(radius=1.0, count=[rows, columns])
    return np.asarray(made.vertices), np.asarray(made.faces)


def stairs() -> Mesh:
    """A solid of cubes: terraces, an overhang, and a furrow whose tip just reaches the height 0.5."""
    filled = np.zeros((8, 8, 8), bool)
    filled[:, :, :3] = filled[:4, :, 3:5] = filled[:2, :, 5:7] = filled[2:6, 2:5, 6] = True
    filled[2, 2:5, 5] = True
    filled[5:7, 5:7, 2] = False
    numbers: dict[tuple[int, ...], int] = {}
    found = []
    for cube in np.argwhere(filled):
        for axis in range(3):
            for up in (0, 1):
                beside = cube.copy()
                beside[axis] += 2 * up - 1
                if ((beside >= 0) & (beside < 8)).all() and filled[tuple(beside)]:
                    continue
                corners = []
                for across, along in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    corner = cube.copy()
                    corner[[axis, (axis + 1) % 3, (axis + 2) % 3]] += [up, across, along]
                    corners.append(numbers.setdefault(tuple(corner.tolist()), len(numbers)))
                a, b, c, d = corners if up else corners[::-1]
                found += [(a, b, c), (a, c, d)]
    return np.array(list(numbers), float) / 4 - 1, np.array(found)


def furrowed() -> Mesh:
    """A block whose underside has a furrow, the tip of which lies at the height 0.5: one edge, under the face."""
    profile = [(-1, 0), (-0.4, 0), (0, 0.5), (0.4, 0), (1, 0), (1, 0.5), (1, 1), (-1, 1), (-1, 0.5)]
    points = np.array([(x, y, z) for y in (-0.3, 0.3) for x, z in profile])
    ring = len(profile)
    inner = [(8, 0, 1), (8, 1, 2), (2, 3, 4), (2, 4, 5), (2, 5, 6), (8, 2, 7), (2, 6, 7)]
    sides = [
        triangle
        for i in range(ring)
        for j in [(i + 1) % ring]
        for triangle in ((i, ring + i, ring + j), (i, ring + j, j))
    ]
    ends = [*inner, *((a + ring, c + ring, b + ring) for a, b, c in inner)]
    made = trimesh.Trimesh(points, [*sides, *ends], process=False)
    assert made.is_watertight
    assert made.is_winding_consistent
    faces = np.asarray(made.faces)
    return points, faces if made.volume > 0 else faces[:, ::-1]


MESHES = {"ball": geodesic(12), "globe": globe(), "torus": torus(), "stairs": stairs(), "furrowed": furrowed()}


def whole(points: Array, triangles: Array, point: Array, normal: Array, gap: float = 0.08) -> trimesh.Trimesh:
    """Return half and face as one mesh."""
    half = halved(points, triangles, point, normal)
    closing = face(half, point, normal, gap)
    known = len(closing.numbers)
    place = np.concatenate([closing.numbers, len(half.points) + np.arange(len(closing.points) - known)])
    assert np.array_equal(half.points[closing.numbers], closing.points[:known])
    return trimesh.Trimesh(
        np.concatenate([half.points, closing.points[known:]]),
        np.concatenate([half.triangles, place[closing.triangles]]),
        process=False,
    )


def twice(mesh: trimesh.Trimesh) -> None:
    """No edge but has two triangles, which run along it in opposite ways."""
    ways = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(ways, axis=0)) == len(ways)
    assert {tuple(way) for way in ways.tolist()} == {tuple(way) for way in ways[:, ::-1].tolist()}


def planes(points: Array, triangles: Array, seed: int) -> list[tuple[Array, Array]]:
    """Planes through rows of vertices, along edges, in triangles, through three vertices, and anyhow."""
    draw = np.random.default_rng(seed)
    found = []
    for normal in (*AXES, *-AXES):
        heights = np.unique(np.round(points @ normal, 12))
        found += [(normal * height, normal) for height in draw.choice(heights, min(5, len(heights)), replace=False)]
        found.append((0.93 * heights[-1] * normal, normal))
    for a, b, c in points[triangles[draw.choice(len(triangles), 5)]]:
        found += [(a, np.cross(b - a, c - a)), (a, np.cross(c - a, b - a)), (a, np.cross(b - a, draw.normal(size=3)))]
    for a, b, c in points[draw.choice(len(points), (5, 3))]:
        found.append((a, np.cross(b - a, c - a)))
    found += [(draw.uniform(-0.4, 0.4, 3), draw.normal(size=3)) for _ in range(5)]
    return [(point, n / np.linalg.norm(n)) for point, n in found if np.linalg.norm(n) > 1e-9]


@pytest.mark.parametrize("name", MESHES)
def test_whatever_the_plane_passes_through_each_edge_has_two_triangles_and_the_halves_make_the_whole(name: str) -> None:
    points, triangles = MESHES[name]
    volume = trimesh.Trimesh(points, triangles, process=False).volume
    cut = 0
    for point, normal in planes(points, triangles, 4):
        away = (points - point) @ normal
        if away.max() < 1e-3 or away.min() > -1e-3:
            continue
        here, there = (whole(points, triangles, point, way) for way in (normal, -normal))
        twice(here)
        twice(there)
        assert here.volume + there.volume == pytest.approx(volume, rel=1e-3)
        assert ((here.vertices - point) @ normal).max() < 1e-9
        cut += 1
    assert cut > 20


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_a_globe_cut_along_a_meridian_is_half_of_it(angle: float) -> None:
    """Its meridians are rows of vertices that end in the poles."""
    points, triangles = globe(12, 16)
    normal = np.array([np.sin(angle), np.cos(angle), 0])
    found = whole(points, triangles, np.zeros(3), normal)
    twice(found)
    assert found.volume == pytest.approx(trimesh.Trimesh(points, triangles).volume / 2, rel=1e-9)


def test_a_ring_cut_where_its_hole_ends_meets_itself_in_one_point() -> None:
    """The section is a figure of eight, the lemniscate of Booth whose crossing is a vertex."""
    found = whole(*torus(96, 48), np.array([0.6, 0, 0]), np.array([1.0, 0, 0]))
    twice(found)
    flat = np.abs(found.vertices[:, 0] - 0.6) < 1e-9
    area = found.area_faces[flat[found.faces].all(axis=1)].sum()
    # the section's half-width at y: of a ring of 1 and .4 where the plane touches the hole from within
    y = np.linspace(0, np.sqrt(1.4**2 - 0.6**2), 20001)
    high = np.sqrt(np.maximum(0.16 - (np.hypot(0.6, y) - 1) ** 2, 0))
    assert area == pytest.approx(4 * np.trapezoid(high, y), rel=5e-3)


def test_what_lies_in_the_plane_whole_is_cut_face() -> None:
    """The terrace at the top of two slabs of the stairs: the face covers it, and none of its triangles is left."""
    points, triangles = stairs()
    half = halved(points, triangles, np.zeros(3) - 0.25, AXES[2])
    height = half.points[half.triangles][:, :, 2]
    assert height.min(axis=1).max() < -0.25
    found = face(half, np.zeros(3) - 0.25, AXES[2], 0.1)
    a, b, c = found.points[found.triangles].transpose(1, 0, 2)
    # 64 squares less a pit of four, which is open there
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx((64 - 4) / 16)


def test_fields_go_along_and_vertices_in_the_plane_keep_theirs() -> None:
    points, triangles = geodesic(8)
    half = halved(points, triangles, np.zeros(3), AXES[0])
    assert np.allclose(half.taken @ points, half.points, atol=2e-5)
    assert np.allclose(half.taken @ np.ones(len(points)), 1)
    rim = np.unique(half.rim)
    assert np.abs(half.points[rim, 0]).max() < 1e-12


def test_edges_that_delaunay_leaves_out_are_flipped_in() -> None:
    """Five points of a fan over a long edge that its circles forbid."""
    points = np.array([[-1, 0], [1, 0], [0, 0.05], [0, -0.05], [-0.3, 0.04], [0.3, -0.04]])
    fan = np.array([[0, 3, 4], [4, 3, 2], [3, 5, 2], [2, 5, 1]])
    got = flipped(points, fan, np.array([[0, 1]]))
    ways = {tuple(way) for way in got[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()}
    assert {(0, 1), (1, 0)} <= ways
    assert len(got) == len(fan)
    a, b, c = points[got].transpose(1, 0, 2)
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    assert (turn > 0).all()
    assert np.array_equal(bordered(got), bordered(fan))
    # an edge of the outline is not given up for another that crosses it
    crossed = flipped(points, fan, np.array([[0, 1], [3, 2]]))
    assert {(3, 2), (2, 3)} <= {tuple(way) for way in crossed[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()}


def test_holes_without_width_are_filled() -> None:
    """A point in the middle of a square's edge that no triangle has."""
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.0]])
    square = np.array([[0, 1, 2], [0, 2, 3]])
    rim = np.array([[0, 4], [4, 1], [1, 2], [2, 3], [3, 0]])
    got = filled(points, square, rim)
    assert len(got) == 3
    assert {tuple(way) for way in bordered(got).tolist()} == {tuple(way) for way in rim.tolist()}
