"""The tier between table and run: a looked-up shape, brought by its solver into the equilibrium next to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.arrays import Floats
from solver.contract import Context, InvalidInput, Need, Params, Quality, Solver, Start

if TYPE_CHECKING:
    from store.lookup import ShapeTable
    from store.shape import Shape
    from store.store import Store

__all__ = ["begun", "lattice_of", "looked_up", "relaxed", "starts"]

#: How many times finer than the table's own is the lattice from which a shape is laid on the mesh, which reads it as
#: linear between its points: with two points to the shortest wave, ridges are cut off. What relaxing moves of runs
#: of te = 0.01 in a table falls from .10 of their roughness to .02 at s = 0.1; twice as fine again hardly matters.
_FINER = 4
#: Finest lattice that is made for it.
_FINEST = 1024


def lattice_of(table: ShapeTable) -> int:
    """Return the lattice from which shapes of a table are laid on the mesh."""
    return max(table.resolution, min(_FINER * table.resolution, _FINEST))


def begun(
    table: ShapeTable, values: Mapping[str, float], stage: float, method: str, lattice: int | None = None
) -> Floats:
    """Return the position (n, 2n, 3) that a table's shape is laid on the mesh from: its own, all waves of it, on that
    `lattice` or the table's own.

    Raises:
        OutsideTable: there is no such shape.

    """
    from store.surfaces import spectra

    own = table.at(dict(values), stage, method=method).position
    assert own is not None
    points = np.asarray(own, np.float64)
    return points if lattice is None else spectra.synthesize(spectra.spectrum(points), lattice)


def relaxed(
    solver: Solver, table: ShapeTable, shape: Shape, quality: Quality | None = None, context: Context | None = None
) -> tuple[Shape, Mapping[str, Any]]:
    """Return the equilibrium next to a shape that was looked up with its positions, on the same lattice, and what
    relaxing said of it: `residual`, `moved` (rms of the radial motion over the roughness), `iterations`, `seconds`.

    context: finds the pattern that the table's runs start from; without one only those in the package are found.
    Without a quality it is that of the table's runs: on another mesh their shapes are no equilibria, and slide away.
    It starts from the table's own waves, whatever lattice it is wanted on, and is closed at the poles as a run's stage
    is (`outputs.of_result`): a job that relaxes the same shape hands over the same points. The fresh shape is in
    balance as it is, and comes back as it was, with nothing said of it.

    Raises:
        InvalidInput: the solver relaxes nothing, or refuses the parameters; or the pattern is not there.
        SolverError: typed, where it failed.

    """
    from store import starter
    from store.surfaces import apart, spectra

    if shape.position is None:
        raise ValueError("look the shape up with its position")
    if shape.stage == 0:
        return shape, {}
    asked = {axis: shape.parameters[axis] for axis in table.axes}
    start = begun(table, asked, shape.stage, shape.method, lattice_of(table))
    told = tuple(name for name in table.info.descriptors if name in solver.fields)
    need = Need(
        fields=("displacement", "position", *told),
        quality=quality or table.info.quality,
        resolution=len(shape.position),
        dtype="float64" if table.info.dtype == "float64" else "float32",
    )
    params = solver.parse(table.at_parameters(shape.parameters))
    context = context or Context(library=starter.result)
    found = solver.relaxed(params, start, shape.stage, need, context).isel(stage=0)
    position = found["position"].values
    poles = spectra.poles(spectra.spectrum(position))
    made = replace(
        shape,
        position=position,
        displacement=found["displacement"].values,
        poles=poles,
        descriptors={name: float(found[name]) for name in told},
        exact=False,
        converged=bool(found["converged"]),
        crossings=apart.crossings(position, poles),
        expected_error=None,
        tier="relaxed",
    )
    said = {name: float(found[name]) for name in ("residual", "moved", "iterations", "seconds")}
    return made, said


def looked_up(
    table: ShapeTable, start: Start, params: Mapping[str, Any], stage: float, resolution: int
) -> dict[str, Any]:
    """Return what a table says of the shape that a job relaxed, as fields of a shape: what `relaxed` leaves as it was.

    Raises:
        OutsideTable: there is no such shape in it.

    """
    from store.generations.samples import read_axes

    values = read_axes(params, {axis: table.info.places[axis] for axis in table.axes})
    shape = table.at(values, stage, resolution=resolution, fields=(), method=start.method)
    return {name: getattr(shape, name) for name in ("nearest", "inside", "held", "weights")}


def starts(store: Store) -> Callable[[Start, Params, float], Floats]:
    """Return how a run finds the looked-up position that it starts from: `starts` of a `Context`.

    The table is the store's of that name, or the one that comes with wizen: the one whose content is meant.
    """

    def find(start: Start, params: Params, stage: float) -> Floats:
        from store.errors import OutsideTable
        from store.generations.samples import read_axes

        table = _meant(store.root, start)
        values = read_axes(params.model_dump(mode="json"), {axis: table.info.places[axis] for axis in table.axes})
        try:
            if table.at_parameters(values) != params.model_dump(mode="json"):
                advice = "Ask for the shape with exact=relax."
                raise InvalidInput("these parameters are not the table's.", advice=advice)
            return begun(table, values, stage, start.method, start.lattice)
        except OutsideTable as error:
            raise InvalidInput(error.message, advice=error.advice) from error

    return find


def _meant(root: Path, start: Start) -> ShapeTable:
    """Return the table that a start names, of the very content that it names.

    Raises:
        InvalidInput: there is none.

    """
    from store.errors import StoreError
    from store.starter import ROOT

    for place in dict.fromkeys((root, ROOT)):
        try:
            table = _open(place, start.table, start.digest)
        except StoreError:
            continue
        if table.digest == start.digest:
            return table
    raise InvalidInput(
        f"no table {start.table!r} with the digest {start.digest} is here: it was rebuilt or removed since.",
        advice="Ask for the shape again.",
    )


@lru_cache(maxsize=4)
def _open(root: Path, name: str, digest: str) -> ShapeTable:
    """Return the current table of that name; `digest` tells generations apart that are kept open."""
    from solver import registry
    from store.lookup import ShapeTable

    return ShapeTable.open(root, name, surfaces=registry.surface)
