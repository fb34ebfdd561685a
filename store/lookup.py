"""Look-up: the shape of a fruit between the samples of a table (Liu et al. 2014, section 5.4, Eq. 13-14).

The spectra of the nearest samples are weighted by inverse distance, and one inverse FFT gives the displacement at any
resolution. Weighting spectra is the same as weighting displacements; the spectrum buys the level of detail and the
small table. Between stages the change is linear, and the fresh shape at s = 0 is one of them: swollen stages (s < 0)
lead away from it as dried ones do. The fresh shape itself is not interpolated: it follows from the parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from solver.fruit import Fruit, azimuths, colatitudes

from . import asking, generation, seal, spectra, surface, transforms
from .errors import CorruptTable, OutsideTable
from .manifest import TableInfo
from .neighbours import SAME, Neighbours, Weighted
from .samples import insert
from .store import Store
from .tables import info, path_of

__all__ = ["Shape", "ShapeTable"]

Array = NDArray[Any]

#: Fields that a query may ask for.
FIELDS = ("position", "displacement")
#: Stands for the fresh shape among the stored stages.
_FRESH = -1
#: Descriptors that are zero on the fresh shape; the others have no known value next to it.
_ZERO_AT_FIRST = ("roughness", "buckle_count", "penetration")


@dataclass(frozen=True, eq=False)
class Shape:
    """An interpolated surface on the lattice. What was not asked for is None.

    `position` and `displacement` are (n, 2n, 3), `poles` (2, 3) the positions at colatitude 0 and pi, all in units of
    r1 and in the table's precision. `weights` says which results it was made of, `nearest` how far (scaled) the
    nearest one is, and `exact` that the query is a stored result at a stored stage (or fresh). `converged` is false
    if a stage that it was made of had not reached its residual.
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

    @property
    def normals(self) -> Array:
        """Outward unit normals (n, 2n, 3), computed when first asked for.

        Raises:
            OutsideTable: the positions were not asked for.

        """
        return self._normals[0]

    @property
    def pole_normals(self) -> Array:
        """Outward unit normals (2, 3) at the poles, computed when first asked for.

        Raises:
            OutsideTable: the positions were not asked for.

        """
        return self._normals[1]

    @cached_property
    def _normals(self) -> tuple[Array, Array]:
        if self.position is None:
            raise OutsideTable("normals follow from positions.", "Ask for the field 'position'.")
        return surface.normals(self.position)


