"""The tier between table and run: a looked-up shape, brought by its solver into the equilibrium next to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from solver.contract import Context, Need, Quality, Solver
from store.lookup import ShapeTable
from store.shape import Shape

__all__ = ["relaxed"]


def relaxed(
    solver: Solver, table: ShapeTable, shape: Shape, quality: Quality = "preview", context: Context | None = None
) -> tuple[Shape, Mapping[str, Any]]:
    """Return the equilibrium next to a shape that was looked up with its positions, on the same lattice, and what
    relaxing said of it: `residual`, `moved` (rms of the radial motion over the roughness), `iterations`, `seconds`.

    Raises:
        InvalidInput: the solver relaxes nothing, or refuses the parameters.
        SolverError: typed, where it failed.

    """
    if shape.position is None:
        raise ValueError("look the shape up with its position")
    told = tuple(name for name in table.info.descriptors if name in solver.fields)
    need = Need(
        fields=("displacement", "lattice_crossings", "position", *told),
        quality=quality,
        resolution=len(shape.position),
        dtype="float64" if table.info.dtype == "float64" else "float32",
    )
    params = solver.parse(table.at_parameters(shape.parameters))
    found = solver.relaxed(params, np.asarray(shape.position, float), shape.stage, need, context).isel(stage=0)
    position = found["position"].values
    made = replace(
        shape,
        position=position,
        displacement=found["displacement"].values,
        poles=position[[0, -1]].mean(axis=1),
        descriptors={name: float(found[name]) for name in told},
        exact=False,
        converged=bool(found["converged"]),
        crossings=int(found["lattice_crossings"]),
        expected_error=None,
        tier="relaxed",
    )
    said = {name: float(found[name]) for name in ("residual", "moved", "iterations", "seconds")}
    return made, said
