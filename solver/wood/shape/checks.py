"""What an axis, a taper and a fork must be: checks that parameters make."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from .curve import Curve

if TYPE_CHECKING:
    from ..params import WoodParams

__all__ = ["check_shape", "length_of"]

#: The sharpest curve over the inverse radius; how far a given length may be off the axis' own, over it.
_SHARPEST, _OFF = 0.5, 1e-3
#: Length of a fork's bend over radius times angle; the fewest rods that make two limbs.
_BEND, _FEWEST = 4.0, 8


def length_of(axis: Any) -> float:
    """Return the length [m] of the axis through points (n, 3) [m].

    Raises:
        ValueError: they make no axis.

    """
    try:
        points = [tuple(float(c) for c in p) for p in axis]
    except (TypeError, ValueError):
        raise ValueError("a spine is a list of points x, y, z") from None
    return _curve(points).length


def _curve(points: Sequence[Sequence[float]]) -> Curve:
    if len(points) < 2 or any(len(p) != 3 for p in points):
        raise ValueError("a spine needs two points x, y, z or more")
    if any(tuple(a) == tuple(b) for a, b in pairwise(points)):
        raise ValueError("two points of the spine that follow each other are the same: give each once")
    return Curve(points)


def check_shape(params: WoodParams) -> None:
    """Refuse what cannot be laid.

    Raises:
        ValueError: see above.

    """
    if params.spine:
        _check_axis(params)
    if params.fork is not None:
        _check_fork(params)


def _check_axis(params: WoodParams) -> None:
    if params.curvature:
        raise ValueError("a spine has its own curvature: leave curvature out, or the spine")
    curve, wide = _curve(params.spine), params.wide * max(1.0, params.taper)
    if abs(curve.length / params.length - 1) > _OFF:
        raise ValueError(f"the spine is {curve.length:.6g} m long: leave length out, or give points that are as far")
    if curve.sharpest() * wide > _SHARPEST:
        raise ValueError(
            "the spine is curved more sharply than the bundle is thick: take more points, or a smaller radius"
        )
    if curve.closest(2 * wide) < 2 * wide:
        raise ValueError("the spine passes through its own bundle: move its points apart, or take a smaller radius")


def _check_fork(params: WoodParams) -> None:
    fork = params.fork
    assert fork is not None
    if params.spine or params.curvature or params.outline:
        raise ValueError("only straight, round stems fork: leave spine, curvature and outline out, or the fork")
    if params.grain.deviates or params.twist:
        raise ValueError(
            "fibres of a forked stem are straight below it: leave spiral, knots and twist out, or the fork"
        )
    if params.rods < _FEWEST:
        raise ValueError(f"two limbs need {_FEWEST} rods or more: take more rods, or leave the fork out")
    if fork.at + _BEND * params.radius * max(fork.angle, fork.lean) > params.length:
        raise ValueError("the fork's limbs end before they part: take a smaller `at` or radius, or a longer length")
