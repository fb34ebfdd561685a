"""What each pair of bonded rods bears of a bundle's shear, so that the whole bears what its section does.

Were a bundle sheared evenly, pairs of one size each would do. But rods move along the grain, past each other, until
each is at rest: a disordered net gives way by this, by 4 to 13 % where it is twisted, most at its rim. And of few rods
each is as stiff in shear as a rod that cannot be sheared: bent, 20 are a fifth too stiff. So pairs get shares that make
four answers of the net those of the section (`exact`): to torsion, and to flexure along y, along z and between both.
The logarithm of a share is made up of as many smooth functions: 1, how a pair lies about the axis, and how in the
section. So neighbours stay alike.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from .exact import sheared

__all__ = ["WAYS", "Net", "shares"]

#: Rounds of Newton's method, where it has settled, and the least and the most of a share over an even one. A net of a
#: few rods may not come to all four.
_ROUNDS, _SETTLED, _LEAST, _MOST = 12, 1e-6, 0.5, 2.0
#: The fewest rods that have some in their middle: a ring bears torsion and flexure by the same pairs.
_FEWEST = 8
#: Along what flexure is asked for.
WAYS = np.array([[1.0, 0.0], [0.0, 1.0], [0.5**0.5, 0.5**0.5]])


class Net:
    """Pairs (n, 2) of rods that are sheared; points (k, 2) [m] and areas (k,) [m2] of the rods."""

    def __init__(self, points: np.ndarray, pairs: np.ndarray, area: np.ndarray) -> None:
        way = points[pairs[:, 1]] - points[pairs[:, 0]]
        centred = points - area @ points / area.sum()
        self.long = np.linalg.norm(way, axis=1)
        self.unit, middle = way / self.long[:, None], centred[pairs].mean(1)
        # slopes of rods along the pair where the bundle is twisted by 1 a metre
        self.turned = middle[:, 0] * self.unit[:, 1] - middle[:, 1] * self.unit[:, 0]
        rows, over = np.tile(np.arange(len(pairs)), 2), 1 / self.long
        shape = len(pairs), len(points)
        self.slip = sp.csr_matrix((np.concatenate([-over, over]), (rows, pairs.T.ravel())), shape=shape)
        self.push = area[:, None] * (centred @ WAYS.T)

    def answers(self, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return J [m4] and the three C [m6], and by how much (4, n) their logarithms follow those of size (n,) [m2].

        At rest the energy is least, or the work most: so what a pair holds of it is its part.
        """
        stiff = (self.slip.T @ sp.diags(2 * size) @ self.slip).tocsc()
        turn = self.slip.T @ (2 * size * self.turned)
        # one rod stays where it is: places along are relative
        found = splu(stiff[1:, 1:]).solve(np.column_stack([-turn, self.push])[1:])
        slips = self.slip[:, 1:] @ found
        slips[:, 0] += self.turned
        held = 2 * size[:, None] * slips**2
        value = held.sum(0)
        return value, np.array([1.0, -1.0, -1.0, -1.0])[:, None] * held.T / np.maximum(value, 1e-300)[:, None]

    def smooth(self) -> np.ndarray:
        """Return what shares' logarithms are made of (n, 4)."""
        c, s = self.unit.T
        about = self.turned**2 / max(float((self.turned**2).mean()), 1e-300)
        return np.column_stack([np.ones(len(c)), about, c * c - s * s, 2 * c * s])


def shares(
    points: np.ndarray, pairs: np.ndarray, area: np.ndarray, outline: np.ndarray, twisted: bool = False
) -> np.ndarray:
    """Return by how much more than an even share of the section's shear each pair (n, 2) of rods bears (n,).

    points (k, 2) [m], area (k,) [m2] of rods; outline (m, 2) [m] counter-clockwise, its centroid the origin; twisted:
    rods resist twist of their own. A net that does not hold all rods together, or of fewer than eight, has even shares.
    """
    found = np.ones(len(pairs))
    if not _whole(pairs, len(points)):
        return found
    net, wanted = Net(points, pairs, area), sheared(outline, WAYS)
    if twisted:
        wanted[0] -= float((area**2).sum()) / (2 * np.pi)
    smooth, power, best, now = net.smooth(), np.zeros(4), np.inf, found
    for _ in range(_ROUNDS):
        value, part = net.answers(now * area.sum() / len(pairs))
        off = np.log(wanted / np.maximum(value, 1e-300))
        if np.linalg.norm(off) < best:
            best, found = float(np.linalg.norm(off)), now
        if best < _SETTLED:
            break
        power = power + np.linalg.lstsq(part @ smooth, off, rcond=0.03)[0]
        now = np.clip(np.exp(smooth @ power), _LEAST, _MOST)
    return found


def _whole(pairs: np.ndarray, count: int) -> bool:
    """Return whether pairs (n, 2) hold so many rods together, and these are enough."""
    if count < _FEWEST or len(pairs) < count:
        return False
    net = sp.csr_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return int(connected_components(net, directed=False)[0]) == 1
