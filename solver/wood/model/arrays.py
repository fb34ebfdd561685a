"""The arrays that kernels work on: edges and hinges of all rods, bonds between them, bodies about them.

Vertices are rows of arrays of positions x (v, 3) [m]. An edge joins two vertices; a hinge is where two edges of one
rod meet. A clamped end has a ghost edge behind it: an edge without stiffness, whose held vertices only give the
clamp's direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

__all__ = [
    "BALL",
    "BOX",
    "CYLINDER",
    "MESH",
    "WEDGE",
    "Bodies",
    "Bonds",
    "Depths",
    "Flight",
    "Free",
    "Pins",
    "Poses",
    "Rods",
    "Rubbing",
    "Turns",
    "Ways",
]

#: Shapes of bodies, as numbers.
BOX, CYLINDER, BALL, WEDGE, MESH = range(5)


class Rods(NamedTuple):
    """Edges (e,) and hinges (h,) of all rods."""

    a: np.ndarray  # (e,) int32 first vertex
    b: np.ndarray  # (e,) int32 second vertex
    rest: np.ndarray  # (e,) rest length [m]
    k: np.ndarray  # (e,) axial stiffness E A [N]; 0 for ghosts
    alive: np.ndarray  # (e,) uint8
    before: np.ndarray  # (h,) int32 edge before the hinge
    after: np.ndarray  # (h,) int32 edge after it
    span: np.ndarray  # (h,) rest length that it stands for, twice [m]
    alpha: np.ndarray  # (h,) bending stiffness E I [N m2]
    whole: np.ndarray  # (h,) uint8
    radius: np.ndarray  # (e,) of the round rod of the same area [m]
    free: np.ndarray  # (e,) length at which it bears nothing over that at rest; below 1 where it was crushed


class Bonds(NamedTuple):
    """Bonds (b,) between points of the curves through two rods' vertices (`curves`): the middle of an edge as laid."""

    i: np.ndarray  # (b,) int32 edge of the one rod
    at: np.ndarray  # (b,) where on it, 1/2 as laid; not so on a stub that the edge carries, beyond 0 to 1
    j: np.ndarray  # (b,) int32 edge of the other
    share: np.ndarray  # (b,) where on it, 0 to 1; beyond on a stub
    rest: np.ndarray  # (b,) rest distance [m]
    k: np.ndarray  # (b,) transverse stiffness [N]: energy k s^2 rest / 2
    s: np.ndarray  # (b,) shear stiffness S of Eq. 3.12 [J]
    size: np.ndarray  # (b,) volume whose shear it bears as laid [m3]: S over the shear modulus
    cosine: np.ndarray  # (b,) slope along the bond's unit vector, by arc length, at rest
    opens: np.ndarray  # (b,) energy of pure opening at which it begins to give way [J]
    slides: np.ndarray  # (b,) energy of pure shear at which it does [J]
    torn: np.ndarray  # (b,) energy that takes it apart by opening alone: G_Ic times its crack area [J]
    shorn: np.ndarray  # (b,) by shear alone: G_IIc times it [J]
    area: np.ndarray  # (b,) of the crack that it stands for [m2]
    damage: np.ndarray  # (b,) 0 whole, 1 broken
    parted: np.ndarray  # (b,) of its crack, what is there: the share of its cost that was spent
    on: np.ndarray  # (b,) uint8: 1 whole, 2 broken, but still in the way of what it joined, 0 gone


class Turns(NamedTuple):
    """What twist and curved rest shapes need besides: frames of edges and rest values of hinges."""

    beta: np.ndarray  # (h,) torsional stiffness G J [N m2]
    kappa: np.ndarray  # (h, 2) curvature at rest in the material frame, integrated over the hinge
    tau: np.ndarray  # (h,) twist at rest [radian]
    inertia: np.ndarray  # (e,) about the edge's own axis [kg m2]


