"""Everything that a growing shell is at one time; immutable, so that undo is to keep it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from .. import shell
from ..arrays import Bools, Floats, Ints
from .anchors import Anchors
from .tooling.holding import Holds

__all__ = ["Spot", "State"]


@dataclass(frozen=True, eq=False)
class Spot:
    """A hot spot on its way: radius, how often it has split, its letter; or a stroke's dab, by its number.

    anchor: of the spot, and, where it has a heading, of a point ahead: so the heading turns with the surface.
    """

    anchor: Anchors
    radius: float
    splits: int = 0
    letter: str = ""
    dab: int = 0


@dataclass(frozen=True, eq=False)
class State:
    """Shape and rest state.

    time: growth time. x: (n, 3). mesh: topology. g: rest metrics (f, 3). rest: rest angles (h,). shares: (n, k) of
    hot surfaces that have started. held: (n, 3) directions that are held, bool. spots, curves: by number of the tool.
    forces: largest out-of-balance force over mu l. iterations: steps of the minimiser so far. drift: (n, 3) how fast
    the shape moved in the last step, None at the start. minimum: whether it was shown, when it was settled to be
    handed over, that the energy bends up along every way as far as its digits tell. matter: (n, ...) what rides on the
    material (`matter`); thick: (n,) thickness over the sheet's, where that differs; led: (n, 3) how fast what is held
    is led. corners: (f, 3, k) what rides on triangles, and differs along seams: uv. faces: (f,) numbers that triangles
    hand down: material. holds: what holds it, None where nothing does; loose: (f,) with it,
    which share of a triangle lies outside of it (`tooling.holding`).
    """

    time: float
    x: Floats
    mesh: shell.Topology
    g: Floats
    rest: Floats
    shares: dict[int, Floats]
    held: Bools
    spots: dict[int, tuple[Spot, ...]]
    curves: dict[int, Anchors]
    forces: float = 0.0
    iterations: int = 0
    drift: Floats | None = None
    minimum: bool = False
    matter: dict[str, Floats] = field(default_factory=dict)
    corners: dict[str, Floats] = field(default_factory=dict)
    faces: dict[str, Ints] = field(default_factory=dict)
    holds: Holds | None = None
    loose: Floats | None = None

    @cached_property
    def length(self) -> float:
        """Mean rest edge."""
        a, b, c = self.g.T
        return float((np.sqrt(a).sum() + np.sqrt(c).sum() + np.sqrt(a + c - 2 * b).sum()) / (3 * len(a)))
