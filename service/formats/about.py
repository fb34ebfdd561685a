"""What a file says about its shape besides the numbers: where it comes from, how far to trust it, in which units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from solver import __version__
from solver.contract import Shade, Worn, dryness

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["GENERATOR", "LENGTH_UNIT", "About", "extras", "lattice"]

GENERATOR = f"wizen {__version__}"
#: Every length in a file is in units of the fruit's reference radius; multiply by the real one to get metres.
LENGTH_UNIT = "r1"
#: Which points make a triangle, for formats without: `mesh.triangles`, in numbers that a client can follow. Corners are
#: steps [rows, columns] from a point to the south and east of which a quad lies; `fans` around each pole likewise, from
#: a point of the first row (north) and of the last (south). Columns go on at 0 after the last, where all are there.
TRIANGLES: Mapping[str, Any] = {
    "quads": [[[0, 0], [0, 1], [1, 0]], [[0, 1], [1, 1], [1, 0]]],
    "fans": [["north", [0, 1], [0, 0]], ["south", [0, 0], [0, 1]]],
}


@dataclass(frozen=True)
class About:
    """What a shape does not know of itself: its solver, its table's name, what the table holds fixed.

    `made` says how its runs were done where that is not the usual: mirror planes, a pattern that they start from.
    `units` are those of the parameters and the stage; `detail` says what was chosen of resolution, part and fields;
    `links` and `timings` [ms] appear in JSON alone. `shade` is its skin, if anybody knows it, over stages that `reach`
    so far, `metres` the length of r1, if anybody knows it.
    """

    solver: str = ""
    table: str = ""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    stage_symbol: str = "stage"
    units: Mapping[str, str] = field(default_factory=dict)
    detail: Mapping[str, Any] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    made: Mapping[str, Any] = field(default_factory=dict)
    shade: Shade | None = None
    reach: tuple[float, float] = (0.0, 1.0)
    metres: float | None = None

    def worn(self, stage: float) -> Worn | None:
        """Return what the skin is at a stage."""
        return None if self.shade is None else self.shade.worn(dryness(stage, self.reach))


def extras(shape: Shape, about: About) -> dict[str, Any]:
    """Return what every file format carries along, as plain JSON values."""
    return {
        "generator": GENERATOR,
        "solver": about.solver,
        "table": about.table,
        "digest": shape.table,
        "params": {**about.fixed, **shape.parameters},
        **({"made": dict(about.made)} if about.made else {}),
        "stage": {"symbol": about.stage_symbol, "value": shape.stage},
        **shape.trust(),
        "nearest": shape.nearest if math.isfinite(shape.nearest) else None,
        "volume": shape.volume,
        "method": shape.method,
        "units": {"length": LENGTH_UNIT, **({"metres": about.metres} if about.metres else {}), **about.units},
        **({"detail": dict(about.detail)} if about.detail else {}),
    }


def lattice(rows: int, columns: int, about: About) -> dict[str, Any]:
    """Return what a format without triangles says of its points: how many there are, and how they are joined.

    A part of a surface has no poles.
    """
    joined = {**TRIANGLES, "fans": []} if "region" in about.detail else TRIANGLES
    return {"colatitude": rows, "azimuth": columns, "triangles": joined}
