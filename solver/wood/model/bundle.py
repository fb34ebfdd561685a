"""Lay the bundle: rods along x with vertices at random places, what they are made of, what holds them, their bonds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...contract import Context
from ..fibres.paths import crowded, placed
from ..fibres.timber import LEAST, hews, timber
from ..params import Cut, WoodParams
from ..shape.taper import tapered, thickness
from .arrays import Rods, Turns
from .axis import along, laid, started
from .bodies.building import bodied
from .grain import Field, ringed
from .gripping import courses, pins_of
from .joining import bonded
from .motion import Motion
from .outline import area as outlined
from .outline import corners, covered, drawn_in, stand
from .sawing import boxes, divided, loosened, placed_on, sawn
from .state import Wood

__all__ = ["SAMPLES", "lay"]

#: Where on an edge, 0 to 1, its strength is known.
SAMPLES = np.linspace(0.0, 1.0, 9)
#: Share of an edge's stiffness that a contact has.
_CONTACT = 0.1
#: Rounds in which a vertex is moved to where a winding fibre passes a cut: each leaves an edge's turn of the way;
#: and over the bundle's length, what is no way at all.
_ROUNDS, _SAME = 8, 1e-12
#: Depth over which a contact gains its stiffness, over a rod's radius.
_EASE = 0.1


class _Layout(NamedTuple):
    """Where all vertices are: k rods of n, ghosts among them, numbered rod after rod."""

    area: np.ndarray  # (k,) [m2]
    fibre: np.ndarray  # (k, n, 3) by the names of fibres, which `fibres` explains [m]
    straight: np.ndarray  # (k, n, 3) of the straight bundle: `fibre`, but where grain deviates or the bundle tapers [m]
    rest: np.ndarray  # (k, n, 3) of the unloaded one [m]
    number: np.ndarray  # (k, n) int32
    grid: np.ndarray  # (k, vertices) int32 without ghosts
    ghosts: tuple[bool, bool]  # before the first vertex, behind the last
    section: np.ndarray  # (k, n - 1) [m2] of the edges, across them

    @property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """First and second vertices (e,) int32 of all edges."""
        # copies: of a single rod, ravel would give both the same memory, and a split would move both
        return self.number[:, :-1].flatten(), self.number[:, 1:].flatten()

    @property
    def real(self) -> np.ndarray:
        """Whether an edge (e,) is no ghost."""
        out = np.ones((len(self.area), self.number.shape[1] - 1), bool)
        if self.ghosts[0]:
            out[:, 0] = False
        if self.ghosts[1]:
            out[:, -1] = False
        return out.ravel()


def _strength(points: np.ndarray, field: Field, params: WoodParams) -> np.ndarray:
    """Return the strain that each place (...) of the straight bundle bears."""
    strength = params.strain_limit * field.strength(points, params.grain.strength)
    for notch in params.notches:
        inside = np.abs(points[..., 0] - notch.position) <= notch.width / 2
        # a ring cut in: the load a section bears goes with its area
        strength = np.where(inside, strength * (1 - notch.depth) ** 2, strength)
    return strength


def _layout(points: np.ndarray, area: np.ndarray, s: np.ndarray, params: WoodParams) -> _Layout:
    """Return where all vertices are; s (k, vertices): places along the rods [m]."""
    ghosts = (params.clamp != "none", params.clamp == "both")
    row = s
    if ghosts[0]:
        row = np.column_stack([-(row[:, 1] - row[:, 0]), row])
    if ghosts[1]:
        row = np.column_stack([row, 2 * row[:, -1] - row[:, -2]])
    rods, count = row.shape
    fibre = np.concatenate([row[:, :, None], np.repeat(points[:, None, :], count, 1)], -1)
    straight, section = fibre, np.repeat(area[:, None], count - 1, 1)
    if params.grain.deviates or params.taper != 1:
        even = _within(placed(fibre, params), area, params)
        straight = tapered(even, params)
        edge, middle = straight[:, 1:] - straight[:, :-1], (fibre[:, 1:] + fibre[:, :-1]) / 2
        # what is cut by a section stands oblique in it, and is squeezed where fibres crowd round a knot
        section *= (
            crowded(middle, params)
            * thickness(middle[..., 0], params) ** 2
            * edge[..., 0]
            / np.linalg.norm(edge, axis=-1)
        )
        section *= _filled(even, area, params)
    number = np.arange(rods * count, dtype=np.int32).reshape(rods, count)
    grid = number[:, int(ghosts[0]) : count - int(ghosts[1])]
    return _Layout(area, fibre, straight, laid(straight, points, params), number, grid, ghosts, section)


def _on_cuts(
    points: np.ndarray, area: np.ndarray, s: np.ndarray, cuts: tuple[Cut, ...], params: WoodParams
) -> tuple[np.ndarray, np.ndarray]:
    """Return places along (k, vertices) [m] with vertices where cuts pass, and these (p, 2): rod, vertex."""
    moved, parted = s, np.zeros((0, 2), np.int32)
    # a fibre that winds does not pass a cut where the chord of an edge does: its vertex is moved until it is on both
    for turn in range(_ROUNDS if cuts else 0):
        fibre = np.concatenate([moved[:, :, None], np.repeat(points[:, None, :], s.shape[1], 1)], -1)
        straight = tapered(_within(placed(fibre, params), area, params), params)
        better, parted = placed_on(cuts, s, straight, params.length)
        if turn and np.abs(better - moved).max() <= _SAME * params.length:
            break
        moved = better
    return moved, parted


def _sawn_at(s: np.ndarray, parted: np.ndarray, edges: int) -> np.ndarray:
    """Return where along (e, c) [m] the rod of each edge is parted (p, 2), nan for nowhere; s (k, vertices) [m]."""
    most = int(np.bincount(parted[:, 0]).max())
    found, count = np.full((len(s), most), np.nan), np.zeros(len(s), int)
    for rod, vertex in parted.tolist():
        found[rod, count[rod]] = s[rod, vertex]
        count[rod] += 1
    return np.repeat(found, edges, 0)


def _within(even: np.ndarray, area: np.ndarray, params: WoodParams) -> np.ndarray:
    """Return fibres (k, n, 3) [m] that run out of the wood where what is left of them is; area (k,) [m2]."""
    if not hews(params):
        return even
    cell = np.repeat(np.sqrt(area), even.shape[1])
    section = drawn_in(corners(params), even[..., 1:].reshape(-1, 2), cell).reshape(*even.shape[:2], 2)
    return np.concatenate([even[..., :1], section], -1)


def _filled(straight: np.ndarray, area: np.ndarray, params: WoodParams) -> float:
    """Return by what sections are to be multiplied so that what is left of rods fills what is hewn.

    straight (k, n, 3) [m], area (k,) [m2].
    """
    if not hews(params):
        return 1.0
    outline, ends = corners(params), np.clip(straight[..., 0], 0, params.length)
    middle = (straight[:, 1:, 1:] + straight[:, :-1, 1:]) / 2
    cell = np.repeat(np.sqrt(area), middle.shape[1])
    left = covered(outline, middle.reshape(-1, 2), cell).reshape(middle.shape[:2])
    left = np.where(left > LEAST, left, 0.0)
    filled = float((area[:, None] * np.diff(ends, axis=1) * left).sum())
    return outlined(outline) * params.length / filled if filled > 0 else 1.0


def _rods(at: _Layout, grain: Field, params: WoodParams) -> Rods:
    """Return edges and hinges."""
    rods, count = at.number.shape
    (a, b), real, flat = at.edges, at.real, at.rest.reshape(-1, 3)
    edge = np.arange(len(a), dtype=np.int32).reshape(rods, count - 1)
    length = np.linalg.norm(flat[b] - flat[a], axis=1)
    section = at.section.ravel()
    middle = (at.fibre[:, 1:] + at.fibre[:, :-1]) / 2
    stiff = (grain.factor(middle, params.grain.stiffness) * _rings(at, params)[:, None]).ravel()
    solid = np.where(real, length, 0.0)
    before, after = edge[:, :-1].ravel(), edge[:, 1:].ravel()
    return Rods(
        a,
        b,
        length,
        np.where(real, params.stiffness * section * stiff, 0.0),
        np.ones(len(a), np.uint8),
        before,
        after,
        solid[before] + solid[after],
        params.stiffness * _hinges(at) ** 2 / (4 * np.pi) * _stiff(at, grain, params),
        np.ones(len(before), np.uint8),
        np.sqrt(section / np.pi),
        np.ones(len(a)),
    )


def _hinges(at: _Layout) -> np.ndarray:
    """Return the area (h,) [m2] of the rod of each hinge."""
    found: np.ndarray = ((at.section[:, 1:] + at.section[:, :-1]) / 2).ravel()
    return found


def _stiff(at: _Layout, grain: Field, params: WoodParams) -> np.ndarray:
    """Return the grain's factor (h,) of the stiffness of hinges."""
    factor = grain.factor(at.fibre[:, 1:-1], params.grain.stiffness)
    found: np.ndarray = (factor * _rings(at, params)[:, None]).ravel()
    return found


