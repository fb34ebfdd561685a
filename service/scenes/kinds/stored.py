"""Stages of stored runs as kinds of a scene: meshes of their own, in the colours that their solvers give them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from solver import registry
from solver.arrays import Array, Floats
from solver.contract import Need, Shade, Solver, SolverError, Worn, dryness
from solver.resting import Body
from store.store import Store

from ...errors import InvalidQuery, Wrong
from ...formats import mesh
from ...sequences import Sequence as Stages
from ...sequences import of_run
from ...sequences.options import Options
from ...sequences.standing import Extra, cards, stems
from ...sequences.view import Surface
from ...vocabulary import row_of
from ..meshes import Packed, quantised, weathered
from ..request import Item
from .kind import Curve, Kind
from .runs import Missing
from .shades import PLAIN, shade_of
from .solid import Solid

__all__ = ["Stored", "Whole", "stored"]

#: Of the least radius of a lattice, what surely is within it.
_WITHIN = 0.9


class Whole(NamedTuple):
    """A shape as it is kept: its mesh, its skin, and what is said of it."""

    solid: Solid
    skin: Worn
    metres: float | None
    round: bool
    source: dict[str, Any]
    trust: dict[str, Any]


@dataclass(eq=False)
class Stored(Kind):
    """A stage of a run, or several on a curve, as a mesh of its own; or the plain shape of one that is missing.

    Lengths are in the run's own unit. Lattices stay about their own origin; meshes lie about the middle of what a
    picture of the run shows, or else of the first stage's box.
    """

    label: str
    made: Whole
    curve: Curve = ()
    missing: Missing | None = None
    spent: dict[int, float] = field(default_factory=dict)

    @property
    def metres(self) -> float | None:  # type: ignore[override]
        """Length of the run's unit [m]."""
        return self.made.metres

    @property
    def source(self) -> dict[str, Any]:
        """The run and its box."""
        low, high = self.made.solid.points.min(axis=0), self.made.solid.points.max(axis=0)
        box = [[round(float(x), 6) for x in ends] for ends in (low, high)]
        return {**self.made.source, "metres_per_unit": self.metres, "box": box}

    def made_of(self, n: int) -> dict[str, Any]:
        """Return the run, its stages and the level."""
        return {**self.made.source, "n": int(n)}

    @cached_property
    def _digest(self) -> str:
        return hashlib.sha256(json.dumps(self.made.source, sort_keys=True).encode()).hexdigest()

    @property
    def identity(self) -> Hashable:
        """The run and its stages."""
        return self._digest

    @property
    def finest(self) -> int:
        """The run's own mesh."""
        return self.made.solid.finest

    @property
    def fresh_reach(self) -> float:
        """Radius that holds it."""
        return self.reach[1]

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Radii of balls about the origin: within it, where it is round, and around it."""
        r = np.concatenate([np.linalg.norm(points, axis=1) for points, _ in self.made.solid.stages])
        return _WITHIN * float(r.min()) if self.made.round else 0.0, float(r.max())

    @cached_property
    def extent(self) -> float:
        """Largest coordinate."""
        return max(float(np.abs(points).max()) for points, _ in self.made.solid.stages)

    @property
    def outline(self) -> Floats:
        """Corners of its convex hull."""
        return self.made.solid.outline

    def holds(self, point: Floats) -> bool:
        """Return whether a point is inside."""
        return self.made.solid.holds(point)

    @property
    def body(self) -> Body:
        """Its surface."""
        return Body(self.made.solid.around)

    @property
    def look(self) -> tuple[str, Hashable]:
        """A material of its own, or the plain one of all that stands in for something."""
        if self.missing is not None:
            return "placeholder", None
        return f"{self.made.source['solver']} {self._digest[:8]}", self._digest

    @property
    def prim(self) -> str:
        """The material's name as a word."""
        return "placeholder" if self.missing is not None else f"run{self._digest[:12]}"

    @property
    def skin(self) -> Worn:
        """The largest of its colours, and its mean roughness."""
        return self.made.skin

    def packed(self, n: int) -> list[Packed]:
        """Return its vertices that are left at a level."""
        surfaces, colours = self.surfaces(n), self.colours(n)
        shown = colours if self.fades else colours * len(surfaces)
        return [
            quantised(points, normal, colour / self.skin.base, self.extent)
            for (points, normal), colour in zip(surfaces, shown, strict=True)
        ]

    def surfaces(self, n: int) -> list[tuple[Array, Array]]:
        """Return its vertices that are left at a level, and their normals."""
        left = self.made.solid.level(n).vertices
        return [(points[left], normal[left]) for points, normal in self.made.solid.stages]

    def colours(self, n: int) -> list[Floats]:
        """Return their colours."""
        left = self.made.solid.level(n).vertices
        return [colour[left] for colour in self.made.solid.colours]

    @property
    def fades(self) -> bool:
        """Whether its solver gives every stage colours of its own."""
        return len(self.made.solid.colours) > 1

    def triangles(self, n: int) -> Array:
        """Return its triangles at a level."""
        return self.made.solid.level(n).triangles

    def count(self, n: int) -> int:
        """Return their number."""
        return len(self.triangles(n))

    @property
    def topology(self) -> Hashable:
        """Nobody else's."""
        return self._digest

    def extras(self, n: int) -> dict[str, Any]:
        """Return where it comes from, and how long its unit is in the positions."""
        return {**self.made.source, "triangles": self.count(n), "unit": 1 / self.step}

    def trust(self, levels: Sequence[int]) -> dict[str, Any]:
        """Return what the run says of itself, and how far coarser meshes are off it, over its size."""
        off = {str(n): round(self.made.solid.level(n).error, 5) for n in levels}
        return {**self.made.trust, "coarsened": off}


