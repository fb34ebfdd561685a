"""Lay the bundle: rods along x with vertices at random places, what they are made of, what holds them, their bonds."""

from __future__ import annotations

import numpy as np

from ...contract import Context, InvalidGeometry
from ..params import WoodParams
from ..stepping.explicit import Motion
from .arrays import Rods, Turns
from .grain import Field
from .joining import bodied, bonded
from .section import areas, balanced, place
from .state import Wood

__all__ = ["SAMPLES", "lay"]

#: Where on an edge, 0 to 1, its strength is known.
SAMPLES = np.linspace(0.0, 1.0, 9)
#: Share of an edge's stiffness that a contact has.
_CONTACT = 0.1
#: Depth over which a contact gains its stiffness, over a rod's radius.
_EASE = 0.1


def _along(rods: int, vertices: int, params: WoodParams, generator: np.random.Generator) -> np.ndarray:
    """Return the vertices' places (rods, vertices) [m] along the rods, edges within their least and greatest length."""
    u = params.unevenness
    if u == 0 or vertices == 3:
        return np.tile(np.linspace(0, params.length, vertices), (rods, 1))
    # edges of mean 1 whose scaling to the full length keeps them within 1 - u and 1 + u
    edges = 1 + u * generator.uniform(-1, 1, (rods, vertices - 1))
    edges = 1 + (edges - edges.mean(1, keepdims=True)) * (1 - 1 / (vertices - 1))
    edges = np.clip(edges, 1 - u, 1 + u)
    edges /= edges.sum(1, keepdims=True)
    places = np.zeros((rods, vertices))
    places[:, 1:] = np.cumsum(edges, 1) * params.length
    places[:, -1] = params.length
    return places


def _curved(straight: np.ndarray, curvature: float) -> np.ndarray:
    """Return points (..., 3) of the straight bundle bent to an arc in the x-z plane, towards +z."""
    if curvature == 0:
        return straight.copy()
    s, y, z = np.moveaxis(straight, -1, 0)
    r = 1 / curvature
    return np.stack([(r - z) * np.sin(s / r), y, r - (r - z) * np.cos(s / r)], -1)