def _rings(at: _Layout, params: WoodParams) -> np.ndarray:
    """Return the growth rings' factor (k,) of the stiffness of rods; the bundle keeps what it has in tension."""
    found = ringed(params.grain, at.fibre[:, 0, 1:], np.sqrt(at.area / np.pi))
    kept: np.ndarray = found * at.area.sum() / (found @ at.area)
    return kept


def _motion(at: _Layout, rods: Rods, params: WoodParams) -> Motion:
    """Return the state at time 0, with masses and loads."""
    k, count = at.number.shape
    a, b = rods.a, rods.b
    solid = np.where(rods.k > 0, rods.rest, 0.0)
    tributary = at.section.ravel() * solid * params.density / 2
    mass = np.zeros(k * count)
    np.add.at(mass, a, tributary)
    np.add.at(mass, b, tributary)
    held = np.zeros((k, count), np.uint8)
    if at.ghosts[0]:
        held[:, :2] = 1
    if at.ghosts[1]:
        held[:, -2:] = 1
    load = np.zeros((k, count, 3))
    load[:, -1] = at.area[:, None] / at.area.sum() * np.array(params.tip_load)
    loads = load.reshape(-1, 3)
    loads[:, 2] -= mass * params.gravity
    loads[held.ravel() == 1] = 0.0
    x = started(at.rest, params).reshape(-1, 3)
    speed = np.clip(at.straight[..., :1] / params.length, 0, 1) * np.array(params.pull)
    return Motion(
        x,
        speed.reshape(-1, 3).copy(),
        np.where(mass > 0, params.mass_scaling * mass, 1.0),
        held.ravel(),
        loads,
        *_frames(at, rods, x, params),
        np.zeros(len(a)),
        np.zeros(len(a)),
        np.zeros(len(rods.before)),
    )