def stored(store: Store, key: str, item: Item) -> Stored:
    """Return the stage of a stored run that an item names, the last one if it names none, or those of its curve.

    Raises:
        InvalidQuery: the run has no such stage, no surface, or triangles that change along the curve.
        InvalidInput: its solver has no such skin.
        StoreError: it is not stored, or damaged.

    """
    made = _read(store.root, key, item.stages, item.shade, item.preset, item.full)
    stages, symbol = made.source["stages"], made.source["symbol"]
    last = f"..{stages[-1]:g}" if item.curve else ""
    return Stored(f"{item.preset or made.source['solver']} {symbol}={stages[0]:g}{last}", made, item.curve)


@lru_cache(maxsize=12)
def _read(root: Path, key: str, stages: tuple[float, ...], shade: str | None, preset: str | None, full: bool) -> Whole:
    """Return stages of a run, which never changes, as a scene wants them."""
    run = Store(root).get(key)
    sequence = of_run(run)
    rows = [row_of(sequence.stages, stage, "run") for stage in stages] or [len(sequence) - 1]
    if len(rows) > 1 and not sequence.kept:
        advice = "Take a stage, or an item for each of several."
        raise InvalidQuery.of([Wrong("curve", "the triangles of this run change from stage to stage", advice)])
    surfaces = [next(iter(sequence.at(row))) for row in rows]
    name = str(run.attrs.get("solver", ""))
    solver = registry.get(name) if name in registry.names() else None
    worn = PLAIN if solver is None else shade_of(solver, shade, preset)
    colours, dressed = _coloured(sequence, surfaces, solver, worn[1])
    standing = _standing(sequence, surfaces[0]) if full else []
    solid, dressed = _solid(sequence, surfaces, solver, colours, standing), _brighter(dressed, standing)
    source = {
        "run": key,
        "solver": name,
        "symbol": "stage" if solver is None else solver.stages.symbol,
        "stages": [sequence.stages[row] for row in rows],
        **({"shade": worn[0]} if surfaces[0].colour is None else {}),
        **({"full": True} if standing else {}),
    }
    converged = all(bool(run["converged"].values[row]) for row in rows) if "converged" in run else None
    trust = {"expected_error": _error(run.attrs, solver), "exact": True, "converged": converged}
    dressed = dressed._replace(thin=solid.is_open or bool(standing))
    return Whole(solid, dressed, sequence.unit or None, bool(sequence.lattice), source, trust)


