"""The skin: a thin shell bound to the body's surface, which wrinkles where the body leaves it too wide.

The skin keeps its fresh metric, less what it shrinks itself. Springs of a stiffness per area, as of a layer of flesh so
deep, hold it to where the body carries it (a Winkler foundation; the body does not feel the skin). A flat skin of
modulus ratio s, thickness t and D = s t^3 / (12 (1 - nu^2)) on springs k buckles at a stress of 2 sqrt(k D) / t, with
the wavelength 2 pi (D/k)^(1/4). Energies in units of the skin's shear modulus times its thickness.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np

from ...arrays import Floats, Ints
from ...contract import NotConverged
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

__all__ = ["Model", "Settled", "Shell"]


_STEPS, _HALVINGS, _MEMORY = 1500, 30, 20
#: Steps that one inverse serves.
_STALE = 20
#: Random height that a flat skin starts from, over its thickness: without one it would stay flat.
_UNEVEN = 1e-2


class Model(NamedTuple):
    """What L-BFGS knows of the energy's curvature: an inverse, and the last moves with the slope's changes (v, 3)."""

    inverse: Inverse
    moves: tuple[tuple[Floats, Floats], ...]


class Settled(NamedTuple):
    """Points (v, 3) of a skin, residual, steps, and what the last of them knew of the curvature."""

    points: Floats
    residual: float
    steps: int
    model: Model


class Shell:
    """A skin on fresh points (v, 3) with faces (f, 3), of one thickness [r1]; area: of each vertex (v) [r1^2]."""

    def __init__(self, points: Floats, faces: Ints, area: Floats, skin: Skin, thickness: float) -> None:
        self._points, self._faces = points, faces
        self._material = Material(thickness)
        self._mesh = topology(faces, len(points))
        self._pattern = pattern(self._mesh)
        self._metric = metric(points, faces)
        self._angles = angles(points, self._mesh.hinges)
        # flesh of modulus 1 and this depth, over the skin's mu t = s t / (2 (1 + nu))
        unit = skin.stiffness * thickness / (2 * (1 + self._material.poisson))
        self._hold = area / (skin.depth * unit)

    def wrinkled(
        self,
        carried: Floats,
        share: float,
        start: Floats,
        tolerance: float,
        model: Model | None = None,
        watch: Callable[[], None] = lambda: None,
    ) -> Settled:
        """Return the skin where the body carries it to `carried` (v, 3).

        share: the skin's lengths over its fresh ones. start (v, 3): from where it settles; see `uneven`. model: of
        a skin that lay about there; None starts from the fresh one's.

        Raises:
            NotConverged: there were too many steps.

        """
        g = self._metric * share**2
        stiffness = hinge_stiffness(g, self._mesh, self._material.flexural)
        x = start.copy()
        slope, now = self._slope(x, carried, g, stiffness)
        residual = np.inf
        inverse, moves = model or Model(self._fresh, ())
        for step in range(_STEPS):
            watch()
            pull = self._hold[:, None] * (x - carried)
            # a node's balance is between shell and springs; a skin that fits has neither
            scale = np.linalg.norm(pull) + np.linalg.norm(slope - pull) + 1e-6 * len(x) ** -0.5
            residual = float(np.linalg.norm(slope) / scale)
            if residual <= tolerance:
                return Settled(x, residual, step, Model(inverse, moves))
            if step and step % _STALE == 0:
                inverse = self._inverse(x, g, stiffness)
            d = _direction(slope, inverse, moves)
            down, part = float(np.sum(slope * d)), 1.0
            for _ in range(_HALVINGS):
                found, then = self._slope(x + part * d, carried, g, stiffness)
                if then <= now + 1e-4 * part * down + 1e-14:
                    break
                part /= 2
            else:
                break
            moves = (*moves[1 - _MEMORY :], (part * d, found - slope))
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

    def _inverse(self, x: Floats, g: Floats, stiffness: Floats) -> Inverse:
        """Return an approximate inverse of the tangent at x."""
        blocks = np.zeros((self._pattern.blocks, 3, 3))
        membrane_tangent(x, self._faces, g, self._material.lame, self._pattern.of_triangles, blocks)
        bending_tangent(x, self._mesh.hinges, stiffness, self._pattern.of_hinges, blocks)
        blocks[self._pattern.diagonal] += self._hold[:, None, None] * np.eye(3)
        pieces = inverse_of(self._fronts, self._pattern, blocks, normals(x, self._faces), np.zeros(len(x), np.bool_))
        while True:
            try:
                next(pieces)
            except StopIteration as end:
                return cast(Inverse, end.value)

    def _slope(self, x: Floats, carried: Floats, g: Floats, stiffness: Floats) -> tuple[Floats, float]:
        gradient = self._hold[:, None] * (x - carried)
        total = float(np.sum(gradient * (x - carried))) / 2
        total += membrane(x, self._faces, g, self._material.lame, gradient)
        total += bending(x, self._mesh.hinges, self._angles, stiffness, gradient)
        return gradient, total


def _direction(slope: Floats, inverse: Inverse, moves: tuple[tuple[Floats, Floats], ...]) -> Floats:
    """Return the direction (v, 3) of L-BFGS that starts from an inverse in place of a multiple of one.

    The tangent leaves compression out: alone it is too stiff for buckles, which past moves teach it.
    """
    q, parts = -slope, []
    kept = [(s, y, _dot(s, y)) for s, y in moves]
    kept = [(s, y, sy) for s, y, sy in kept if sy > 0]
    for s, y, sy in reversed(kept):
        parts.append(_dot(s, q) / sy)
        q = q - parts[-1] * y
    d = inverse.apply(q)
    for (s, y, sy), part in zip(kept, reversed(parts), strict=True):
        d = d + (part - _dot(y, d) / sy) * s
    return d if _dot(slope, d) < 0 else -slope


def _dot(a: Floats, b: Floats) -> float:
    # no BLAS, whose sums depend on its threads
    return float(np.einsum("vi,vi->", a, b))