class Ways(NamedTuple):
    """Where bodies (r,) are to be at times (w,): straight and evenly from one to the next."""

    times: np.ndarray  # (r, w) [s], rising
    points: np.ndarray  # (r, w, 3) of the pivot [m]
    turns: np.ndarray  # (r, w, 4) attitude, a unit quaternion, its real part first
    spins: np.ndarray  # (r, w, 3) angular velocity from then on [radian/s]
    pivot: np.ndarray  # (r, 3) in the body's frame, from its centre [m]


class Free(NamedTuple):
    """What moves bodies (r,) that go no way of their own."""

    mass: np.ndarray  # (r,) [kg]; 0: it goes its way whatever the force
    middle: np.ndarray  # (r, 3) centre of mass in the body's frame, from its centre [m]
    inertia: np.ndarray  # (r, 3) about the centre of mass, about principal axes [kg m2]
    axes: np.ndarray  # (r, 4) unit quaternion of the principal axes in the body's frame
    guide: np.ndarray  # (r, 3) unit vector of the line that it slides along without turning; 0: none
    load: np.ndarray  # (r, 3) weight and steady force [N]


class Depths(NamedTuple):
    """Depths below the surfaces of meshes at the nodes of grids, one after the other; the last index runs fastest."""

    value: np.ndarray  # (n,) [m]; negative outside
    nodes: np.ndarray  # (r, 3) int64 of each body's grid, about its centre
    start: np.ndarray  # (r,) int64 where it begins
    step: np.ndarray  # (r,) [m]


class Flight(NamedTuple):
    """State of bodies (r,) that move freely; of others it says nothing."""

    place: np.ndarray  # (r, 3) of the centre of mass [m]
    v: np.ndarray  # (r, 3) [m/s]
    turn: np.ndarray  # (r, 4) attitude, a unit quaternion, its real part first
    momentum: np.ndarray  # (r, 3) angular, about the centre of mass [kg m2/s]


class Bodies(NamedTuple):
    """Rigid bodies (r,). A body's centre is the middle of the box about it in its own frame."""

    kind: np.ndarray  # (r,) int32: 0 box, 1 cylinder, 2 ball, 3 wedge, 4 mesh
    axis: np.ndarray  # (r,) int32: of a cylinder
    half: np.ndarray  # (r, 3) half sides of a box or wedge [m]; radius, half length, 0 of a cylinder; radius of a ball
    box: np.ndarray  # (r, 3) half sides of the box about it, in its own frame [m]
    edge: np.ndarray  # (r, 3) of a wedge: radius of its edge [m], sine and cosine of half its angle
    turned: np.ndarray  # (r,) uint8: whether its frame is ever another than the world's
    friction: np.ndarray  # (r,)
    k: np.ndarray  # (r,) contact stiffness per length of rod [N/m2]
    ease: np.ndarray  # (r,) depth over which it grows to this [m]
    first: np.ndarray  # (e + 1,) int32: where the numbers of each edge's points begin
    ways: Ways
    free: Free
    depths: Depths
    flight: Flight  # changes as they move


class Poses(NamedTuple):
    """Where bodies (r,) are at a moment, and how they move."""

    centre: np.ndarray  # (r, 3) [m]
    pivot: np.ndarray  # (r, 3) the place that the path tells of [m]
    speed: np.ndarray  # (r, 3) of the pivot [m/s]
    frame: np.ndarray  # (r, 3, 3) axes of the body by columns
    spin: np.ndarray  # (r, 3) [radian/s]
    box: np.ndarray  # (r, 3) half sides of the box about it along x, y, z [m]


class Pins(NamedTuple):
    """Components (m,) of vertices that grips move, whatever the force."""

    vertex: np.ndarray  # (m,) int32
    component: np.ndarray  # (m,) int32
    grip: np.ndarray  # (m,) int32
    pace: np.ndarray  # (m,) speed [m/s]
    taken: np.ndarray  # (m,) impulse that the grip took since it was last asked [N s]


class Rubbing(NamedTuple):
    """Pairs of edges of different rods that are listed as near, and what a contact of theirs is made of."""

    pair: np.ndarray  # (p, 2) int32 edges
    law: np.ndarray  # (4,) thickness [m], stiffness [N/m], friction [1], depth over which the stiffness grows [m]
