"""Quasi-Newton iteration on a stale factor: two-loop L-BFGS with a line search on slopes (Liu and Nocedal 1989).

Forces of contact and friction have kinks: the iteration is semi-smooth. A step is accepted where the slope along it
has fallen enough, which needs no energy and holds where friction has none.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

__all__ = ["Found", "descend"]

#: Pairs that are remembered.
_MEMORY = 20
#: A step is accepted when the slope along it is below this part of the slope at its start.
_ENOUGH = 0.3
_TRIALS = 8


class Found(NamedTuple):
    """Where the iteration ended: x and residual (v, 3), its norm, and solves with the factor."""

    x: np.ndarray
    r: np.ndarray
    norm: float
    solves: int


def _two_loops(
    r: np.ndarray, pairs: deque[tuple[np.ndarray, np.ndarray, float]], solve: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    q, shares = r.copy(), []
    for s, y, rho in reversed(pairs):
        share = rho * float(np.vdot(s, q))
        q -= share * y
        shares.append(share)
    p = solve(q)
    for (s, y, rho), share in zip(pairs, reversed(shares), strict=True):
        p += (share - rho * float(np.vdot(y, p))) * s
    return -p


def _searched(
    residual: Callable[[np.ndarray], np.ndarray], x: np.ndarray, p: np.ndarray, slope: float, longest: float
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return x + a p, the residual there, and whether the slope has fallen; a is 1 where that will do."""
    low, high, at, last = 0.0, np.inf, slope, slope
    a = min(1.0, longest / max(float(np.abs(p).max()), 1e-300))
    r = residual(x + a * p)
    for _ in range(_TRIALS):
        along = float(np.vdot(r, p))
        if np.isfinite(along) and abs(along) <= _ENOUGH * abs(slope):
            return x + a * p, r, True
        if np.isfinite(along) and along < 0:
            # still downhill: further, but not beyond what is known to be uphill
            low, at = a, along
            if not np.isfinite(high):
                a = a * min(4.0, max(1.5, along / (along - last) if along > last else 4.0))
                last = along
                if a * float(np.abs(p).max()) > 4 * longest:
                    return x + low * p, residual(x + low * p), True
            else:
                a = (low + high) / 2
        else:
            high = a
            # regula falsi between the slopes, away from both ends
            share = at / (at - along) if np.isfinite(along) else 0.1
            a = low + (high - low) * min(max(share, 0.1), 0.9)
        r = residual(x + a * p)
    return x + a * p, r, False


def descend(
    residual: Callable[[np.ndarray], np.ndarray],
    x: np.ndarray,
    solve: Callable[[np.ndarray], np.ndarray],
    wanted: float,
    most: int,
    longest: float,
) -> Found:
    """Iterate from x (v, 3) until the norm of the residual is at most `wanted`, or `most` solves are used up.

    residual: gradient (v, 3) [N], zero where held. solve: the factor's step for a residual. longest: the farthest that
    a vertex moves at once [m].
    """
    r = residual(x)
    norm = float(np.linalg.norm(r))
    pairs: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=_MEMORY)
    solves, poor = 0, 0
    best = (x, r, norm)
    while norm > wanted and solves < most and np.isfinite(norm):
        p = _two_loops(r, pairs, solve)
        solves += 1
        slope = float(np.vdot(r, p))
        if not slope < 0:
            if not pairs:
                break
            pairs.clear()
            continue
        x1, r1, fell = _searched(residual, x, p, slope, longest)
        s, y = x1 - x, r1 - r
        curve = float(np.vdot(s, y))
        if curve > 1e-10 * float(np.linalg.norm(s)) * float(np.linalg.norm(y)):
            pairs.append((s, y, 1.0 / curve))
        poor = 0 if fell else poor + 1
        x, r, norm = x1, r1, float(np.linalg.norm(r1))
        if norm < best[2]:
            best = (x, r, norm)
        if poor == 2:
            break
    return Found(*best, solves)
