"""The rigid bodies in a stage's mesh, so that whoever opens a result sees what pressed."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from ...meshes import Frame
from ..model.arrays import Poses
from ..model.bodies.building import between
from ..model.bodies.solids import pivot_of, solid_of
from ..params import Body, WoodParams

__all__ = ["among", "shown", "solid"]

#: Radius of what a picture shows over the bundle's length; the most, for bodies' sake; and what of it they may exceed.
_SHOWN, _MOST, _BESIDE = 0.42, 1.0, 1.5
#: Cosine between normals of two triangles above which their common side is no edge.
_SMOOTH = 0.8


def _drawn(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) [m] from its centre and triangles (f, 3) of a body, of a mesh parted at its edges."""
    points, faces = solid_of(body)
    if body.shape != "mesh":
        return points, faces
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    # corner k of a triangle begins its side k; that of the neighbour runs the other way
    first, second = faces.ravel(), np.roll(faces, -1, 1).ravel()
    order = np.argsort(first * len(points) + second)
    other = order[np.searchsorted(first * len(points) + second, second * len(points) + first, sorter=order)]
    side = np.arange(len(first))
    smooth = (normal[side // 3] * normal[other // 3]).sum(1) > _SMOOTH
    # where two triangles are smooth, this side's first corner is the neighbour's second
    after = 3 * (other // 3) + (other + 1) % 3
    joined = coo_matrix((smooth[smooth], (side[smooth], after[smooth])), (len(side), len(side)))
    number, label = connected_components(joined, directed=False)
    found = np.empty((number, 3))
    found[label] = points[first]
    return found, label.reshape(-1, 3)


def solid(body: Body, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) [m] and triangles (f, 3), seen from outside counter-clockwise, of a body at `time` [s].

    One with a mass, which goes no path, is where it begins.
    """
    points, faces = _drawn(body)
    times = [w.time for w in body.path]
    points = points - pivot_of(body)
    if any(any(w.turn) for w in body.path):
        n = max(int(np.searchsorted(times, time, "right")) - 1, 0)
        turn = Rotation.from_rotvec(body.path[n].turn)
        if n + 1 < len(times) and time > times[n]:
            way = between(body.path[n].turn, body.path[n + 1].turn)
            turn = Rotation.from_rotvec(way * (time - times[n]) / (times[n + 1] - times[n])) * turn
        points = turn.apply(points)
    return points + [np.interp(time, times, [w.position[c] for w in body.path]) for c in range(3)], faces


def shown(params: WoodParams, middle: np.ndarray) -> float:
    """Return the radius [m] about a middle (3,) that a picture shows: the bundle's, and that of bodies' ways.

    Those twice as long as the bundle, as floors, are not made room for.
    """
    far = 0.0
    for body in params.bodies:
        if np.ptp(solid_of(body)[0], axis=0).max() <= 2 * params.length:
            for point in body.path:
                far = max(far, float(np.linalg.norm(solid(body, point.time)[0] - middle, axis=1).max()))
    return min(max(_SHOWN * params.length, far / _BESIDE), _MOST * params.length)


def among(frame: Frame, params: WoodParams, time: float, poses: Poses | None = None) -> Frame:
    """Return the mesh of a moment with its bodies, whose vertices have the field `body` 1 and the others 0.

    poses: of all bodies at the moment; only those with a mass are taken from there.
    """
    vertices, triangles, inside = [frame.vertices], [frame.triangles], [frame.fields["inside"]]
    count = len(frame.vertices)
    for r, body in enumerate(params.bodies):
        if body.mass is None or poses is None:
            points, faces = solid(body, time)
        else:
            points, faces = _drawn(body)
            points = points @ poses.frame[r].T + poses.centre[r]
        vertices.append(points)
        triangles.append((faces + count).astype(frame.triangles.dtype))
        inside.append(np.zeros(len(points)))
        count += len(points)
    is_body = np.zeros(count)
    is_body[len(frame.vertices) :] = 1.0
    fields = {**frame.fields, "inside": np.concatenate(inside), "body": is_body}
    return Frame(np.concatenate(vertices), np.concatenate(triangles), fields)
