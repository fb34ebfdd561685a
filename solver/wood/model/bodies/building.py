"""Bodies as arrays: their shapes, ways, weights and contact's stiffness; and how they begin to fly."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ....contract import InvalidGeometry
from ....geometry.inside import inside
from ....geometry.nearest import nearest
from ...bodies import half_width
from ...params import Body, WoodParams
from ..arrays import BALL, BOX, CYLINDER, MESH, WEDGE, Bodies, Depths, Flight, Free, Rods, Ways
from .solids import pivot_of, solid_of, weight_of

__all__ = ["between", "bodied", "sampled", "sides"]

_KINDS = {"box": BOX, "cylinder": CYLINDER, "ball": BALL, "wedge": WEDGE, "mesh": MESH}
#: Points of contact on what is as long as the narrowest body is wide; the fewest and the most on an edge. Under a
#: cylinder pressed in by a sixth of its radius, 8 make the force uneven by 1 %, 4 by 5 %.
_POINTS, _FEWEST, _MOST = 8, 4, 256
#: A wedge's edge counts as no narrower than this share of a mean edge of the rods: points are no closer.
_NARROW = 0.125
#: Nodes of the grid of depths of a mesh, about; and by how much the grid may miss its volume.
_NODES, _MISSED = 250_000, 0.1
#: Sine between two turns below which they are about one axis.
_PARALLEL = 1e-9


def _turns(body: Body) -> bool:
    """Return whether a body's frame is ever another than the world's."""
    return any(any(w.turn) for w in body.path) or (body.mass is not None and body.guide is None)


def _wide(body: Body, mean: float) -> tuple[float, float]:
    """Return how wide a body is along x and along y [m]: what is round about its radius where it touches.

    One that turns counts as wide as it is narrow. mean [m]: length of the rods' edges.
    """
    if body.shape == "box":
        wide = body.size[0], body.size[1]
        return (min(body.size),) * 2 if _turns(body) else wide
    if body.shape == "cylinder":
        across, along = body.size[0] / 2, body.size[1]
        if _turns(body):
            return (min(across, along),) * 2
        return (along if body.axis == "x" else across), (along if body.axis == "y" else across)
    if body.shape == "wedge":
        return (max(2 * body.edge, _NARROW * mean),) * 2
    if body.shape == "ball":
        return (body.size[0] / 2,) * 2
    return (max(float(_half(body).min()), _NARROW * mean),) * 2


def _half(body: Body) -> np.ndarray:
    """Return the half sides (3,) [m] of the box about a body in its own frame."""
    if body.shape == "box":
        return np.array(body.size) / 2
    if body.shape == "cylinder":
        return np.where(np.arange(3) == "xyz".index(body.axis), body.size[1], body.size[0]) / 2
    if body.shape == "ball":
        return np.full(3, body.size[0] / 2)
    if body.shape == "wedge":
        half = body.size[0] / 2 or half_width(body.size[2], body.angle, body.edge)
        return np.array([half, body.size[1] / 2, body.size[2] / 2])
    return np.asarray(np.ptp(solid_of(body)[0], axis=0) / 2)


def sides(body: Body) -> np.ndarray:
    """Return the sides (3,) [m] of the box about a body in its own frame."""
    return 2 * _half(body)


def _reach(body: Body) -> np.ndarray:
    """Return the numbers (3,) that say how large a shape is."""
    if body.shape == "cylinder":
        return np.array([body.size[0] / 2, body.size[1] / 2, 0.0])
    return _half(body)


def between(one: ArrayLike, other: ArrayLike) -> np.ndarray:
    """Return the turn (3,) [radian] that leads from one rotation vector to another, about one axis.

    That of two about one axis is their difference, so that a body may go round; between others the shortest.
    """
    first, second = np.asarray(one, float), np.asarray(other, float)
    bend = np.linalg.norm(np.cross(first, second))
    if bend <= _PARALLEL * np.linalg.norm(first) * np.linalg.norm(second):
        return np.asarray(second - first)
    return np.asarray((Rotation.from_rotvec(second) * Rotation.from_rotvec(first).inv()).as_rotvec())


def _ways(found: tuple[Body, ...]) -> Ways:
    """Return the bodies' ways."""
    width = max((len(b.path) for b in found), default=1)
    times, points = np.full((len(found), width), np.inf), np.zeros((len(found), width, 3))
    turns, spins = np.zeros((len(found), width, 4)), np.zeros((len(found), width, 3))
    for r, body in enumerate(found):
        count = len(body.path)
        # what comes after is never reached: the body rests at its last place
        times[r, :count] = [w.time for w in body.path]
        points[r, :count] = [w.position for w in body.path]
        points[r, count:] = points[r, count - 1]
        vectors = np.array([w.turn for w in body.path])
        turns[r, :count] = Rotation.from_rotvec(vectors).as_quat(scalar_first=True)
        turns[r, count:] = turns[r, count - 1]
        for n in range(count - 1):
            spins[r, n] = between(vectors[n], vectors[n + 1]) / (times[r, n + 1] - times[r, n])
    return Ways(times, points, turns, spins, np.array([pivot_of(b) for b in found]).reshape(-1, 3))


