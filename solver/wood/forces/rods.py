"""Forces of stretching and bending, straight rest shapes: discrete elastic rods (Bergou et al. 2008).

Stretching: E = k/2 (|e|/rest - free)^2 rest (Sutherland 2012, Eq. 3.9; free is 1 but for what was crushed). Bending:
E = alpha |kb|^2 / span with the curvature binormal of unit tangents, |kb|^2 = 4 tan^2(phi/2); Eq. 3.3 has rest lengths
in it, which is right only for rods that do not stretch. Written with c = t0.t1 and 1 - c = |t1 - t0|^2 / 2, the forces
need no cross product and keep their digits at small angles.

Both are forces between the ends of edges, so they are summed by edges. A part's edges are rows of numbers: loops over
rows are vectorised, where loops over vertices (v, 3) are not. Measured (ns of CPU per vertex, 200 rods): both together
5.6 with the copies, 15.3 edge after edge.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import BOW, FREE, RADIUS, REST, STIFF, TENSION, WEAK

__all__ = ["bend", "bending", "place", "strain", "stretch", "stretching"]

# Rows of a part's edges (`plan.ROWS`): 0 first end, 3 second end [m], 6 tangent, 9 length [m], 10 its inverse, 11
# -dE/de [N], 14 and 17 its parts by the hinges behind and before the edge [N], 20 the edge, 23 and 26 p and q of its
# curve [m]; 29 and 32 forces on these [N].
#: Keeps an edge of no length, and a hinge folded flat, finite.
_TINY = 1e-30
_FLAT = 1e-9


@njit(cache=True, error_model="numpy")
def place(x: np.ndarray, a: np.ndarray, b: np.ndarray, row: np.ndarray) -> None:
    """Copy the ends a, b (m,) of edges from x (v, 3) [m] to their rows."""
    for q in range(len(a)):
        i = a[q]
        row[0, q] = x[i, 0]
        row[1, q] = x[i, 1]
        row[2, q] = x[i, 2]
        i = b[q]
        row[3, q] = x[i, 0]
        row[4, q] = x[i, 1]
        row[5, q] = x[i, 2]


@njit(cache=True, error_model="numpy")
def stretch(count: int, law: np.ndarray, row: np.ndarray) -> None:
    """Fill tangents, lengths and forces of `count` edges from their ends; law (15, m) as `Plan.edge` has it."""
    for q in range(count):
        ex = row[3, q] - row[0, q]
        ey = row[4, q] - row[1, q]
        ez = row[5, q] - row[2, q]
        length = np.sqrt(ex * ex + ey * ey + ez * ez)
        il = 1.0 / max(length, _TINY)
        row[20, q] = ex
        row[21, q] = ey
        row[22, q] = ez
        ex *= il
        ey *= il
        ez *= il
        pull = law[TENSION, q] * (length / law[REST, q] - law[FREE, q])
        row[6, q] = ex
        row[7, q] = ey
        row[8, q] = ez
        row[9, q] = length
        row[10, q] = il
        row[11, q] = -pull * ex
        row[12, q] = -pull * ey
        row[13, q] = -pull * ez


@njit(cache=True, error_model="numpy")
def bend(count: int, law: np.ndarray, row: np.ndarray) -> None:
    """Add the forces of the hinges between neighbours of `count` edges; law (15, m) as `Plan.edge` has it."""
    for c in range(3):
        row[14 + c, count - 1] = 0.0
        row[17 + c, 0] = 0.0
    for q in range(count - 1):
        ux = row[6, q]
        uy = row[7, q]
        uz = row[8, q]
        wx = row[6, q + 1]
        wy = row[7, q + 1]
        wz = row[8, q + 1]
        dx = wx - ux
        dy = wy - uy
        dz = wz - uz
        less = 0.5 * (dx * dx + dy * dy + dz * dz)  # 1 - c
        more = max(2.0 - less, _FLAT)  # 1 + c
        g = 2.0 * law[STIFF, q] / (more * more)
        gp = g * row[10, q]
        gq = g * row[10, q + 1]
        # -dE/de of both edges: the parts of the other tangent across one's own
        row[14, q] = gp * (dx + less * ux)
        row[15, q] = gp * (dy + less * uy)
        row[16, q] = gp * (dz + less * uz)
        row[17, q + 1] = gq * (less * wx - dx)
        row[18, q + 1] = gq * (less * wy - dy)
        row[19, q + 1] = gq * (less * wz - dz)
    for c in range(3):
        for q in range(count):
            row[11 + c, q] += row[14 + c, q] + row[17 + c, q]


@njit(cache=True, error_model="numpy")
def stretching(count: int, law: np.ndarray, row: np.ndarray) -> float:
    """Return the energy [J] of stretching."""
    energy = 0.0
    for q in range(count):
        strain = row[9, q] / law[REST, q] - law[FREE, q]
        energy += 0.5 * law[TENSION, q] * strain * strain * law[REST, q]
    return energy


@njit(cache=True, error_model="numpy")
def bending(count: int, law: np.ndarray, row: np.ndarray) -> float:
    """Return the energy [J] of bending."""
    energy = 0.0
    for q in range(count - 1):
        dx = row[6, q + 1] - row[6, q]
        dy = row[7, q + 1] - row[7, q]
        dz = row[8, q + 1] - row[8, q]
        less = 0.5 * (dx * dx + dy * dy + dz * dz)
        energy += law[STIFF, q] * less / max(2.0 - less, _FLAT)
    return energy


@njit(cache=True, error_model="numpy")
def strain(count: int, law: np.ndarray, row: np.ndarray) -> float:
    """Return a bound of what `fracture.overstress` finds in `count` edges: strain over strength where it is highest.

    It holds without twist, and for breaks anywhere: the strain along an edge lies between those of its neighbours.
    """
    top = 0.0
    before = -1.0  # the larger strain and the curvature at the joint before
    bow = 0.0
    own = row[9, 0] / law[REST, 0] - law[FREE, 0] if law[TENSION, 0] > 0.0 else -1.0
    for q in range(count):
        after = -1.0
        curved = 0.0
        following = -1.0
        if q + 1 < count:
            if law[TENSION, q + 1] > 0.0:
                following = row[9, q + 1] / law[REST, q + 1] - law[FREE, q + 1]
            if law[BOW, q] > 0.0:
                dx = row[6, q + 1] - row[6, q]
                dy = row[7, q + 1] - row[7, q]
                dz = row[8, q + 1] - row[8, q]
                less = 0.5 * (dx * dx + dy * dy + dz * dz)
                curved = law[BOW, q] * np.sqrt(less / max(2.0 - less, _FLAT))
                after = max(own, following)
        most = max(own, max(before, after)) + law[RADIUS, q] * max(bow, curved)
        top = max(top, most * law[WEAK, q])
        own = following
        before = after
        bow = curved
    return top
