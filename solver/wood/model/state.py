"""All arrays of a run, and the work arrays that fit them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .arrays import Bodies, Bonds, Flight, Pins, Poses, Rods, Rubbing, Turns
from .fragments import fragments
from .gripping import Course
from .motion import Motion, Scratch
from .plan import ROWS, plan_for

__all__ = ["State", "Wood", "copied", "scratch_for"]


@dataclass(frozen=True)
class Wood:
    """All arrays of a run. Their contents change as it runs, and a break that adds vertices makes a new value."""

    motion: Motion
    rods: Rods
    bonds: Bonds
    turns: Turns
    bodies: Bodies
    pins: Pins
    turning: bool
    strength: np.ndarray  # (e, samples) tensile strain that each place bears
    rod: np.ndarray  # (e,) int32 rod of an edge, ghosts too
    grid: np.ndarray  # (rods, vertices) int32: vertex numbers as laid
    cut: np.ndarray  # (e,) where an edge is cut, 0 to 1; -1: it is not
    parent: np.ndarray  # (v,) int32 vertex that one was split from; itself as laid
    straight: np.ndarray  # (v, 3) places in the straight bundle, as laid [m]
    sawn: np.ndarray  # (p,) int32 vertices at which saw cuts part rods
    grips: tuple[Course, ...] = ()
    scaling: float = 1.0  # masses over real ones, see `scaling`
    least: float = 0.0  # real mass that an edge in contact needs to be stable [kg]

    def copied(self) -> Wood:
        """Return a copy that can be stepped without touching this one."""
        return replace(
            self,
            motion=Motion(*(a.copy() for a in self.motion)),
            rods=Rods(*(a.copy() for a in self.rods)),
            bonds=Bonds(*(a.copy() for a in self.bonds)),
            pins=Pins(*(a.copy() for a in self.pins)),
            bodies=self.bodies._replace(flight=Flight(*(a.copy() for a in self.bodies.flight))),
            cut=self.cut.copy(),
        )


def scratch_for(wood: Wood) -> Scratch:
    """Return work arrays that fit, and the plan of what is whole."""
    plan = plan_for(wood.rods, wood.bonds, wood.strength)
    held = wood.motion.held.copy()
    held[wood.pins.vertex] = 1
    v, e, r = len(wood.motion.x), len(wood.rods.a), len(wood.bodies.kind)
    here = [np.zeros((r, 3)) for _ in range(5)]
    return Scratch(
        np.zeros((v, 3)),
        np.zeros((2, e + len(plan.stub), 8)),
        np.zeros((len(plan.part) - 1, ROWS, plan.edge.shape[2])),
        wood.motion.old.copy(),
        1.0 / wood.rods.rest,
        np.zeros(e),
        np.zeros((2, len(wood.bonds.i))),
        Poses(here[0], here[1], here[2], np.tile(np.eye(3), (r, 1, 1)), here[3], here[4]),
        np.zeros((r, 6)),
        np.zeros(2),
        np.zeros(len(wood.rods.before)),
        wood.motion.mass.copy(),
        np.zeros((len(plan.part) - 1, 4)),
        Rubbing(np.zeros((0, 2), np.int32), np.zeros(4)),
        plan,
        fragments(wood.rods, wood.bonds, held, wood.motion.mass, wood.scaling, wood.least),
    )


class State(NamedTuple):
    """A moment of a run. books (6,) [J] as `motion` numbers them; impulse (r, 6) of the bodies, [N s] and
    moments of it about their pivots [N m s]; steps taken.

    gripped (g, 6): impulse [N s] and moment of it about the pivot [N m s] that each grip put in; spent [J]: energy that
    breaks took so far; crushed [J]: that crushing of rods did.
    """

    wood: Wood
    scratch: Scratch
    books: np.ndarray
    impulse: np.ndarray
    gripped: np.ndarray
    spent: float
    rods: int
    bonds: int
    steps: int
    crushed: float = 0.0


def _again(scratch: Scratch) -> Scratch:
    """Return a copy; plan and fragments are not written to, but for what a step writes before it reads it."""
    kept = ("rubbing", "plan", "fragments", "poses")
    fresh: dict[str, Any] = {name: getattr(scratch, name).copy() for name in Scratch._fields if name not in kept}
    fresh["poses"] = Poses(*(a.copy() for a in scratch.poses))
    return scratch._replace(**fresh)


def copied(state: State) -> State:
    """Return a state that can be stepped without touching this one."""
    wood = state.wood.copied()
    return state._replace(
        wood=wood,
        scratch=_again(state.scratch),
        books=state.books.copy(),
        impulse=state.impulse.copy(),
        gripped=state.gripped.copy(),
    )