def _started(rest: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return the points (..., 3) at time 0: the rest shape, deflected by `bend`."""
    x = rest.copy()
    if params.bend:
        xi = rest[..., 0] / params.length
        inside = np.clip(xi, 0, 1)
        shape, slope = {
            "none": (np.sin(np.pi * xi) - 2 / np.pi, np.pi * np.cos(np.pi * xi)),
            "start": (inside**2 * (3 - inside) / 2, inside * (6 - 3 * inside) / 2),
            "both": ((1 - np.cos(2 * np.pi * inside)) / 2, np.pi * np.sin(2 * np.pi * inside)),
        }[params.clamp]
        x[..., 2] += params.bend * params.length * shape
        # sections stay plane and square to the axis; without it the bonds would start sheared
        x[..., 0] -= params.bend * rest[..., 2] * slope
    return x


def _strength(points: np.ndarray, field: Field, params: WoodParams) -> np.ndarray:
    """Return the strain that each place (...) of the straight bundle bears."""
    strength = params.strain_limit * field.factor(points, params.grain.strength)
    for notch in params.notches:
        inside = np.abs(points[..., 0] - notch.position) <= notch.width / 2
        # a ring cut in: the load a section bears goes with its area
        strength = np.where(inside, strength * (1 - notch.depth) ** 2, strength)
    return strength


def lay(params: WoodParams, vertices: int) -> Wood:
    """Return the bundle with `vertices` on every rod, as it stands at time 0.

    Raises:
        InvalidGeometry: two rods stand at the same place.

    """
    generator = Context.generator(params.seed)
    points, least = place(params.rods, params.radius, generator)
    if not least > 0:
        raise InvalidGeometry("two rods stand at the same place.", advice="Take fewer rods or a wider bundle.")
    area = areas(points, params.radius)
    points = balanced(points, area, params.radius)
    rods = len(points)
    s = _along(rods, vertices, params, generator)
    grain = Field(params.grain.along, params.grain.across, generator)
    strong = Field(params.grain.along, params.grain.across, generator)
    ghosts = (params.clamp != "none", params.clamp == "both")
    row = s
    if ghosts[0]:
        row = np.column_stack([-(row[:, 1] - row[:, 0]), row])
    if ghosts[1]:
        row = np.column_stack([row, 2 * row[:, -1] - row[:, -2]])
    count = row.shape[1]
    straight = np.concatenate([row[:, :, None], np.repeat(points[:, None, :], count, 1)], -1)
    rest = _curved(straight, params.curvature)
    number = np.arange(rods * count, dtype=np.int32).reshape(rods, count)
    grid = number[:, int(ghosts[0]) : count - int(ghosts[1])]
    # copies: of a single rod, ravel would give both the same memory, and a split would move both
    a, b = number[:, :-1].flatten(), number[:, 1:].flatten()
    edge = np.arange(len(a), dtype=np.int32).reshape(rods, count - 1)
    real = np.ones((rods, count - 1), bool)
    if ghosts[0]:
        real[:, 0] = False
    if ghosts[1]:
        real[:, -1] = False
    flat = rest.reshape(-1, 3)
    vector = flat[b] - flat[a]
    length = np.linalg.norm(vector, axis=1)
    section = np.repeat(area, count - 1)
    middle = (straight[:, 1:] + straight[:, :-1]) / 2
    stiff = grain.factor(middle, params.grain.stiffness).ravel()
    solid = np.where(real.ravel(), length, 0.0)
    before, after = edge[:, :-1].ravel(), edge[:, 1:].ravel()
    hinge_area = np.repeat(area, count - 2)
    hinge_stiff = grain.factor(straight[:, 1:-1], params.grain.stiffness).ravel()
    rods_ = Rods(
        a,
        b,
        length,
        np.where(real.ravel(), params.stiffness * section * stiff, 0.0),
        np.ones(len(a), np.uint8),
        before,
        after,
        solid[before] + solid[after],
        params.stiffness * hinge_area**2 / (4 * np.pi) * hinge_stiff,
        np.ones(len(before), np.uint8),
        np.sqrt(section / np.pi),
    )
    tributary = section * solid * params.density / 2
    mass = np.zeros(len(flat))
    np.add.at(mass, a, tributary)
    np.add.at(mass, b, tributary)
    held = np.zeros((rods, count), np.uint8)
    if ghosts[0]:
        held[:, :2] = 1
    if ghosts[1]:
        held[:, -2:] = 1
    load = np.zeros((rods, count, 3))
    load[:, -1] = area[:, None] / area.sum() * np.array(params.tip_load)
    loads = load.reshape(-1, 3)
    loads[:, 2] -= mass * params.gravity
    loads[held.ravel() == 1] = 0.0
    x = _started(rest, params).reshape(-1, 3)
    speed = np.clip(straight[..., :1] / params.length, 0, 1) * np.array(params.pull)
    tangent = vector / length[:, None]
    director = np.tile([0.0, 1.0, 0.0], (len(a), 1))
    motion = Motion(
        x,
        speed.reshape(-1, 3).copy(),
        np.where(mass > 0, params.mass_scaling * mass, 1.0),
        held.ravel(),
        loads,
        director,
        (x[b] - x[a]) / np.linalg.norm(x[b] - x[a], axis=1)[:, None],
        np.zeros(len(a)),
        np.zeros(len(a)),
        np.zeros(len(before)),
    )
    u, w = tangent[before], tangent[after]
    binormal = 2 * np.cross(u, w) / (1 + (u * w).sum(1))[:, None]
    kappa = np.column_stack([(np.cross(u + w, [0.0, 1.0, 0.0]) * binormal).sum(1) / 2, -binormal[:, 1]])
    turns = Turns(
        params.shear * hinge_area**2 / (2 * np.pi) * hinge_stiff,
        kappa,
        np.zeros(len(before)),
        params.mass_scaling * params.density * solid * section**2 / (2 * np.pi),
    )
    places = straight[:, :-1, None] + SAMPLES[:, None] * (straight[:, 1:] - straight[:, :-1])[:, :, None]
    strength = np.where(real.ravel()[:, None], _strength(places, strong, params).reshape(len(a), -1), np.inf)
    k = params.contact_stiffness or _CONTACT * float(np.median(rods_.k[rods_.k > 0] / length[rods_.k > 0]))
    bonds = bonded(params, points, s, grid, edge[:, int(ghosts[0]) :], flat, grain, strong)
    rod = np.repeat(np.arange(rods, dtype=np.int32), count - 1)
    turning = params.twist or params.curvature != 0
    return Wood(
        motion,
        rods_,
        bonds,
        turns,
        bodied(params, k, _EASE * float(np.median(rods_.radius)), length),
        turning,
        strength,
        rod,
        grid,
        np.full(len(a), -1.0),
        number.ravel(),
        params.mass_scaling,
    )