def _coloured(
    stages: Stages, surfaces: Sequence[Surface], solver: Solver | None, shade: Shade
) -> tuple[list[Floats], Worn]:
    """Return the colours of the vertices (v, 3), of every stage or of the first alone, and a skin that holds them."""
    painted = [np.clip(one.colour.astype(float), 0, 1) for one in surfaces if one.colour is not None]
    first = surfaces[0]
    if len(painted) == len(surfaces) and first.roughness is not None:
        base = np.max([colour.max(axis=0) for colour in painted], axis=0)
        return painted, Worn(base, base, float(first.roughness.mean()), 0.0, np.zeros(3))
    worn = shade.worn(dryness(first.stage, (0.0, 0.0) if solver is None else solver.stages.reach))
    n = stages.lattice
    if not n:
        return [np.tile(worn.ridge, (len(first.vertices), 1))], worn
    position, poles = first.vertices[:-2].reshape(n, 2 * n, 3), first.vertices[-2:]
    return [weathered(position, mesh.normals(position, poles)[0], worn) * worn.base], worn


def _standing(stages: Stages, surface: Surface) -> list[Extra]:
    """Return what stands on a stage's surface."""
    options = Options(full=True)
    threads = cards(stages, surface, options)
    return [*stems(stages, surface, options), *([] if threads is None else [threads])]


def _brighter(worn: Worn, standing: Sequence[Extra]) -> Worn:
    """Return a skin whose colours hold those of what stands on it, too."""
    most = np.max([worn.base, *(one.colour.max(axis=0) for one in standing)], axis=0)
    return worn._replace(ridge=most, furrow=most) if standing else worn


def _solid(
    stages: Stages,
    surfaces: Sequence[Surface],
    solver: Solver | None,
    colours: Sequence[Floats],
    standing: Sequence[Extra],
) -> Solid:
    """Return the mesh without what only took part in the run, about its middle, and behind it what stands on it."""
    first = surfaces[0]
    triangles = first.triangles.astype(np.int64)
    aside = first.fields.get(solver.looks.aside or "") if solver is not None else None
    if aside is not None:
        triangles = triangles[(aside[triangles] < 0.5).any(axis=1)]
    used, flat = np.unique(triangles, return_inverse=True)
    middle = np.zeros(3, np.float32)
    if not stages.lattice:
        middle = 0.5 * (first.vertices[used].min(axis=0) + first.vertices[used].max(axis=0))
        if "view" in stages.run.attrs:
            x, y, z = np.asarray(stages.run.attrs["view"], np.float32)[:3]
            middle = np.array([x, z, -y] if stages.run.attrs.get("up") == "z" else [x, y, z], np.float32)
    found = tuple((one.vertices[used] - middle, one.normals()[used]) for one in surfaces)
    own = Solid(found, flat.reshape(-1, 3), tuple(colour[used] for colour in colours))
    return own.under([(one.vertices - middle, one.normals, one.triangles, one.colour) for one in standing])


def _error(attrs: dict[str, Any], solver: Solver | None) -> dict[str, float] | None:
    """Return the relative error that the solver expects of a run of its own version; None where nobody knows."""
    if solver is None or solver.error is None or attrs.get("solver_version") != solver.version:
        return None
    try:
        need = Need.model_validate_json(attrs["need"])
        found = solver.error(solver.parse(json.loads(attrs["params"])), need.quality, need.stages[-1])
    except (SolverError, KeyError):
        return None
    return {"relative": round(float(found), 5)}
