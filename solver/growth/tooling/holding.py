"""Where a sheet is held, anywhere on its start shape: how much of what bends about an edge lies outside of it.

A vertex is held or it is not, so a hold would end at a row of vertices and not at the line that was asked for, and the
sheet about the line would be too soft by up to an edge and a half. What lies in the held place does not bend. The angle
of a hinge is the sheet's curvature, weighted by a tent across the edge, from one opposite corner to the other, and by
one along it: both are what an even weight on its two triangles leaves. So the angle is s times what the free part alone
would make it, s the share of their area outside; and the hinge is made 1 / s times as stiff, so that its energy is that
of the free part. All tents together are even: no energy is lost, none counted twice. The same goes for the triangles
about a vertex, where vertices bend.

Held directions hold the bending as far as the normal of the start shape lies in them: its square along each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from ... import shell
from ...arrays import Bools, Floats, Ints
from ..shapes import Ground
from .places import anywhere, share

if TYPE_CHECKING:
    from ..params import Attachment
    from ..state import State

__all__ = ["Holds", "free_shares", "held", "known", "loosened"]

#: Share below which a hinge gets no stiffer: what is held whole has next to nothing to bend, and 0 would be no sheet.
_LEAST = 0.02
#: Triangles that are looked at in one go.
_AT_ONCE = 1000


def _points(rows: int) -> Floats:
    """Return barycentric points (6 rows^2, 3): middles of the even parts of the six that the medians make.

    A line shares them out within .05 of the area, wherever it lies.
    """
    sixth = np.array([[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [1 / 3, 1 / 3, 1 / 3]])
    up = [(i + 1 / 3, j + 1 / 3) for i in range(rows) for j in range(rows - i)]
    down = [(i + 2 / 3, j + 2 / 3) for i in range(rows - 1) for j in range(rows - 1 - i)]
    u, v = np.array(up + down).T / rows
    inner = np.stack([1 - u - v, u, v], -1) @ sixth
    return np.concatenate([inner[:, list(order)] for order in permutations(range(3))])


_POINTS = _points(3)


@dataclass(frozen=True, eq=False)
class Holds:
    """What holds a sheet, on the ground that was its start shape."""

    attached: tuple[Attachment, ...]
    ground: Ground
    seed: int

    def at(self, points: Floats, shares: Floats | None) -> Bools:
        """Return which directions are held at points (m, 3) of the start shape: (m, 3).

        shares: (m, k) of each attachment, where one of them is not told anywhere.
        """
        found = np.zeros(points.shape, bool)
        for k, one in enumerate(self.attached):
            if shares is not None and not anywhere(one.where):
                here = shares[:, k]
            else:
                here = share(one.where, self.ground, self.seed, points)
            found |= np.outer(here >= 0.5, [axis in one.axes for axis in "xyz"])
        return found


def held(holds: Holds) -> tuple[Bools, Floats]:
    """Return which directions of vertices are held (n, 3), and how fast they are led (n, 3).

    Raises:
        InvalidInput: a place that the shape does not have.

    """
    n = len(holds.ground.mesh.x)
    found, led = np.zeros((n, 3), bool), np.zeros((n, 3))
    for one in holds.attached:
        inside = share(one.where, holds.ground, holds.seed) >= 0.5
        found[np.ix_(np.flatnonzero(inside), np.array(["xyz".index(axis) for axis in one.axes]))] = True
        # of several the last one that leads anywhere
        if any(one.velocity):
            led[inside] = one.velocity
    return found, led


def known(holds: Holds) -> dict[str, Floats]:
    """Return what rides on the material so that places are found again, for `State.matter`.

    home: (n, 3) places on the start shape. holding: (n, k) shares of attachments that are known at vertices alone.
    """
    found = {"home": holds.ground.mesh.x.copy()}
    if not all(anywhere(one.where) for one in holds.attached):
        found["holding"] = np.stack([share(one.where, holds.ground, holds.seed) for one in holds.attached], -1)
    return found


def loosened(state: State) -> State:
    """Return the state with `loose` of its present triangles; itself where nothing holds it."""
    holds = state.holds
    if holds is None:
        return state
    triangles, home, shares = state.mesh.triangles, state.matter["home"], state.matter.get("holding")
    loose = np.ones(len(triangles))
    faces = _across(state, holds)
    for begin in range(0, len(faces), _AT_ONCE):
        some = faces[begin : begin + _AT_ONCE]
        corners = home[triangles[some]]
        points = (_POINTS @ corners).reshape(-1, 3)
        told = None if shares is None else (_POINTS @ shares[triangles[some]]).reshape(len(points), -1)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        inside = holds.at(points, told).reshape(len(some), -1, 3)
        loose[some] = 1 - (inside.mean(axis=1) * normals**2).sum(axis=1)
    return replace(state, loose=loose)


def _across(state: State, holds: Holds) -> Ints:
    """Return the triangles about hinges that reach into a held place and can bend: all others are bent by nothing."""
    mesh = state.mesh
    inside = holds.at(state.matter["home"], state.matter.get("holding"))
    some, whole = np.asarray((state.held | inside).any(axis=1)), np.asarray(state.held.all(axis=1))
    bent = some[mesh.hinges].any(axis=1) & ~whole[mesh.hinges].all(axis=1)
    near = np.zeros(mesh.vertices, bool)
    near[mesh.hinges[bent]] = True
    return np.flatnonzero(near[mesh.triangles].any(axis=1))


def free_shares(state: State) -> tuple[Floats, Floats]:
    """Return the shares of the rest areas about hinges (h,) and vertices (n,) that lie outside of what is held.

    A fiftieth at least.
    """
    assert state.loose is not None
    mesh, sizes = state.mesh, shell.areas(state.g)
    sides = sizes[mesh.hinge_faces]
    hinges = (sides * state.loose[mesh.hinge_faces]).sum(axis=1) / sides.sum(axis=1)
    corners, n = mesh.triangles.ravel(), len(state.x)
    free, whole = (np.bincount(corners, np.repeat(areas, 3), n) for areas in (sizes * state.loose, sizes))
    vertices = np.where(whole > 0, free / np.maximum(whole, 1e-300), 1.0)
    return np.maximum(hinges, _LEAST), np.maximum(vertices, _LEAST)
