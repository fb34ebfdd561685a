"""What moves: the state of all vertices and edges, the books of energy, and the work arrays of a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .arrays import Poses, Rubbing
from .fragments import Fragments
from .plan import Plan

__all__ = ["BENDING", "BONDS", "CONTACT", "LOST", "STRETCH", "WORK", "Motion", "Scratch"]

#: Entries of the books [J]: energies of the present, then sums over time.
STRETCH, BENDING, BONDS, CONTACT, WORK, LOST = range(6)


class Motion(NamedTuple):
    """The state of all vertices and edges."""

    x: np.ndarray  # (v, 3) [m]
    v: np.ndarray  # (v, 3) [m/s]
    mass: np.ndarray  # (v,) [kg]
    held: np.ndarray  # (v,) uint8: keeps its velocity whatever the force
    load: np.ndarray  # (v, 3) dead load and weight [N]
    d: np.ndarray  # (e, 3) reference director
    old: np.ndarray  # (e, 3) tangent that d belongs to
    theta: np.ndarray  # (e,) angle of the material frame [radian]
    spin: np.ndarray  # (e,) [radian/s]
    reference: np.ndarray  # (h,) reference twist [radian]


class Scratch(NamedTuple):
    """What a step writes before it reads it; shapes as in `Motion`, bodies (r,); pairs of edges."""

    f: np.ndarray
    seats: np.ndarray  # (2, s, 8) place [m] and slope of every seat of the plan; force [N] and what pulls on it [N m]
    rows: np.ndarray  # of the plan's parts (p, rows, m), see `plan.ROWS`
    t: np.ndarray
    inverse: np.ndarray
    torque: np.ndarray
    each: np.ndarray
    poses: Poses
    push: np.ndarray  # (r, 6) force [N] on each body and its moment about its pivot [N m]
    power: np.ndarray
    bent: np.ndarray  # (h,) curvature beyond that at rest, of rods that resist twist [1/m]
    light: np.ndarray  # (v,) mass that friction may stop in half a step [kg]
    found: np.ndarray  # of the plan's parts (p, 4): energies [J] of stretching, bending, bonds; bound of `rods.strain`
    rubbing: Rubbing
    plan: Plan
    fragments: Fragments