class ShapeTable:
    """One generation of a table, open for queries by any number of threads."""

    def __init__(self, table: TableInfo, path: Path) -> None:
        self.info = table
        self._spectra = generation.map_spectra(path)
        with generation.open(path) as opened:
            columns = {name: opened[name].values for name in (*table.axes, *table.descriptors)}
            self._converged = opened["converged"].values.astype(bool) if "converged" in opened else None
            self._keys = [str(key) for key in opened["key"].values]
            self._units = {name: str(opened[name].attrs.get("units", "")) for name in table.descriptors}
            self._units |= dict.fromkeys(FIELDS, str(opened["spectrum"].attrs["units"]))
        self._descriptors = {name: columns[name] for name in table.descriptors}
        values = np.stack([columns[name] for name in table.axes], axis=-1) if table.axes else None
        self._neighbours = None if values is None else Neighbours(values)
        stored = {stage: j for j, stage in enumerate(table.stages)}
        self._knots = np.array(sorted({0.0, *stored}))
        self._stored = [stored.get(knot, _FRESH) for knot in self._knots.tolist()]

    @classmethod
    def open(cls, path_or_store: Path | str | Store, name: str = "default", verify: bool = True) -> Self:
        """Open the current generation of a table; `verify` reads all of it once and finds any changed byte.

        Raises:
            MissingStore: there is no store in that directory.
            UnknownTable: it has no table of that name.
            CorruptTable: the table is damaged.

        """
        store = path_or_store if isinstance(path_or_store, Store) else Store.open(path_or_store)
        for last_try in (False, False, True):
            table = info(store, name)
            path = path_of(store, table)
            try:
                if verify and not seal.is_whole(path):
                    raise CorruptTable(f"{path} is damaged.", "Rebuild the table from the shards.")
                return cls(table, path)
            except FileNotFoundError:
                # swapped and pruned since the manifest was read
                if last_try:
                    raise CorruptTable(f"{path} is missing.", "Rebuild the table from the shards.") from None
        raise AssertionError("unreachable")

    @property
    def axes(self) -> dict[str, tuple[float, float]]:
        """Parameters that vary, with their bounds: each must be given."""
        return dict(self.info.axes)

    @property
    def fixed(self) -> dict[str, Any]:
        """Parameters that are the same in the whole table."""
        return dict(self.info.fixed)

    @property
    def stages(self) -> tuple[float, ...]:
        """Stored stages; the fresh stage 0 goes without saying."""
        return self.info.stages

    @property
    def reach(self) -> tuple[float, float]:
        """First and last stage that can be asked for."""
        return self.info.reach

    @property
    def digest(self) -> str:
        """Digest of the content: two tables with one digest give the same shapes."""
        return self.info.digest

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.info.samples

    @property
    def resolution(self) -> int:
        """Band limit, and the lattice that holds every wave of it."""
        return self.info.resolution

    def at(
        self,
        query: Mapping[str, float],
        stage: float,
        *,
        resolution: int | None = None,
        fields: Sequence[str] = ("position",),
        m: int = 6,
        eta: float = 2.0,
    ) -> Shape:
        """Return the shape at parameters and a stage, on the lattice of `resolution` (None: the table's own).

        `fields` are position and/or displacement; nothing else is computed. The `m` nearest samples take part, with
        weights distance^-eta.

        Raises:
            OutsideTable: the table does not reach there, or does not hold that.
            InvalidGeometry: no fruit has these parameters, though each lies within the table's bounds.

        """
        values = asking.settle(self.info, query)
        s = asking.settle_stage(self.info, stage)
        asking.check_names("field", fields, list(FIELDS))
        n = self.resolution if resolution is None else resolution
        if not 4 <= n <= 1024:
            raise OutsideTable(f"a resolution of {n} is out of reach.", "Ask for 4 to 1024 colatitudes.")
        if m < 1 or not eta > 0:
            raise OutsideTable(f"m = {m} neighbours with eta = {eta} give no weights.", "Take m >= 1 and eta > 0.")
        near = self._near(values, m, eta)
        stages = self._bracket(s)
        fruit = self._fruit(values) if "position" in fields else None
        waves = self._blend(near, stages)
        position, displacement = _synthesize(waves, n, fruit, "displacement" in fields)
        poles = None
        if fruit is not None:
            poles = (surface.fresh_poles(fruit) + spectra.poles(np.moveaxis(waves, 0, -1))).astype(waves.real.dtype)
        return Shape(
            colatitude=colatitudes(n),
            azimuth=azimuths(n),
            position=position,
            displacement=displacement,
            poles=poles,
            stage=s,
            parameters=values,
            descriptors=self._describe(near, stages),
            weights={self._keys[i]: float(w) for i, w in zip(near.samples, near.weights, strict=True)},
            nearest=near.nearest,
            exact=s == 0 or (near.nearest == 0.0 and len(stages) == 1),
            converged=self._has_converged(near, stages),
            table=self.digest,
            units={name: self._units[name] for name in (*fields, *self.info.descriptors)},
        )

    def _near(self, values: Mapping[str, float], m: int, eta: float) -> Weighted:
        if self._neighbours is None:
            return Weighted(np.zeros(1, int), np.ones(1), 0.0)
        return self._neighbours.weigh(np.array(list(values.values())), m, eta)

    def _bracket(self, stage: float) -> dict[int, float]:
        """Return the stages around one with their weights: stored ones by their place, and `_FRESH`."""
        after = int(np.searchsorted(self._knots, stage, side="left"))
        before = max(after - 1, 0)
        low, high = self._knots[before], self._knots[after]
        part = (stage - low) / (high - low) if high > low else 1.0
        if abs(part - round(part)) < SAME:
            part = round(part)
        # where the lowest stage is asked for, both are the same one
        weights = {self._stored[before]: 1 - part, self._stored[after]: part}
        return {j: float(weight) for j, weight in weights.items() if weight > 0}

    def _terms(self, near: Weighted, stages: Mapping[int, float]) -> list[tuple[int, int, float]]:
        """Return (sample, stage, weight) of all that takes part; the fresh shape adds nothing."""
        stored = [(j, t) for j, t in stages.items() if j != _FRESH]
        return [(i, j, w * t) for i, w in zip(near.samples, near.weights, strict=True) for j, t in stored]

    def _blend(self, near: Weighted, stages: Mapping[int, float]) -> Array:
        """Return the weighted spectrum (component, m, k)."""
        first = self._spectra[0, 0]
        # not by BLAS: its threads would wait for each other in a busy server, for a sum of a tenth of a millisecond
        total, scaled = np.zeros_like(first), np.empty_like(first)
        for sample, stage, weight in self._terms(near, stages):
            total += np.multiply(self._spectra[sample, stage], first.dtype.type(weight), out=scaled)
        return total.view(np.result_type(first.dtype, np.complex64)).reshape(first.shape[:-1])

    def _describe(self, near: Weighted, stages: Mapping[int, float]) -> dict[str, float]:
        terms = self._terms(near, stages)
        known = _ZERO_AT_FIRST if _FRESH in stages else self._descriptors
        return {
            name: float(sum(w * self._descriptors[name][i, j] for i, j, w in terms))
            for name in known
            if name in self._descriptors
        }

    def _has_converged(self, near: Weighted, stages: Mapping[int, float]) -> bool:
        terms = self._terms(near, stages)
        return self._converged is None or all(bool(self._converged[i, j]) for i, j, _ in terms)

    def _fruit(self, values: Mapping[str, float]) -> Fruit:
        params = insert(self.info.template, self.info.places, values)
        try:
            radii, stone, te = tuple(params["radii"]), tuple(params["stone"]), params["exocarp_thickness"]
        except KeyError:
            raise OutsideTable(
                "the table is not of fruits, whose fresh shape is known.", "Ask for 'displacement'."
            ) from None
        _check_fruit(radii, stone)
        return Fruit.model_construct(radii=radii, stone=stone, exocarp_thickness=te)


@lru_cache(maxsize=256)
def _check_fruit(radii: tuple[float, ...], stone: tuple[float, ...]) -> None:
    """Refuse impossible fruits. The exocarp lies outside of all that could collide, and its bounds are a box."""
    Fruit.parse({"radii": radii, "stone": stone})


def _synthesize(waves: Array, n: int, fruit: Fruit | None, displaced: bool) -> tuple[Array | None, Array | None]:
    """Return positions and displacements (n, 2n, 3), each only if wanted."""
    if fruit is None and not displaced:
        return None, None
    with transforms.borrow(n, min(waves.shape[1] - 1, n), len(waves), waves.real.dtype) as plan:
        spectra.fill(plan.coefficients, waves)
        planes = plan.run()
        position = None if fruit is None else surface.add_fresh(fruit, planes)
        return position, np.stack(list(planes), axis=-1) if displaced else None
