"""The skin: a thin shell bound to the body's surface, which wrinkles where the body leaves it too wide.

The skin keeps its fresh metric, less what it shrinks itself. Springs of a stiffness per area, as of a layer of flesh so
deep, hold it to where the body carries it (a Winkler foundation; the body does not feel the skin). A flat skin of
modulus ratio s, thickness t and D = s t^3 / (12 (1 - nu^2)) on springs k buckles at a stress of 2 sqrt(k D) / t, with
the wavelength 2 pi (D/k)^(1/4). Energies in units of the skin's shear modulus times its thickness.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ...contract import NotConverged
from ...linalg.abreast import finished
from ...linalg.dissection import Fronts
from ...shell import (
    Material,
    angles,
    bending,
    bending_tangent,
    hinge_stiffness,
    membrane,
    membrane_tangent,
    metric,
    pattern,
    topology,
)
from ...shell.inverse import Inverse, fronts_of, inverse_of
from ...shell.normals import normals
from .flesh import Skin
from .obstacles import Obstacles
from .recall import Move, direction, moved

__all__ = ["Model", "Settled", "Shell"]


_STEPS, _HALVINGS, _MEMORY = 1500, 30, 20
#: Steps that one inverse serves.
_STALE = 20
#: Stiffness of floor and neighbours over that of the springs: folds of a twentieth of r1 enter them by less than 1e-3.
_FIRM = 100.0
_NOTHING = Obstacles(None, np.empty((0, 4)))
#: Random height that a flat skin starts from, over its thickness: without one it would stay flat.
_UNEVEN = 1e-2


class Model(NamedTuple):
    """What L-BFGS knows of the energy's curvature: an inverse, the last moves with the slope's changes.

    steps: it took to get there; after many the inverse is of another shape.
    """

    inverse: Inverse
    moves: tuple[Move, ...]
    steps: int = 0


class Settled(NamedTuple):
    """Points (v, 3) of a skin, residual, steps, and what the last of them knew of the curvature."""

    points: Floats
    residual: float
    steps: int
    model: Model


class Shell:
    """A skin on fresh points (v, 3) with faces (f, 3), of one thickness [r1]; area: of each vertex (v) [r1^2].

    firm: how firmly it is held, over the skin's constants, by vertex (v) or everywhere.
    """

    def __init__(
        self, points: Floats, faces: Ints, area: Floats, skin: Skin, thickness: float, firm: Floats | float = 1.0
    ) -> None:
        self._points, self._faces = points, faces
        self._material = Material(thickness)
        self._mesh = topology(faces, len(points))
        self._pattern = pattern(self._mesh)
        self._metric = metric(points, faces)
        self._angles = angles(points, self._mesh.hinges)
        # flesh of modulus 1 and this depth, over the skin's mu t = s t / (2 (1 + nu))
        unit = skin.stiffness * thickness / (2 * (1 + self._material.poisson))
        self._hold = area * firm / (skin.depth * unit)

    def wrinkled(
        self,
        carried: Floats,
        share: float | Floats,
        start: Floats,
        tolerance: float,
        model: Model | None = None,
        watch: Callable[[], None] = lambda: None,
        obstacles: Obstacles = _NOTHING,
        ahead: Floats | None = None,
    ) -> Settled:
        """Return the skin where the body carries it to `carried` (v, 3), out of obstacles.

        share: the skin's lengths over its fresh ones, of each face (f) or of all. start (v, 3): from where it settles;
        see `uneven`. model: of a skin that lay about there; None starts from the fresh one's.
        ahead (v, 3): another start, taken where less is out of balance there.

        Raises:
            NotConverged: there were too many steps.

        """
        g = self._metric * np.reshape(np.asarray(share, float) ** 2, (-1, 1))
        stiffness = hinge_stiffness(g, self._mesh, self._material.flexural)
        x = start.copy()
        slope, now = self._slope(x, carried, g, stiffness, obstacles)
        if ahead is not None:
            further, then = self._slope(ahead, carried, g, stiffness, obstacles)
            if np.linalg.norm(further) < np.linalg.norm(slope):
                x, slope, now = ahead.copy(), further, then
        residual = np.inf
        inverse, moves, before = model or Model(self._fresh, ())
        if before >= _STALE:
            inverse = self._inverse(x, g, stiffness, obstacles)
        for step in range(_STEPS):
            watch()
            pull = self._hold[:, None] * (x - carried)
            # a node's balance is between shell and springs; a skin that fits has neither
            scale = np.linalg.norm(pull) + np.linalg.norm(slope - pull) + 1e-6 * len(x) ** -0.5
            residual = float(np.linalg.norm(slope) / scale)
            if residual <= tolerance:
                return Settled(x, residual, step, Model(inverse, moves, step))
            if step and step % _STALE == 0:
                inverse = self._inverse(x, g, stiffness, obstacles)
            d = direction(slope, inverse.apply, moves)
            down, part = float(np.sum(slope * d)), 1.0
            for _ in range(_HALVINGS):
                found, then = self._slope(x + part * d, carried, g, stiffness, obstacles)
                if then <= now + 1e-4 * part * down + 1e-14:
                    break
                part /= 2
            else:
                break
            moves = (*moves[1 - _MEMORY :], moved(part * d, found - slope))
            x, slope, now = x + part * d, found, then
        raise NotConverged(
            f"the skin stopped at a residual of {residual:.1e}.",
            residual=residual,
            advice="Make the skin thicker or softer, or let it shrink with the body (skin.shrinkage).",
        )

    def uneven(self, normals: Floats, generator: np.random.Generator) -> Floats:
        """Return a small random height (v, 3) along normals (v, 3), without which a flat skin would stay flat."""
        return _UNEVEN * self._material.thickness * generator.standard_normal((len(normals), 1)) * normals

    @cached_property
    def _fresh(self) -> Inverse:
        """The inverse at the fresh shape: good enough to begin with, and the same for every frame."""
        return self._inverse(
            self._points, self._metric, hinge_stiffness(self._metric, self._mesh, self._material.flexural)
        )

    @cached_property
    def _fronts(self) -> Fronts:
        return fronts_of(self._mesh, self._points)

    def _inverse(self, x: Floats, g: Floats, stiffness: Floats, obstacles: Obstacles = _NOTHING) -> Inverse:
        """Return an approximate inverse of the tangent at x."""
        blocks = np.zeros((self._pattern.blocks, 3, 3))
        membrane_tangent(x, self._faces, g, self._material.lame, self._pattern.of_triangles, blocks)
        bending_tangent(x, self._mesh.hinges, stiffness, self._pattern.of_hinges, blocks)
        blocks[self._pattern.diagonal] += self._hold[:, None, None] * np.eye(3)
        for inside, _, way in obstacles.depths(x):
            firm = _FIRM * self._hold[inside, None, None]
            np.add.at(blocks, self._pattern.diagonal[inside], firm * way[:, :, None] * way[:, None, :])
        outward, still = normals(x, self._faces), np.zeros(len(x), np.bool_)
        return finished(inverse_of(self._fronts, self._pattern, blocks, outward, still))

    def _slope(
        self, x: Floats, carried: Floats, g: Floats, stiffness: Floats, obstacles: Obstacles
    ) -> tuple[Floats, float]:
        gradient = self._hold[:, None] * (x - carried)
        total = float(np.sum(gradient * (x - carried))) / 2
        total += membrane(x, self._faces, g, self._material.lame, gradient)
        total += bending(x, self._mesh.hinges, self._angles, stiffness, gradient)
        for inside, depth, way in obstacles.depths(x):
            push = _FIRM * self._hold[inside] * depth
            total += float(np.sum(push * depth)) / 2
            np.subtract.at(gradient, inside, push[:, None] * way)
        return gradient, total
