"""A looked-up shape: the surface, what it was made of, and how far to trust it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from solver.arrays import Array

from .errors import OutsideTable
from .surfaces import drawn

__all__ = ["Shape"]


@dataclass(frozen=True, eq=False)
class Shape:
    """An interpolated surface on the lattice. What was not asked for is None.

    `position` and `displacement` are (n, 2n, 3), `poles` (2, 3) the positions at colatitude 0 and pi, all in units of
    r1 and in the table's precision. Of a window there are only its rows, columns and components, and no poles but with
    the whole lattice. `descriptors` are the stored results' numbers, weighted as these are, and not measured on the
    positions; `volume`, `normals` and `crossings` are, on the closed mesh (`store.surfaces.drawn`). `weights` says
    which results it was made of, `nearest` how far (scaled) the nearest one is, `inside` whether the query lies in the
    samples' convex hull, and `exact` that it is a stored result at a stored stage (or fresh). `converged` is false if a
    stage that it was made of had not reached its residual.
    `expected_error` says by measure (`store.surfaces.measures`, as errors: |rgh - 1| and 1 - corr) how far the shape
    may be off the true one; None where the table does not know, as for any method but the one it was built for.
    `held` is the share of the wrinkles' height (rms) that the lattice holds at least, by waves of degrees up to its n;
    1 where it holds all waves of the table; None where the table does not say. None of the errors expected is of what a
    coarse lattice leaves out.
    `crossings` counts the pairs of triangles that cross, of the closed lattice as it is handed over; None of a part and
    of a blend that was not put out of contact. `tier`: whether it is looked up in a `table`,
    `relaxed` from there by its solver, or a `run`.
    """

    colatitude: Array = field(repr=False)
    azimuth: Array = field(repr=False)
    position: Array | None = field(repr=False)
    displacement: Array | None = field(repr=False)
    poles: Array | None = field(repr=False)
    stage: float
    parameters: Mapping[str, float]
    descriptors: Mapping[str, float]
    weights: Mapping[str, float] = field(repr=False)
    nearest: float
    exact: bool
    converged: bool
    table: str
    units: Mapping[str, str] = field(repr=False, default_factory=dict)
    inside: bool = True
    expected_error: Mapping[str, float] | None = None
    method: str = ""
    held: float | None = None
    crossings: int | None = None
    tier: str = "table"

    def trust(self) -> dict[str, Any]:
        """Return how far to trust it, as plain values; every answer says so in this order."""
        return {
            "exact": self.exact,
            "converged": self.converged,
            "crossings": self.crossings,
            "tier": self.tier,
            "nearest": self.nearest,
            "inside": self.inside,
            "held": self.held,
            "expected_error": None if self.expected_error is None else dict(self.expected_error),
        }

    @property
    def normals(self) -> Array:
        """Outward unit normals (n, 2n, 3) of the closed mesh, computed when first asked for: at each point the mean
        of its triangles, weighted by area.

        Raises:
            OutsideTable: the positions were not asked for, or not of the whole surface.

        """
        return self._normals[0]

    @property
    def pole_normals(self) -> Array:
        """Outward unit normals (2, 3) of the closed mesh at the poles.

        Raises:
            OutsideTable: the positions were not asked for, or not of the whole surface.

        """
        return self._normals[1]

    @cached_property
    def volume(self) -> float | None:
        """Volume [r1^3] inside the closed mesh's triangles; None where there are no positions, or those of a part."""
        if self.position is None or self.poles is None or self.poles.shape[1] != 3:
            return None
        return drawn.volume(self.position, self.poles)

    @cached_property
    def _normals(self) -> tuple[Array, Array]:
        if self.position is None:
            raise OutsideTable("normals follow from positions.", "Ask for the field 'position'.")
        if self.poles is None or self.poles.shape[1] != 3:
            raise OutsideTable("normals follow from the whole surface.", "Ask for it without a window.")
        return drawn.normals(self.position, self.poles)
