"""The longest stable step: 2 over the highest frequency, by Lanczos' method on differences of the forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import eigh_tridiagonal

from ..model.motion import Scratch
from ..model.state import Wood, scratch_for
from .explicit import forces
from .flying import softest

__all__ = ["FEW", "longest_step", "touchable"]

#: Iterations, and those of a step that is chosen anew: from below they miss some .1 and some 2 % of the square of the
#: highest frequency, of 20,000 (Kuczynski and Wozniakowski 1992).
_MANY, FEW = 64, 24
#: What they may still miss.
_MARGIN = 1.03


def _highest(wood: Wood, scratch: Scratch, iterations: int) -> float:
    """Return the square [1/s2] of the highest frequency of rods and bonds about where they are."""
    motion, x, books = wood.motion, wood.motion.x.copy(), np.zeros(6)
    nobody = wood.bodies._replace(kind=wood.bodies.kind[:0])
    free = (motion.held == 0)[:, None]
    root = np.sqrt(motion.mass)[:, None]
    h = 1e-6 * float(wood.rods.rest.min())
    p = np.where(free, np.random.default_rng(0).normal(size=x.shape), 0.0)
    last, off = np.zeros_like(p), 0.0
    along: list[float] = []
    beside: list[float] = []
    for _ in range(iterations):
        size = float(np.linalg.norm(p))
        # nothing is left that forces could move
        if size <= 1e-12 * (along[-1] if along else 1e-300) or size == 0:
            break
        if along:
            beside.append(size)
            off = size
        p = p / size
        step = p / root
        step *= h / np.abs(step).max()
        scale = float(np.linalg.norm(step * root))
        difference = np.zeros_like(x)
        for sign in (1.0, -1.0):
            motion.x[:] = x + sign * step
            forces(motion, wood.rods, wood.turns, nobody, scratch, wood.turning, 0.0, 1.0, books)
            difference -= sign * scratch.f
        q = np.where(free, difference / (2 * scale) / root, 0.0)
        along.append(float((p * q).sum()))
        last, p = p, q - along[-1] * p - off * last
    motion.x[:] = x
    return float(eigh_tridiagonal(np.array(along), np.array(beside), eigvals_only=True)[-1]) if along else 0.0


def longest_step(wood: Wood, contact: float = 0.0, iterations: int = _MANY) -> float:
    """Return the step [s] at which the explicit scheme blows up, a little below rather than above.

    The contact's frequency is added to that of the rods (Weyl's inequality), and the twisting's is bounded by
    Gershgorin's disks; the larger counts. contact [N/m]: stiffness of contacts between rods, up to four at a vertex.
    """
    probe = wood.copied()
    motion = probe.motion
    motion.load[:] = 0.0
    free = motion.held == 0
    highest = max(_highest(probe, scratch_for(wood), iterations), 0.0)
    if len(wood.bodies.k):
        solid = np.where(wood.rods.k > 0, wood.rods.rest, 0.0)
        # each vertex bears the contact of half its edges
        borne = np.bincount(wood.rods.a, solid / 2, len(free)) + np.bincount(wood.rods.b, solid / 2, len(free))
        highest += float((wood.bodies.k.sum() * borne[free] / motion.mass[free]).max())
        highest += softest(wood.bodies, len(wood.grid))
    highest += 4 * contact / float(motion.mass[free].min())
    if wood.turning:
        tight = 2 * wood.turns.beta / wood.rods.span
        row = np.bincount(wood.rods.before, tight, len(wood.rods.a))
        row += np.bincount(wood.rods.after, tight, len(wood.rods.a))
        real = wood.turns.inertia > 0
        highest = max(highest, float((2 * row[real] / wood.turns.inertia[real]).max()))
    return float(2 / np.sqrt(max(highest * _MARGIN, 1e-300)))


def touchable(wood: Wood, dt: float, contact: float = 0.0) -> Wood:
    """Return the bundle with the real mass that fragments need to bear contacts' stiffness at steps of `dt` [s].

    A spring's end needs m > k dt^2 / 4. Pressed off its middle, a fragment turns, too: by up to 8 times as light.
    contact [N/m]: stiffness of contacts between rods.
    """
    if wood.scaling == 1:
        return wood
    bodies = float(wood.bodies.k.max(initial=0.0) * wood.rods.rest[wood.rods.k > 0].mean())
    return replace(wood, least=4 * max(bodies, contact) * dt * dt)
