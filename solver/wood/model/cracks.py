"""What crack each pair of bonded rods stands for: widths in the section that add up along every straight line to it.

A crack along the grain parts the bonds that it crosses. So that it costs G times its area, whatever the rods, the
widths of the pairs that a line through the section crosses must add up to the line's length inside. For a net without
end, evenly strewn and the same in all directions, a pair at the distance d with the part V of the section has
pi V / (2 d). A bundle of a few rods ends soon: there is less at its rim and more in its middle. From that start the
widths are brought nearer to what lines of all directions ask for, by factors, as pictures are made in emission
tomography (Shepp and Vardi 1982): so none becomes negative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from .outline import area, chords

__all__ = ["widths"]

#: Directions of lines, lines per direction over the root of the number of rods, and rounds.
_WAYS, _LINES, _ROUNDS = 24, 4.0, 60


def widths(
    points: np.ndarray, pairs: np.ndarray, outline: np.ndarray, lines: Sequence[tuple[int, float]] = ()
) -> np.ndarray:
    """Return the width (n,) [m] of crack that each pair (n, 2) of rods at points (k, 2) [m] holds together.

    lines (0: y, 1: z; value [m]): where saw cuts begin a crack, whose cost is met before all others'.
    """
    if not len(pairs):
        return np.zeros(0)
    first, second = points[pairs[:, 0]], points[pairs[:, 1]]
    found: np.ndarray = np.pi / 2 * area(outline) / (len(pairs) * np.linalg.norm(second - first, axis=1))
    # the same lines for all, or the last digits would hang on a generator
    angle = np.pi * (np.arange(_WAYS) + 0.5) / _WAYS
    count = int(np.ceil(_LINES * np.sqrt(len(points))))
    normal = np.repeat(np.column_stack([np.cos(angle), np.sin(angle)]), count, 0)
    along = points @ normal[::count].T
    # between the outermost rods: beyond them nothing holds together
    part = (np.arange(count) + 0.5) / count
    offset = (along.min(0)[:, None] + np.ptp(along, axis=0)[:, None] * part).ravel()
    rows = []
    for w in range(_WAYS):
        a, b = first @ normal[w * count], second @ normal[w * count]
        mine = offset[w * count : (w + 1) * count, None]
        rows.append(sp.csr_matrix(((a < mine) != (b < mine)).astype(float)))
    crossed = sp.vstack(rows).tocsr()
    wanted = chords(outline, normal, offset)
    seen = np.maximum(np.asarray(crossed.sum(0)).ravel(), 1e-300)
    for _ in range(_ROUNDS):
        now = crossed @ found
        ratio = np.where(now > 0, wanted / np.where(now > 0, now, 1.0), 1.0)
        update = (crossed.T @ ratio) / seen
        found *= np.where(update > 0, update, 1.0)
        for c, at in lines:
            own = (first[:, c] < at) != (second[:, c] < at)
            wide = float(chords(outline, np.eye(2)[c][None], np.array([at]))[0])
            found[own] *= wide / max(float(found[own].sum()), 1e-300)
    return found