def _frames(at: _Layout, rods: Rods, x: np.ndarray, params: WoodParams) -> tuple[np.ndarray, np.ndarray]:
    """Return the directors (e, 3) and the tangents (e, 3) that they belong to; x (v, 3): places at time 0 [m].

    Along a fibre that leaves the x-z plane they are carried from edge to edge without spin, so that at rest nothing is
    twisted.
    """
    if not (params.grain.deviates or params.spine or params.fork or params.taper != 1):
        way = x[rods.b] - x[rods.a]
        return np.tile([0.0, 1.0, 0.0], (len(rods.a), 1)), way / np.linalg.norm(way, axis=1)[:, None]
    way = at.rest[:, 1:] - at.rest[:, :-1]
    t = way / np.linalg.norm(way, axis=-1, keepdims=True)
    d = np.zeros(t.shape)
    # as near to y as it may be; along y, to z
    first = np.where(np.abs(t[:, 0, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]])
    own = first - (first * t[:, 0]).sum(1, keepdims=True) * t[:, 0]
    for n in range(t.shape[1]):
        if n:
            u, w = t[:, n - 1], t[:, n]
            axis = np.cross(u, w)
            less = (axis * own).sum(1, keepdims=True) / (1 + (u * w).sum(1, keepdims=True))
            own = (u * w).sum(1, keepdims=True) * own + np.cross(axis, own) + less * axis
        own = own - (own * t[:, n]).sum(1, keepdims=True) * t[:, n]
        own = own / np.linalg.norm(own, axis=1, keepdims=True)
        d[:, n] = own
    # `started` bends from here: the first step carries them there, as any motion does
    return d.reshape(-1, 3), t.reshape(-1, 3)


