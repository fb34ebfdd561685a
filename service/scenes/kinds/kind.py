"""What a scene needs to know of a shape, wherever it comes from."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from solver.arrays import Array, Floats
from solver.contract import Worn
from solver.resting import Body

from ..meshes import STEPS, Packed
from .runs import Missing

__all__ = ["COARSE", "RUNGS", "Curve", "Kind"]

#: Levels of detail: few, so that instances share them. Level n has 4 n^2 triangles, or at most about as many.
RUNGS = np.array([8, 16, 24, 32, 48, 64, 96, 128, 192, 256])
#: Colatitudes of the lattice that says how far a looked-up shape reaches and what hides behind it.
COARSE = 32

#: Seconds and stages.
Curve = tuple[tuple[float, float], ...]


class Kind(ABC):
    """One distinct shape of a scene: what it is made of, how large it is, and its meshes by level of detail.

    Lengths are in the kind's own unit, r1 for fruits, about its own origin. `curve` are seconds and stages, the first
    of which is the stage; empty where nothing changes. `metres` is its unit's length, None where nobody knows.
    `missing` says why something plain stands here in place of a run that is not stored. `variants` are what may be
    chosen in its place, where a format can hold them. `spent` is the processor time
    [s] of look-ups by level.
    """

    label: str
    curve: Curve = ()
    metres: float | None = None
    missing: Missing | None = None
    variants: tuple[Kind, ...] = ()
    spent: dict[int, float]

    @property
    @abstractmethod
    def source(self) -> dict[str, Any]:
        """Where it comes from, as the report says it: JSON values."""

    @abstractmethod
    def made_of(self, n: int) -> dict[str, Any]:
        """Return what names the mesh of a level, as JSON values: equal ones are equal meshes."""

    @property
    @abstractmethod
    def identity(self) -> Hashable:
        """What two kinds of one body have in common, in whatever scene."""

    @property
    @abstractmethod
    def finest(self) -> int:
        """The level beyond which nothing more is to be seen."""

    @property
    @abstractmethod
    def fresh_reach(self) -> float:
        """Radius of a ball about the origin that surely holds it, without a look-up."""

    @property
    @abstractmethod
    def reach(self) -> tuple[float, float]:
        """Radii of balls about the origin: within it (0 where there is none), and around it, at all its stages."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """Largest coordinate that counts when positions are rounded."""

    @property
    def step(self) -> float:
        """Length of one step of a rounded position."""
        return self.extent / STEPS

    @property
    @abstractmethod
    def outline(self) -> Floats:
        """Points (v, 3) that reach as far as it does in every direction."""

    @abstractmethod
    def holds(self, point: Floats) -> bool:
        """Return whether a point (3) is inside."""

    @property
    @abstractmethod
    def body(self) -> Body:
        """The shape for piles [1/unit]."""

    @property
    @abstractmethod
    def look(self) -> tuple[str, Hashable]:
        """The name of its material, and what tells that from others of the name."""

    @property
    @abstractmethod
    def prim(self) -> str:
        """The name of its material where names are words and tell materials apart."""

    @cached_property
    @abstractmethod
    def skin(self) -> Worn:
        """Colours and roughness of its material."""

    @abstractmethod
    def packed(self, n: int) -> list[Packed]:
        """Return the vertices of a level, at the stage and at those on the curve after it."""

    @abstractmethod
    def surfaces(self, n: int) -> list[tuple[Array, Array]]:
        """Return the points and normals (v, 3) of a level, at the stage and at those on the curve after it."""

    @abstractmethod
    def colours(self, n: int) -> list[Floats]:
        """Return the colours (v, 3) of a level, linear light, at the stage, and at those after it if they change."""

    @property
    @abstractmethod
    def fades(self) -> bool:
        """Whether its colours change along the curve."""

    @abstractmethod
    def triangles(self, n: int) -> Array:
        """Return the triangles (f, 3) of a level."""

    @abstractmethod
    def count(self, n: int) -> int:
        """Return the number of triangles of a level."""

    @property
    @abstractmethod
    def topology(self) -> Hashable:
        """Kinds whose levels have the same triangles have this in common."""

    @abstractmethod
    def extras(self, n: int) -> dict[str, Any]:
        """Return what a file says of the mesh of a level, so that its reader can put others in its place."""

    @abstractmethod
    def trust(self, levels: Sequence[int]) -> dict[str, Any]:
        """Return what the report says of how right it is, of the levels that are used."""
