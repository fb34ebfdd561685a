"""What stands in for runs that are not stored: something plain, as large as what is run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.arrays import Array, Floats
from solver.contract import Params, Solver
from solver.contract.mesh import GivenMesh
from solver.lattice import lattice

from ...formats import mesh
from .runs import Missing
from .shades import DUMMY
from .solid import Solid
from .stored import Stored, Whole

__all__ = ["placeholder"]

#: Thickness of a box whose thing has none, over its longest side.
_THIN = 0.02
#: Colatitudes of a fresh shape that stands in for what becomes of it.
_ROUND = 48


def placeholder(missing: Missing, name: str, stages: Sequence[float] = ()) -> Stored:
    """Return what stands in at some stages, or all, of a run that is not stored: the fresh shape, else a box as large
    as what is run.
    """
    shown = list(stages) or list(missing.spec.need["stages"])
    solver, values = missing.solver, missing.params.model_dump(mode="json")
    fresh, metres = solver.fresh(values), solver.metres(values)
    worn = DUMMY[1].worn(0.0)
    if fresh is not None:
        position = fresh.points(*lattice(_ROUND)).astype(np.float32)
        poles = fresh.poles().astype(np.float32)
        points, triangles = mesh.vertices(position, poles), mesh.triangles(_ROUND)
        normal = mesh.vertices(*mesh.normals(position, poles))
        what, sides = "the fresh shape", np.ptp(points, axis=0)
    else:
        sides, metres = _sides(solver, missing.params)
        what = "a box as large as it is at the start" if sides.any() else "a box of its unit"
        sides = np.maximum(sides, _THIN * sides.max()) if sides.any() else np.ones(3)
        points, normal, triangles = _box(sides)
    solid = Solid(((points, normal),), triangles.astype(np.int64), (np.tile(worn.ridge, (len(points), 1)),))
    source = {
        "placeholder": what,
        "solver": solver.name,
        "symbol": solver.stages.symbol,
        "stages": shown,
        "sides": [round(float(x), 6) for x in sides],
    }
    trust = {"expected_error": None, "exact": False, "converged": None}
    made = Whole(solid, worn, metres, fresh is not None, source, trust)
    last = f"..{shown[-1]:g}" if len(shown) > 1 else ""
    return Stored(f"{name} {solver.stages.symbol}={shown[0]:g}{last}, missing", made, (), missing)


def _sides(solver: Solver, params: Params) -> tuple[Floats, float | None]:
    """Return the sides (3) of what is run at its start, and the length of its unit [m]; zeros where nobody knows."""
    if solver.extent is not None:
        return solver.extent(params)
    for _, value in params:
        if isinstance(value, GivenMesh) and hasattr(value, "points"):
            return np.ptp(np.array(value.points, float), axis=0), None
    return np.zeros(3), None


def _box(sides: Floats) -> tuple[Array, Array, Array]:
    """Return points, normals (24, 3) and triangles (12, 3) of a box about the origin."""
    points, normals, triangles = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = np.zeros(3)
                corner[[axis, u, v]] = sign, a, b
                points.append(0.5 * corner * sides)
                normals.append(np.eye(3)[axis] * sign)
            k = len(points) - 4
            turned = [(k, k + 1, k + 2), (k, k + 2, k + 3)]
            triangles += turned if sign > 0 else [t[::-1] for t in turned]
    return np.array(points, np.float32), np.array(normals, np.float32), np.array(triangles)
