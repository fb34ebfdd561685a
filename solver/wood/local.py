"""Newton's method on a patch, by a dense factor: nonlinear elimination of what is out of balance in few places.

What breaks is out of balance where it broke, and the end of a splinter that swings takes many short steps of which the
rest of the bundle knows nothing. Both are solved first, with everything about them held; then the whole takes a step
(Cai and Keyes 2002).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.linalg import lapack

from .contact import Touching
from .elements import Elements
from .equations import Equations
from .newton import searched
from .patch import cut_out, disturbed, surrounded

__all__ = ["relaxed"]

#: Vertices that may be out of balance, elements that the patch goes beyond them, and vertices that it may have.
_CORE, _RINGS, _MOST = 40, (2, 1), 180
_ROUNDS = 12
#: What of the whole's residual may be elsewhere.
_ELSEWHERE = 0.1
#: Shares of Gauss and Newton's part, tried until the matrix is positive.
_BLENDS = (0.0, 0.3, 1.0)


@njit(cache=True, error_model="numpy")
def _dense(parts: Elements, at: np.ndarray, out: np.ndarray) -> None:
    """Add the elements to out (3n, 3n); at (v,): the place of a vertex, -1 where it is held."""
    for n in range(len(parts.h)):
        for k in range(3):
            row = at[parts.vertex[n, k]]
            if row < 0:
                continue
            for m in range(3):
                column = at[parts.vertex[n, m]]
                if column < 0:
                    continue
                for p in range(2):
                    for q in range(2):
                        w = parts.weight[n, p, k] * parts.weight[n, q, m]
                        if w == 0.0:
                            continue
                        for r in range(3):
                            for c in range(3):
                                out[3 * row + r, 3 * column + c] += w * parts.h[n, 3 * p + r, 3 * q + c]


def _matrix(equations: Equations, at: np.ndarray, count: int, positive: bool) -> np.ndarray:
    """Return the stiffness (3n, 3n) of what is free."""
    parts, contacts = equations.parts(positive)
    out = np.zeros((3 * count, 3 * count))
    _dense(parts, at, out)
    # rods that touch have no part in a patch
    for touching in contacts.parts:
        assert isinstance(touching, Touching)
        for a, b, h in zip(at[touching.a], at[touching.b], touching.h, strict=True):
            for row, column, block in ((a, a, h[0]), (a, b, h[1]), (b, a, h[1]), (b, b, h[2])):
                if row >= 0 and column >= 0:
                    out[3 * row : 3 * row + 3, 3 * column : 3 * column + 3] += block
    free = at >= 0
    out[np.diag_indices(3 * count)] += np.repeat(equations.inertia[free], 3)
    return out


def _step(equations: Equations, at: np.ndarray, count: int, right: np.ndarray) -> np.ndarray | None:
    """Return the solution (3n,), with as much of Gauss and Newton's part as makes the matrix positive."""
    exact, positive = _matrix(equations, at, count, False), None
    for blend in _BLENDS:
        if blend and positive is None:
            positive = _matrix(equations, at, count, True)
        matrix = exact if positive is None else (1 - blend) * exact + blend * positive
        _, found, failed = lapack.dposv(matrix, right, lower=1)
        if not failed:
            return np.asarray(found)
    return None


def _crossed(equations: Equations, inside: np.ndarray) -> bool:
    """Return whether listed rods may touch among the vertices `inside` (v,) bool."""
    rods, pair = equations.state.wood.rods, equations.state.scratch.rubbing.pair
    return bool(inside[rods.a[pair]].any() or inside[rods.b[pair]].any())


def relaxed(equations: Equations, x: np.ndarray, r: np.ndarray, wanted: float, little: float) -> np.ndarray | None:
    """Return x (v, 3) with the few vertices relaxed that have most of the residual r (v, 3); None if it is spread.

    wanted: the residual that is asked for [N]; a patch ends, too, where a step promises less than `little` [J].
    """
    core = disturbed(r, max(0.5 * wanted, _ELSEWHERE * float(np.linalg.norm(r))), _CORE)
    tried = () if core is None else (surrounded(equations.state.wood, core, rings, _MOST) for rings in _RINGS)
    inside = next((mask for mask in tried if mask is not None), None)
    if inside is None or _crossed(equations, inside):
        return None
    patch = cut_out(equations.state, inside)
    step = equations.step
    start = step._replace(xh=step.xh[patch.vertices], vh=step.vh[patch.vertices])
    small = Equations(patch.state, start, equations.params, None)
    count = len(patch.own)
    at = np.full(len(patch.vertices), -1)
    at[patch.own] = np.arange(count)
    here = x[patch.vertices]
    out = small.residual(here)
    for _ in range(_ROUNDS):
        if float(np.linalg.norm(out)) <= 0.5 * wanted:
            break
        found = _step(small, at, count, -out[patch.own].ravel())
        if found is None:
            break
        way = np.zeros_like(here)
        way[patch.own] = found.reshape(-1, 3)
        slope = float(np.vdot(out, way))
        if not slope < 0:
            break
        here, out = searched(small.residual, here, way, slope, small.limit(way))
        if -slope < little:
            break
    whole = x.copy()
    whole[patch.free] = here[patch.own]
    listing = equations.listing
    passes = listing is not None and listing.allowed(equations.state, whole - x, 1.0) < 1
    return None if passes else whole
