"""What stands in a scene besides its items, as meshes of their own: bowls, and what items were scattered over."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from solver.arrays import Array, Floats
from solver.resting import Bowl

from .ground import corner_normals
from .placing import bowl_of

if TYPE_CHECKING:
    from .glb import _File
    from .request import Scene

__all__ = ["Prop", "held", "lathe", "node"]

_AROUND, _ALONG = 64, 20
_GLAZE = {
    "name": "glaze",
    "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.77, 0.7, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.35},
}


class Prop(NamedTuple):
    """A mesh that stands in the scene: points, normals (v, 3) and triangles (f, 3), moved by `at`."""

    name: str
    points: Floats
    normal: Floats
    triangles: Array
    at: tuple[float, float, float]


def lathe(of: Bowl) -> tuple[Floats, Floats, Array]:
    """Return points, normals (v, 3) and triangles of a bowl's shell: inside, rim, outside; its foot on y = 0."""
    inner, outer = of.sphere, of.sphere + of.thickness
    middle = outer  # height of the spheres' centre
    angle = np.arccos(np.clip((middle - of.rim) / np.array([inner, outer]), -1, 1))
    a, b = np.linspace(0, angle[0], _ALONG), np.linspace(angle[1], 0, _ALONG)
    profile = np.concatenate(
        [
            np.stack([inner * np.sin(a), middle - inner * np.cos(a)], 1),
            np.stack([outer * np.sin(b), middle - outer * np.cos(b)], 1),
        ]
    )
    facing = np.concatenate([np.stack([-np.sin(a), np.cos(a)], 1), np.stack([np.sin(b), -np.cos(b)], 1)])
    # the rim's flat ring, with normals of its own
    rim = profile[[_ALONG - 1, _ALONG]]
    rows = np.concatenate([profile[:_ALONG], rim, profile[_ALONG:]])
    normal = np.concatenate([facing[:_ALONG], [[0, 1], [0, 1]], facing[_ALONG:]])
    turn = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    cos, sin = np.cos(turn), np.sin(turn)

    def around(pairs: Floats) -> Floats:
        r, y = pairs[:, :1], np.repeat(pairs[:, 1:], _AROUND, axis=1)
        return np.stack([r * cos, y, r * sin], axis=-1).reshape(-1, 3)

    grid = np.arange(len(rows) * _AROUND).reshape(len(rows), _AROUND)
    quads = []
    for k in range(len(rows) - 1):
        if k in (_ALONG - 1, _ALONG + 1):
            continue  # seams between inside, rim and outside
        p, q = grid[k], grid[k + 1]
        p1, q1 = np.roll(p, -1), np.roll(q, -1)
        quads += [np.stack([p, p1, q], 1), np.stack([p1, q1, q], 1)]
    triangles = np.concatenate(quads)
    points = around(rows)
    corners = points[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    # winding: each side's normals say which way is out
    facing3 = around(normal)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    wrong = np.einsum("ij,ij->i", across, facing3[triangles].sum(axis=1)) < 0
    triangles[wrong] = triangles[wrong][:, ::-1]
    return points, facing3, triangles[area > 1e-12]


def held(scene: Scene) -> list[Prop]:
    """Return what stands in a scene besides its items."""
    found = []
    for one in scene.places:
        if one.rule == "bowl":
            found.append(Prop("bowl", *lathe(bowl_of(one)), one.at))
        elif one.mesh is not None:
            points, faces = one.mesh.arrays
            found.append(Prop("ground", points, corner_normals(points, faces), faces, one.at))
    return found


def node(file: _File, meshes: list[dict[str, Any]], materials: list[dict[str, Any]], prop: Prop) -> dict[str, Any]:
    """Append a prop's mesh and material, and return its node."""
    points, normal = prop.points.astype("<f4"), prop.normal.astype("<f4")
    both = file.view(points, "ATTRIBUTES", 34962), file.view(normal, "ATTRIBUTES", 34962)
    limits = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    few = len(points) < 1 << 16
    flat = prop.triangles.ravel().astype("<u2" if few else "<u4")
    indices = file.accessor(file.view(flat, "TRIANGLES", 34963), 5123 if few else 5125, "SCALAR", len(flat))
    attributes = {
        "POSITION": file.accessor(both[0], 5126, "VEC3", len(points), **limits),
        "NORMAL": file.accessor(both[1], 5126, "VEC3", len(points)),
    }
    if _GLAZE not in materials:
        materials.append(_GLAZE)
    primitive = {"attributes": attributes, "indices": indices, "material": materials.index(_GLAZE)}
    meshes.append({"name": prop.name, "primitives": [primitive]})
    return {"name": prop.name, "mesh": len(meshes) - 1, "translation": list(prop.at)}