def _free(params: WoodParams) -> Free:
    """Return what moves the bodies that have a mass."""
    found = params.bodies
    middle, inertia, guide, load = (np.zeros((len(found), 3)) for _ in range(4))
    mass, axes = np.zeros(len(found)), np.tile([1.0, 0.0, 0.0, 0.0], (len(found), 1))
    for r, body in enumerate(found):
        if body.mass is None:
            continue
        weight = weight_of(body)
        mass[r], middle[r] = body.mass, weight.middle
        square, ways = np.linalg.eigh(body.mass / weight.volume * weight.inertia)
        ways[:, 2] *= np.sign(np.linalg.det(ways))
        inertia[r], axes[r] = square, Rotation.from_matrix(ways).as_quat(scalar_first=True)
        if body.guide is not None:
            guide[r] = np.array(body.guide) / np.linalg.norm(body.guide)
        load[r] = np.array(body.force) - [0.0, 0.0, body.mass * params.gravity]
    return Free(mass, middle, inertia, axes, guide, load)


def _launched(found: tuple[Body, ...], ways: Ways, free: Free) -> Flight:
    """Return how the bodies that move freely begin."""
    turn = ways.turns[:, 0].copy()
    velocity = np.array([b.velocity for b in found]).reshape(-1, 3)
    if not found:
        return Flight(velocity, velocity.copy(), turn, velocity.copy())
    own = Rotation.from_quat(turn, scalar_first=True)
    axes = own * Rotation.from_quat(free.axes, scalar_first=True)
    momentum = axes.apply(free.inertia * axes.inv().apply([b.spin for b in found]))
    return Flight(ways.points[:, 0] + own.apply(free.middle - ways.pivot), velocity, turn, momentum)


def sampled(body: Body) -> tuple[np.ndarray, float]:
    """Return depths (i, j, k) [m] at the nodes of a grid about a mesh's centre, and the grid's step [m].

    Raises:
        InvalidGeometry: the mesh is too thin for the grid.

    """
    points, faces = solid_of(body)
    half = _half(body)
    step = float((8 * half.prod() / _NODES) ** (1 / 3))
    # a cell more on every side, so that the surface lies within
    shape = tuple(int(n) for n in np.ceil(2 * half / step).astype(int) + 3)
    within = inside(-0.5 * step * (np.array(shape) - 1), step, shape, points, faces)  # type: ignore[arg-type]
    volume = weight_of(body).volume
    if not abs(within.sum() * step**3 - volume) <= _MISSED * volume:
        raise InvalidGeometry(
            f"a body's mesh is too thin for the grid of {1e3 * step:.3g} mm that it is sampled on, or crosses itself.",
            advice="Give a thicker mesh without crossings, a smaller one, or a wedge as a blade.",
        )
    near = within.copy()
    for axis in range(3):
        for way in (-1, 1):
            near |= np.roll(near, way, axis)
    node = np.argwhere(near)
    away = nearest(step * (node - 0.5 * (np.array(shape) - 1)), points, faces).distance
    depth = np.full(shape, -step)
    depth[near] = np.where(within[near], away, -away)
    return depth, step


def _depths(found: tuple[Body, ...]) -> Depths:
    """Return the depths of all meshes."""
    nodes, start, step = np.zeros((len(found), 3), np.int64), np.zeros(len(found), np.int64), np.ones(len(found))
    values, count = [np.zeros(0)], 0
    for r, body in enumerate(found):
        if body.shape == "mesh":
            depth, step[r] = sampled(body)
            nodes[r], start[r], count = depth.shape, count, count + depth.size
            values.append(depth.ravel())
    return Depths(np.concatenate(values), nodes, start, step)


def bodied(params: WoodParams, k: float, ease: float, rods: Rods) -> Bodies:
    """Return the bodies with a contact stiffness that is gained over the depth `ease` [m].

    k [N/m]: of the mean edge of the rods, or of as much of a rod as a narrower body covers.

    Raises:
        InvalidGeometry: a mesh is too thin.

    """
    found, mean = params.bodies, float(rods.rest.mean())
    widths = [_wide(b, mean) for b in found]
    least = min((min(wide) for wide in widths), default=np.inf)
    number = np.clip(np.ceil(_POINTS * rods.rest / least), _FEWEST, _MOST)
    ways, free = _ways(found), _free(params)
    return Bodies(
        np.array([_KINDS[b.shape] for b in found], np.int32),
        np.array(["xyz".index(b.axis) for b in found], np.int32),
        np.array([_reach(b) for b in found]).reshape(-1, 3),
        np.array([_half(b) for b in found]).reshape(-1, 3),
        np.array([(b.edge, np.sin(b.angle / 2), np.cos(b.angle / 2)) for b in found]).reshape(-1, 3),
        np.array([_turns(b) for b in found], np.uint8),
        np.array([b.friction for b in found], float),
        k / np.array([min(mean, wide[0]) for wide in widths]),
        np.full(len(found), ease),
        np.concatenate([[0], np.cumsum(number)]).astype(np.int32),
        ways,
        free,
        _depths(found),
        _launched(found, ways, free),
    )
