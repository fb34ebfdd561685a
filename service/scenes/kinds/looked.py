"""Shapes that tables answer, on lattices of any fineness, each computed once."""

from __future__ import annotations

import time
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array, Floats
from solver.contract import Shade, Solver, Worn, dryness
from solver.resting import Body
from store.lookup import ShapeTable
from store.shape import Shape

from ...formats import mesh
from ...limits import waited
from ..meshes import Packed, pack, quantised, weathered
from .kind import COARSE, RUNGS, Curve, Kind

__all__ = ["Looked"]

#: Shares of the least and the largest radius of the coarse lattice, within and beyond which a shape of any lattice has
#: no point: over the package's tables they are .97 and 1.027.
_WITHIN, _AROUND = 0.9, 1.04


@dataclass(eq=False)
class Looked(Kind):
    """One shape of one table: its point, its stage, its skin, and what of it has been computed. Lengths are in r1."""

    solver: Solver
    table: ShapeTable
    point: dict[str, float]
    stage: float
    shade: tuple[str, Shade]
    label: str
    curve: Curve = ()
    metres: float | None = None
    shapes: dict[int, Shape] = field(default_factory=dict)
    spent: dict[int, float] = field(default_factory=dict)
    _ends: list[_Said] = field(default_factory=list)

    def shape(self, n: int) -> Shape:
        """Return the shape on the lattice of n colatitudes."""
        if n not in self.shapes:
            waited.check()
            start = time.thread_time()
            self.shapes[n] = self.table.at(self.point, self.stage, resolution=n)
            self.spent[n] = time.thread_time() - start
        return self.shapes[n]

    def later(self, n: int) -> list[Shape]:
        """Return the shapes on the curve after the first, on the lattice of n colatitudes."""
        start = time.thread_time()
        found = [self.table.at(self.point, stage, resolution=n) for _, stage in self.curve[1:]]
        self.spent[n] = self.spent.get(n, 0.0) + time.thread_time() - start
        self._ends = [_said(shape) for shape in found]
        return found

    @property
    def source(self) -> dict[str, Any]:
        """The table."""
        return {"table": self.table.info.name}

    def made_of(self, n: int) -> dict[str, Any]:
        """Return the table's digest, point, stages, lattice and skin."""
        return {
            "table": self.table.digest,
            "at": sorted(self.point.items()),
            "stages": [self.stage, *(stage for _, stage in self.curve)],
            "n": int(n),
            "shade": self.shade[0],
        }

    @property
    def identity(self) -> Hashable:
        """Table, point and stage."""
        return self.table.digest, tuple(sorted(self.point.items())), self.stage

    @cached_property
    def finest(self) -> int:
        """As fine as the table's own lattice."""
        return int(RUNGS[min(int(np.searchsorted(RUNGS, self.table.resolution)), len(RUNGS) - 1)])

    def _fresh(self) -> Floats:
        """Return points of the fresh shape, which nobody keeps: there may be thousands of kinds."""
        angles = np.meshgrid(np.linspace(0, np.pi, 17), np.linspace(0, 2 * np.pi, 32, endpoint=False), indexing="ij")
        found: Floats = self.table.fresh(self.point).points(*angles)
        return found

    @property
    def fresh_reach(self) -> float:
        """Radius that holds the fresh shape and what it shrinks to: drying moves nothing outwards by 5 %."""
        return 1.05 * float(np.linalg.norm(self._fresh(), axis=-1).max())

    @cached_property
    def outline(self) -> Floats:
        """Points (v, 3) of the coarse lattice and the poles."""
        found: Floats = mesh.vertices(*mesh.surface(self.shape(COARSE))).astype(float)
        return found

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Radii of balls about the origin: within the shape, and around it."""
        r = np.linalg.norm(self.outline, axis=1)
        low, high = float(r.min()), float(r.max())
        for shape in self.later(COARSE):
            r = np.linalg.norm(mesh.vertices(*mesh.surface(shape)), axis=1)
            low, high = min(low, float(r.min())), max(high, float(r.max()))
        return _WITHIN * low, _AROUND * high

    def holds(self, point: Floats) -> bool:
        """Return whether a point is nearer to the middle than the surface is in its direction."""
        r = np.linalg.norm(self.outline, axis=1)
        nearest = np.argmax(self.outline @ point / r)
        return bool(np.linalg.norm(point) < r[nearest])

    @cached_property
    def extent(self) -> float:
        """Largest coordinate of the fresh shape, which needs no look-up and which drying does not pass."""
        return 1.08 * float(np.abs(self._fresh()).max())

    @property
    def dryness(self) -> tuple[float, ...]:
        """Share of the way from the fresh shape to the table's last stage, at the stage and those on the curve."""
        stages = (self.stage, *(stage for _, stage in self.curve[1:]))
        return tuple(dryness(stage, self.table.reach) for stage in stages)

    @property
    def body(self) -> Body:
        """The shape for piles."""
        return Body(mesh.vertices(*mesh.surface(self.shape(32))).astype(float))

    @property
    def look(self) -> tuple[str, Hashable]:
        """The skin and how dry it is."""
        return self.shade[0], self.dryness

    @property
    def prim(self) -> str:
        """The skin and how dry it is, as a word."""
        return "_".join([self.shade[0], *(f"{1000 * share:.0f}" for share in self.dryness)])

    @cached_property
    def skin(self) -> Worn:
        """The skin of a fruit that is so dry; on a curve its brightest colours, which others are shares of."""
        worn = self._worn
        if not self.fades:
            return worn[0]
        base = np.max([one.base for one in worn], axis=0)
        return worn[0]._replace(ridge=base, furrow=base)

    @cached_property
    def _worn(self) -> list[Worn]:
        """The skins along the curve."""
        return [self.shade[1].worn(share) for share in self.dryness]

    def packed(self, n: int) -> list[Packed]:
        """Return lattices as vertices; one scale suits them all."""
        shapes = (self.shape(n), *self.later(n))
        if not self.fades:
            return [pack(one, self.skin, self.extent) for one in shapes]
        found = []
        for one, worn in zip(shapes, self._worn, strict=True):
            position, poles = mesh.surface(one)
            colour = weathered(position, one.normals, worn) * worn.base / self.skin.base
            normal = mesh.vertices(one.normals, one.pole_normals)
            found.append(quantised(mesh.vertices(position, poles), normal, colour, self.extent))
        return found

    def surfaces(self, n: int) -> list[tuple[Array, Array]]:
        """Return the points and normals of lattices and their poles."""
        found = []
        for shape in (self.shape(n), *self.later(n)):
            found.append((mesh.vertices(*mesh.surface(shape)), mesh.vertices(shape.normals, shape.pole_normals)))
        return found

    def colours(self, n: int) -> list[Floats]:
        """Return colours of ridges and furrows."""
        return [np.asarray(one.vertices["colour"][:, :3] / 255 * self.skin.base) for one in self.packed(n)]

    @property
    def fades(self) -> bool:
        """Whether it has a curve: a skin wears as it dries."""
        return len(self.curve) > 1

    def triangles(self, n: int) -> Array:
        """Return the triangles of the lattice."""
        return mesh.triangles(n)

    def count(self, n: int) -> int:
        """Return the number of triangles of the lattice."""
        return 4 * n * n

    @property
    def topology(self) -> Hashable:
        """That of all lattices."""
        return None

    def extras(self, n: int) -> dict[str, Any]:
        """Return what others of the kind must have to be put in the mesh's place: its lattice, and how long r1 is."""
        return {"colatitudes": n, "r1": 1 / self.step}

    def trust(self, levels: Sequence[int]) -> dict[str, Any]:
        """Return what the look-ups say of themselves; on a curve, the worst of its stages by measure."""
        looked = [self.shapes[n] for n in levels if n in self.shapes] or (
            [self.shapes[COARSE]] if COARSE in self.shapes else []
        )
        if not looked:
            return {}
        said = [_said(looked[-1]), *self._ends]
        errors = [one.expected_error for one in said if one.expected_error is not None]
        names = dict.fromkeys(name for error in errors for name in error) if len(errors) == len(said) else None
        told = None if names is None else {name: round(max(e.get(name, 0.0) for e in errors), 5) for name in names}
        return {
            "expected_error": told,
            "exact": all(one.exact for one in said),
            "converged": all(one.converged for one in said),
        }


class _Said(NamedTuple):
    """What a look-up says of itself, without its shape."""

    expected_error: Mapping[str, float] | None
    exact: bool
    converged: bool


def _said(shape: Shape) -> _Said:
    return _Said(shape.expected_error, shape.exact, shape.converged)
