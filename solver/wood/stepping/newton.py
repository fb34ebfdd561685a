"""Newton's method for one implicit step, its systems solved by conjugate gradients on a stale factor.

Contact and friction have kinks: the iteration is semi-smooth. A step is accepted where the slope along it has fallen
enough, which needs no energy and holds where friction has none. A direction of negative curvature ends the inner
iteration (Steihaug 1983) and what is negative is left out until the residual has fallen; each system is solved no
more exactly than its step is worth (Eisenstat and Walker 1996).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

__all__ = ["Found", "descend"]

Field = np.ndarray
#: Residual of the inner iteration over that of the outer, at first and at least.
_LOOSE, _TIGHT = 0.1, 1e-2
#: A step is accepted when the slope along it is below this part of the slope at its start.
_ENOUGH = 0.5
_TRIALS = 8
#: What a step that is still steep at its end is lengthened by.
_FURTHER = 3.0
#: What the residual falls to before negative second derivatives are tried again.
_AGAIN = 0.1
#: Solves in one inner iteration.
_INNER = 60
#: How much further a step may go than the last one did.
_WIDER = 3.0


class Found(NamedTuple):
    """Where the iteration ended: x (v, 3), the norm of the residual, solves with the factor, whether it is solved.

    poor: the factor is not positive to its rounding, as its products with positive second derivatives show.
    """

    x: Field
    norm: float
    solves: int
    rounds: int
    settled: bool
    poor: bool = False


def _direction(
    r: Field, apply: Callable[[Field], Field], solve: Callable[[Field], Field], share: float, most: int, reach: float
) -> tuple[Field, int, bool, bool]:
    """Return a step p with K p about -r, up to `share` of r, the solves it took, and whether K was not positive.

    It ends, too, where p moves something further than `reach`: what is beyond would be cut off. Then the last is true.
    """
    p, rest = np.zeros_like(r), -r
    wanted = share * float(np.linalg.norm(r))
    z = solve(rest)
    way, gain = z, float(np.vdot(rest, z))
    for count in range(1, most + 1):
        bent = apply(way)
        curve = float(np.vdot(way, bent))
        if curve <= 0 or gain <= 0:
            return (way if count == 1 else p), count, True, False
        a = gain / curve
        p = p + a * way
        if float(np.abs(p).max()) > reach:
            return p, count, False, True
        less = rest - a * bent
        if float(np.linalg.norm(less)) <= wanted or count == most:
            return p, count, False, False
        z = solve(less)
        # Polak and Ribiere's form: the factor is in single precision
        turn = float(np.vdot(z, less - rest)) / gain
        rest, gain = less, float(np.vdot(z, less))
        way = z + turn * way
    return p, most, False, False


def _searched(residual: Callable[[Field], Field], x: Field, p: Field, slope: float, most: float) -> tuple[Field, Field]:
    """Return x + a p and the residual there, with a from 0 to `most` where the slope is less than half of what it was.

    The first trial is 1, or `most` if that is less. A direction of which what is negative was left out is too short:
    where the slope is still steep, a grows.
    """
    low, at, high, beyond, a = 0.0, slope, np.inf, 0.0, min(1.0, most)
    for _ in range(_TRIALS):
        r = residual(x + a * p)
        along = float(np.vdot(r, p))
        steep = along < _ENOUGH * slope
        if np.isfinite(along) and along <= _ENOUGH * abs(slope) and (not steep or a >= most):
            break
        if np.isfinite(along) and along < 0:
            # Illinois: the end that stays counts half
            low, at, beyond = a, along, beyond / 2
        else:
            high, beyond, at = a, along if np.isfinite(along) else -9 * at, at if high == np.inf else at / 2
        if high == np.inf:
            a = min(_FURTHER * a, most)
            continue
        share = at / (at - beyond)
        a = low + (high - low) * min(max(share, 0.1), 0.9)
    return x + a * p, r


def descend(
    residual: Callable[[Field], Field],
    stiffness: Callable[[bool], Callable[[Field], Field]],
    x: Field,
    solve: Callable[[Field], Field],
    wanted: float,
    most: int,
    limit: Callable[[Field], float],
    little: float,
    doubtful: bool = False,
) -> Found:
    """Iterate from x (v, 3) until the norm of the residual is at most `wanted`, or `most` solves are used up.

    A step that promises less than `little` [J] is the last, too: what is stiff and light, as the end of a splinter, has
    a large residual where next to nothing is wrong.

    residual: gradient (v, 3) [N], zero where held. stiffness: the product with the second derivatives where residual
    was last asked, or with the positive ones among them. solve: the factor's. limit: the largest share of a step that
    can be trusted. doubtful: end where the factor is seen to be poor.
    """
    r = residual(x)
    norm = float(np.linalg.norm(r))
    solves, rounds, share, turned, settled = 0, 0, _LOOSE, np.inf, False
    reach, poor = np.inf, False
    while norm > wanted and not settled and solves < most and np.isfinite(norm):
        aim = max(share, 0.5 * wanted / norm)
        positive = norm > turned
        p, spent, bent, short = _direction(r, stiffness(positive), solve, aim, min(_INNER, most - solves), reach)
        solves, rounds = solves + spent, rounds + 1
        if bent and not positive:
            turned = _AGAIN * norm
            if solves < most:
                positive = True
                p, spent, bent, short = _direction(r, stiffness(True), solve, aim, min(_INNER, most - solves), reach)
                solves += spent
        slope = float(np.vdot(r, p))
        if not slope < 0:
            break
        # what was cut promises little, too
        settled = -slope < little and not short and not bent
        before, far = x, float(np.abs(p).max())
        x, r = _searched(residual, x, p, slope, limit(p))
        went = float(np.abs(x - before).max())
        # what a step was cut to, or more where it was not
        reach = _WIDER * max(went, 1e-300) if went < 0.5 * far else max(reach, _WIDER * went)
        last, norm = norm, float(np.linalg.norm(r))
        share = min(_LOOSE, max(_TIGHT, (norm / last) ** 2))
        poor = bent and positive
        if poor and doubtful:
            break
    return Found(x, norm, solves, rounds, settled or norm <= wanted, poor)