def _turns(at: _Layout, rods: Rods, d: np.ndarray, grain: Field, params: WoodParams) -> Turns:
    """Return what twist and curved rest shapes need besides; d (e, 3): directors at rest."""
    flat, solid = at.rest.reshape(-1, 3), np.where(rods.k > 0, rods.rest, 0.0)
    tangent = (flat[rods.b] - flat[rods.a]) / rods.rest[:, None]
    u, w = tangent[rods.before], tangent[rods.after]
    binormal = 2 * np.cross(u, w) / (1 + (u * w).sum(1))[:, None]
    first = d[rods.before] + d[rods.after]
    second = np.cross(u, d[rods.before]) + np.cross(w, d[rods.after])
    kappa = np.column_stack([(second * binormal).sum(1), -(first * binormal).sum(1)]) / 2
    section = at.section.ravel()
    return Turns(
        params.shear * _hinges(at) ** 2 / (2 * np.pi) * _stiff(at, grain, params),
        kappa,
        np.zeros(len(rods.before)),
        params.mass_scaling * params.density * solid * section**2 / (2 * np.pi),
    )


def _strengths(at: _Layout, strong: Field, params: WoodParams) -> np.ndarray:
    """Return the strain (e, samples) that each place of each edge bears; ghosts bear any."""
    along_ = SAMPLES[:, None] * (at.fibre[:, 1:] - at.fibre[:, :-1])[:, :, None]
    places = at.fibre[:, :-1, None] + along_
    found: np.ndarray = _strength(places, strong, params).reshape(len(at.real), -1)
    return np.where(at.real[:, None], found, np.inf)


def lay(params: WoodParams, vertices: int) -> Wood:
    """Return the bundle with `vertices` on every rod, as it stands at time 0.

    Raises:
        InvalidGeometry: two rods stand at the same place.

    """
    generator = Context.generator(params.seed)
    log = timber(params)
    points, area, _ = stand(log, generator)
    s = along(len(points), vertices, params, generator)
    cuts = boxes(params, vertices)
    s, parted = _on_cuts(points, area, s, cuts, params)
    grain = Field(params.grain.along, params.grain.across, generator)
    strong = Field(params.grain.along, params.grain.across, generator)
    at = _layout(points, area, s, params)
    rods = _rods(at, grain, params)
    real = rods.k > 0
    k = params.contact_stiffness or _CONTACT * float(np.median(rods.k[real] / rods.rest[real]))
    edge = np.arange(len(real), dtype=np.int32).reshape(len(points), -1)
    # where straight grain is laid, the middles' closest points are at the same places along
    inner = slice(int(at.ghosts[0]), at.number.shape[1] - int(at.ghosts[1]))
    course = at.straight[:, inner] if params.grain.deviates or params.taper != 1 else None
    bonds = bonded(params, log, points, s, course, edge[:, inner.start :], at.rest.reshape(-1, 3), rods, grain, strong)
    straight = at.straight.reshape(-1, 3)
    motion = _motion(at, rods, params)
    if len(parted):
        where = _sawn_at(s, parted, at.number.shape[1] - 1)
        bonds = divided(bonds, rods, straight, at.rest.reshape(-1, 3), where, params.length / (vertices - 1))
    sawn(cuts, straight, rods, bonds)
    if params.grain.deviates or params.taper != 1:
        loosened(cuts, at.straight, s[parted[:, 0], parted[:, 1]], parted[:, 0], rods, bonds, params.length)
    return Wood(
        motion,
        rods,
        bonds,
        _turns(at, rods, motion.d, grain, params),
        bodied(params, k, _EASE * float(np.median(rods.radius)), rods),
        pins_of(params, grips := courses(params, straight, motion.x, motion.held == 0)),
        params.turning,
        _strengths(at, strong, params),
        np.repeat(np.arange(len(points), dtype=np.int32), at.number.shape[1] - 1),
        at.grid,
        np.full(len(real), -1.0),
        at.number.ravel(),
        straight,
        at.grid[parted[:, 0], parted[:, 1]],
        grips,
        params.mass_scaling,
    )
