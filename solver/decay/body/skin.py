"""The skin: a thin shell bound to the body's surface, which wrinkles where the body leaves it too wide.

The skin keeps its fresh metric, less what it shrinks itself. Springs of a stiffness per area, as of a layer of flesh so
deep, hold it to where the body carries it (a Winkler foundation; the body does not feel the skin). A flat skin of
modulus ratio s, thickness t and D = s t^3 / (12 (1 - nu^2)) on springs k buckles at a stress of 2 sqrt(k D) / t, with
the wavelength 2 pi (D/k)^(1/4). Energies in units of the skin's shear modulus times its thickness.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...contract import NotConverged
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
from .flesh import Skin
from .sparse import solve

__all__ = ["Shell"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_STEPS, _HALVINGS, _ITERATIONS, _MEMORY = 1500, 30, 200, 20
#: Steps that one tangent serves.
_STALE = 10
#: Tolerance of the linear solves.
_LOOSE = 0.3
#: Random height that a flat skin starts from, over its thickness: without one it would stay flat.
_UNEVEN = 1e-2


class Shell:
    """A skin on fresh points (v, 3) with faces (f, 3), of one thickness [r1]; area: of each vertex (v) [r1^2]."""

    def __init__(self, points: Array, faces: Index, area: Array, skin: Skin, thickness: float) -> None:
        self._faces = faces
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
        carried: Array,
        share: float,
        start: Array,
        tolerance: float,
        watch: Callable[[], None] = lambda: None,
    ) -> tuple[Array, float, int]:
        """Return points (v, 3) of the skin, residual and steps, where the body carries it to `carried` (v, 3).

        share: the skin's lengths over its fresh ones. start (v, 3): from where it settles; see `uneven`.

        Raises:
            NotConverged: there were too many steps.

        """
        g = self._metric * share**2
        stiffness = hinge_stiffness(g, self._mesh, self._material.flexural)
        x = start.copy()
        slope, now = self._slope(x, carried, g, stiffness)
        residual = np.inf
        moves: list[tuple[Array, Array]] = []
        blocks = np.empty(0)
        for step in range(_STEPS):
            watch()
            pull = self._hold[:, None] * (x - carried)
            # a node's balance is between shell and springs; a skin that fits has neither
            scale = np.linalg.norm(pull) + np.linalg.norm(slope - pull) + 1e-6 * len(x) ** -0.5
            residual = float(np.linalg.norm(slope) / scale)
            if residual <= tolerance:
                return x, residual, step
            if step % _STALE == 0:
                blocks = self._tangent(x, g, stiffness)
            d = self._direction(slope, blocks, moves)
            down, part = float(np.sum(slope * d)), 1.0
            for _ in range(_HALVINGS):
                found, then = self._slope(x + part * d, carried, g, stiffness)
                if then <= now + 1e-4 * part * down + 1e-14:
                    break
                part /= 2
            else:
                break
            moves = [*moves[1 - _MEMORY :], (part * d, found - slope)]
            x, slope, now = x + part * d, found, then
        raise NotConverged(
            f"the skin stopped at a residual of {residual:.1e}.",
            residual=residual,
            advice="Make the skin thicker or softer, or let it shrink with the body (skin.shrinkage).",
        )

    def uneven(self, normals: Array, generator: np.random.Generator) -> Array:
        """Return a small random height (v, 3) along normals (v, 3), without which a flat skin would stay flat."""
        return _UNEVEN * self._material.thickness * generator.standard_normal((len(normals), 1)) * normals

    def _tangent(self, x: Array, g: Array, stiffness: Array) -> Array:
        blocks = np.zeros((self._pattern.blocks, 3, 3))
        membrane_tangent(x, self._faces, g, self._material.lame, self._pattern.of_triangles, blocks)
        bending_tangent(x, self._mesh.hinges, stiffness, self._pattern.of_hinges, blocks)
        blocks[self._pattern.diagonal] += self._hold[:, None, None] * np.eye(3)
        return blocks

    def _direction(self, slope: Array, blocks: Array, moves: list[tuple[Array, Array]]) -> Array:
        """Return the direction (v, 3) of L-BFGS that starts from the tangent in place of a multiple of one.

        The tangent leaves compression out: alone it is too stiff for buckles, which past moves teach it.
        """
        order, q, parts = self._pattern, -slope, []
        kept = [(s, y, float(np.sum(s * y))) for s, y in moves]
        kept = [(s, y, sy) for s, y, sy in kept if sy > 0]
        for s, y, sy in reversed(kept):
            parts.append(float(np.sum(s * q)) / sy)
            q = q - parts[-1] * y
        d, _, _ = solve(order.indptr, order.indices, order.diagonal, blocks, q, _LOOSE, _ITERATIONS)
        for (s, y, sy), part in zip(kept, reversed(parts), strict=True):
            d = d + (part - float(np.sum(y * d)) / sy) * s
        return d if float(np.sum(slope * d)) < 0 else -slope

    def _slope(self, x: Array, carried: Array, g: Array, stiffness: Array) -> tuple[Array, float]:
        gradient = self._hold[:, None] * (x - carried)
        total = float(np.sum(gradient * (x - carried))) / 2
        total += membrane(x, self._faces, g, self._material.lame, gradient)
        total += bending(x, self._mesh.hinges, self._angles, stiffness, gradient)
        return gradient, total
