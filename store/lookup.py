"""Look-up: the shape of a fruit between the samples of a table (after Liu et al. 2014, section 5.4, Eq. 13-14).

The spectra of the samples around are weighted, what their mean has lost of the wrinkles is given back (see
`store.blending.methods`), and one inverse FFT gives the displacement at any resolution. Weighting spectra is the same
as weighting displacements; the spectrum buys the level of detail and the small table. Between stages the change is
linear, and the fresh shape at s = 0 is one of them: swollen stages (s < 0) lead away from it as dried ones do. The
fresh shape itself is not interpolated: it follows from the parameters.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np

from solver.arrays import Array
from solver.contract import Fresh, Surface
from solver.lattice import azimuths, colatitudes
from solver.quantities import QUANTITIES

from . import seal
from .blending import asking, methods
from .blending.blend import Blend, Blender
from .blending.methods.thin import Mixture
from .blending.methods.weights import Samples
from .blending.neighbours import SAME, Weighted
from .errors import CorruptTable, OutsideTable
from .generations import generation, trust
from .generations.samples import insert
from .manifest import TableInfo
from .shape import Shape
from .store import Store
from .surfaces import harmonics, surface
from .surfaces.apart import COARSE, Evened, even_out
from .surfaces.measures import Measures
from .surfaces.window import WHOLE, Patch, Window
from .tables import info, path_of

__all__ = ["ShapeTable"]


#: Fields that a query may ask for.
FIELDS = ("position", "displacement")
#: Positions, displacements and poles.
_Fields = tuple[Array | None, Array | None, Array | None]
#: Stands for the fresh shape among the stored stages.
_FRESH = -1
#: Descriptors that are zero on the fresh shape, and those of them that grow from there; the others have no known value
#: next to it. Buckles come up at once, somewhere before the first stored stage.
_ZERO_AT_FIRST = ("roughness", "buckle_count", "penetration")
_GROWING = ("roughness", "penetration")
#: Power [r1^2] that is no wrinkle's but round-off.
_NO_WRINKLES = 1e-10


class ShapeTable:
    """One generation of a table, open for queries by any number of threads."""

    def __init__(
        self,
        table: TableInfo,
        path: Path,
        surface: Surface | None = None,
        before_folds: Callable[[], None] = lambda: None,
    ) -> None:
        self.info = table
        self._before_folds = before_folds
        self._spectra = generation.map_spectra(path)
        opened = generation.read(path)
        columns = {name: opened[name].values for name in (*table.axes, *table.descriptors)}
        converged = opened["converged"].values.astype(bool) if "converged" in opened else np.ones(1, bool)
        self._converged = None if converged.all() else converged
        self._keys = [str(key) for key in opened["key"].values]
        self._units = {name: str(opened[name].attrs.get("units", "")) for name in table.descriptors}
        self._units |= dict.fromkeys(FIELDS, QUANTITIES["displacement"].units)
        power = opened["degree_power"].values if "degree_power" in opened else None
        found = generation.left_out(opened)
        self._descriptors = tuple(table.descriptors)
        shape = (len(self._keys), len(table.stages))
        self._numbers = np.array([columns[name] for name in table.descriptors], float).reshape(-1, *shape)
        values = np.stack([columns[name] for name in table.axes], axis=-1) if table.axes else None
        self._samples = None if values is None else Samples(values)
        products = opened["band_products"].values if "band_products" in opened else None
        self._blender = Blender(self._spectra, self._samples, power, products)
        self._below = None if power is None else _up_to(power)
        self._trust = None
        if found is not None and self._samples is not None:
            self._trust = trust.Trust(*found, self._samples, generation.skipped(opened))
        self._judged = None if self._trust is None else self._trust.method
        stored = {stage: j for j, stage in enumerate(table.stages)}
        self._knots = sorted({0.0, *stored})
        self._stored = [stored.get(knot, _FRESH) for knot in self._knots]
        self._surface = surface if surface and set(surface.fields) <= set(table.template) else None
        named = self._surface.fields if self._surface else ()
        self._fresh_template = {name: table.template[name] for name in named}
        self._fresh_places = {name: place for name, place in table.places.items() if place[0] in named}

    @classmethod
    def open(
        cls,
        path_or_store: Path | str | Store,
        name: str = "default",
        verify: bool = True,
        surfaces: Callable[[str], Surface | None] = lambda solver: None,
        before_folds: Callable[[], None] = lambda: None,
    ) -> Self:
        """Open the current generation of a table; `verify` reads all of it once and finds any changed byte.

        `surfaces` knows the fresh surfaces by solver, as `solver.registry.surface` does: without, a table gives
        displacements and no positions. `before_folds` is called before a shape that folds is put out of contact with
        itself, which takes longer than the look-up, and seconds where the code for it has to be compiled.

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
                return cls(table, path, surfaces(table.solver), before_folds)
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
        method: str = methods.DEFAULT,
        m: int = 6,
        eta: float = 2.0,
        max_error: float | Mapping[str, float] | None = None,
        window: Window = WHOLE,
        apart: bool = True,
    ) -> Shape:
        """Return the shape at parameters and a stage, on the lattice of `resolution` (None: the table's own).

        `fields` are position and/or displacement; nothing else is computed. `window` limits them to a part of the
        lattice and to some components. `method` is named as in `store.blending.methods`; in `idw`, and where samples
        form no grid, the `m` nearest take part, with weights distance^-eta. `max_error` limits the expected error, of
        the roughness or by measure. What folds is put `apart` where fresh shapes are known; without, it is the blend.

        Raises:
            OutsideTable: the table does not reach there, or does not hold that, or has no such method.
            TooUncertain: the expected error is above `max_error`, or the table does not know it.
            InvalidGeometry: no shape has these parameters, though each lies within the table's bounds.

        """
        values, s = asking.settle(self.info, query), asking.settle_stage(self.info, stage)
        n = self.resolution if resolution is None else resolution
        _check(fields, n, m, eta)
        how, patch = methods.parse(method), window.on(n)
        point, stages = None if self._samples is None else np.array(list(values.values())), self._bracket(s)
        near = self._near(point, how, m, eta)
        mixed = self._blender.mix(point, near, tuple(_stored(stages)), how)
        inside = self._samples is None or point is None or near.nearest == 0 or self._samples.contains(point)
        expected = self._expect(near, stages, how)
        trust.refuse(expected, max_error, inside, self._judged, self._beside(stages) if self._knows(how) else ())
        exact = s == 0 or (near.nearest == 0.0 and len(stages) == 1)
        found, crossings = self._fields(fields, patch, values, self._blend(point, mixed, stages, how, n), exact, apart)
        return Shape(
            colatitude=_angles(n)[0][patch.rows],
            azimuth=_angles(n)[1][patch.columns],
            position=found[0],
            displacement=found[1],
            poles=found[2],
            stage=s,
            parameters=self.info.complete(values),
            descriptors=self._describe(near, stages),
            weights=self._weights(near, mixed, stages),
            nearest=near.nearest,
            inside=inside,
            exact=exact,
            crossings=crossings,
            converged=self._has_converged(near, stages),
            expected_error=expected,
            held=self._held(near, stages, n),
            method=str(how),
            table=self.digest,
            units={name: self._units[name] for name in (*fields, *self.info.descriptors)},
        )

    def _fields(
        self,
        fields: Sequence[str],
        patch: Patch,
        values: Mapping[str, float],
        blend: Callable[[], Blend],
        exact: bool,
        apart: bool,
    ) -> tuple[_Fields, int | None]:
        """Return what is asked for, out of contact with itself, and the pairs of triangles that cross nevertheless.

        A stored result stays as it is unless it crosses on this lattice, coarser than the run's or finer. None: nobody
        looked, or at a part alone.
        """
        if not fields:
            return (None, None, None), None
        waves, displaced, placed = blend(), "displacement" in fields, "position" in fields
        if not (apart and (placed or self._surface)):
            return _synthesize(waves, patch, self.fresh(values) if placed else None, displaced), None
        fresh = self.fresh(values)
        start = fresh if placed else None
        kept: dict[int, tuple[Array, Array]] = {}

        def whole(n: int) -> tuple[Array, Array]:
            if n not in kept:
                position, _, poles = _synthesize(waves, WHOLE.on(n), fresh, False)
                assert position is not None
                assert poles is not None
                kept[n] = position, poles
            return kept[n]

        is_all = patch == WHOLE.on(patch.n)
        if not is_all and not even_out(whole, min(patch.n, COARSE), exact, self._before_folds).near:
            # what does not touch as a whole does not in part: only that is computed
            return _synthesize(waves, patch, start, displaced), None
        moved = even_out(whole, patch.n, exact, self._before_folds)
        if is_all and not displaced:
            position, poles = kept[patch.n]
            found: _Fields = position, None, poles
        else:
            found = _synthesize(waves, patch, start, displaced)
        return _shifted(found, moved, patch), moved.crossings if is_all else None

    def sample(self, i: int) -> dict[str, float]:
        """Return the varying parameters of a sample."""
        values = [] if self._samples is None else self._samples.values[i].tolist()
        return dict(zip(self.info.axes, values, strict=True))

    def left_out(self, i: int, stage: float, method: str = methods.DEFAULT, resolution: int | None = None) -> Array:
        """Return the displacement (n, 2n, 3) that the other samples predict for sample `i` at a stored stage.

        Raises:
            OutsideTable: the stage is not stored, there are no other samples, or there is no such method.

        """
        how = methods.parse(method)
        if self._samples is None or stage not in self.stages:
            raise OutsideTable("nothing can be left out there.", "Name a stored stage of a table with several samples.")
        others, j = self._samples.without(i, how.weighting), self.stages.index(stage)
        point = self._samples.values[i]
        blend = self._blender(point, self._blender.mix(point, others, (j,), how, i), {j: 1.0}, how)
        found = _synthesize(blend, WHOLE.on(resolution or self.resolution), None, True)[1]
        assert found is not None
        return found

    @cached_property
    def neighbour_correlation(self) -> dict[float, float]:
        """Mean correlation of the radial wrinkles of neighbouring samples by stage: what blending can rely on.

        Read from the spectra when first asked for. Empty for a single sample.
        """
        if self._samples is None:
            return {}
        shapes = [self.fresh(self.sample(i)) for i in range(self.size)]
        return dict(zip(self.stages, trust.correlations(self._spectra, self._samples, shapes).tolist(), strict=True))

    def _near(self, point: Array | None, method: methods.Method, m: int, eta: float) -> Weighted:
        if self._samples is None or point is None:
            return Weighted(np.zeros(1, int), np.ones(1), 0.0)
        return self._samples.weigh(method.weighting, point, m, eta)

    def _expect(self, near: Weighted, stages: Mapping[int, float], method: methods.Method) -> dict[str, float] | None:
        if stages.keys() == {_FRESH} or (near.nearest == 0.0 and len(stages) == 1):
            return dict.fromkeys(Measures._fields, 0.0)
        if self._trust is None or not self._knows(method):
            return None
        return self._trust.expect(near, stages)

    def _beside(self, stages: Mapping[int, float]) -> list[float]:
        """Return the stages on both sides of one between two; none of a stored one."""
        stored = dict(zip(self._stored, self._knots, strict=True))
        return sorted(stored[j] for j in stages) if len(stages) > 1 else []

    def _knows(self, method: methods.Method) -> bool:
        """Return whether the table knows errors of that method."""
        return self._trust is not None and self._trust.knows(str(method))

    def _held(self, near: Weighted, stages: Mapping[int, float], n: int) -> float | None:
        """Return the share of the wrinkles' height (rms) in waves of degrees up to n: a lattice of n holds all of them,
        and of others a part. None where the table has no power by degree.
        """
        stored = _stored(stages)
        if n >= self.resolution or not stored:
            return 1.0
        if self._below is None:
            return None
        places, shares = np.array(list(stored), int), np.array(list(stored.values()), float)
        weights = np.maximum(near.weights, 0)  # those that extrapolate may be negative
        ends = np.array([[[n]], [[-1]]])
        part, whole = (self._below[ends, near.samples[:, None], places] @ shares @ weights).tolist()
        return float(np.sqrt(np.clip(part / whole, 0.0, 1.0))) if whole > _NO_WRINKLES else 1.0

    def _bracket(self, stage: float) -> dict[int, float]:
        """Return the stages around one with their weights: stored ones by their place, and `_FRESH`."""
        after = bisect.bisect_left(self._knots, stage)
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
        stored = _stored(stages).items()
        return [(i, j, w * t) for i, w in zip(near.samples, near.weights, strict=True) for j, t in stored]

    def _blend(
        self, point: Array | None, mixed: Mixture, stages: Mapping[int, float], method: methods.Method, n: int
    ) -> Callable[[], Blend]:
        # waves that the lattice cannot hold are not even read
        band = min(self.resolution, n)
        return lambda: self._blender(point, mixed, _stored(stages), method, band)

    def _weights(self, near: Weighted, mixed: Mixture, stages: Mapping[int, float]) -> dict[str, float]:
        """Return what each result counts: over both stages, where it does not count the same at both."""
        shares = np.array(list(_stored(stages).values()))
        samples, weights = near.samples, near.weights
        if len(shares):
            samples, weights = mixed.samples, mixed.weights @ (shares / shares.sum())
        return {self._keys[i]: float(w) for i, w in zip(samples, weights, strict=True)}

    def _describe(self, near: Weighted, stages: Mapping[int, float]) -> dict[str, float]:
        stored = _stored(stages)
        places, parts = np.array(list(stored), int), np.array(list(stored.values()), float)
        # (name, sample, stage) to (name,)
        found = (self._numbers[:, near.samples][:, :, places] @ parts) @ np.asarray(near.weights, float)
        known = self._descriptors if _FRESH not in stages else _GROWING if stored else _ZERO_AT_FIRST
        told = dict(zip(self._descriptors, found.tolist(), strict=True))
        return {name: told[name] for name in known if name in told}

    def _has_converged(self, near: Weighted, stages: Mapping[int, float]) -> bool:
        if self._converged is None:
            return True
        return all(bool(self._converged[i, j]) for i, j, _ in self._terms(near, stages))

    def at_parameters(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return the solver's parameters of a point on the varying axes."""
        return insert(self.info.template, self.info.places, self.info.complete(values))

    def fresh(self, values: Mapping[str, float]) -> Fresh:
        """Return the fresh shape at a point on the varying axes.

        Raises:
            OutsideTable: nobody said what it is.
            InvalidGeometry: no shape has these parameters.

        """
        if self._surface is None:
            raise OutsideTable(
                f"nobody said what is fresh in a table of {self.info.solver}.",
                "Ask for 'displacement', or open it with surfaces=solver.registry.surface.",
            )
        places = self._fresh_places
        full = self.info.complete(values)
        known = {name: full[name] for name in places if name in full}
        return self._surface.of(insert(self._fresh_template, places, known))


@lru_cache(maxsize=16)
def _angles(n: int) -> tuple[Array, Array]:
    """Return the colatitudes and azimuths of a lattice, read-only."""
    found = colatitudes(n), azimuths(n)
    for angles in found:
        angles.flags.writeable = False
    return found


def _check(fields: Sequence[str], n: int, m: int, eta: float) -> None:
    """Refuse what no table holds."""
    asking.check_names("field", fields, list(FIELDS))
    if not 4 <= n <= 1024:
        raise OutsideTable(f"a resolution of {n} is out of reach.", "Ask for 4 to 1024 colatitudes.")
    if m < 1 or not eta > 0:
        raise OutsideTable(f"m = {m} neighbours with eta = {eta} give no weights.", "Take m >= 1 and eta > 0.")


def _up_to(power: Array) -> Array:
    """Return the power (l, sample, stage) of wrinkles up to each degree l, of that (sample, stage, l) by degree."""
    wrinkles = np.moveaxis(power.astype(float), -1, 0)
    wrinkles[: harmonics.LOWEST] = 0
    found: Array = wrinkles.cumsum(axis=0)
    return found


def _stored(stages: Mapping[int, float]) -> dict[int, float]:
    """Return the stored ones of stages with weights: the fresh shape adds nothing to a displacement."""
    return {j: t for j, t in stages.items() if j != _FRESH}


def _shifted(found: _Fields, moved: Evened, patch: Patch) -> _Fields:
    """Return positions, displacements and poles of a patch moved out of contact."""
    if moved.points is None or moved.poles is None:
        return found
    shift = moved.points[patch.rows][:, patch.columns][..., list(patch.components)]
    position, displacement = (None if one is None else (one + shift).astype(one.dtype) for one in found[:2])
    ends = found[2]
    return (
        position,
        displacement,
        None if ends is None else (ends + moved.poles[:, list(patch.components)]).astype(ends.dtype),
    )


def _synthesize(blend: Blend, patch: Patch, fresh: Fresh | None, displaced: bool) -> _Fields:
    """Return positions and displacements (height, width, c) on a patch, and the two poles of a whole surface: each
    only if wanted.
    """
    if displaced:
        with blend.fields(patch) as planes:
            position = None if fresh is None else surface.add_fresh(fresh, planes, patch)
            displacement = np.stack(list(planes), axis=-1)
    else:
        position, displacement = None if fresh is None else blend.over(fresh, patch), None
    if fresh is None or not patch.is_whole:
        return position, displacement, None
    poles = (fresh.poles() + blend.poles()).astype(blend.waves.real.dtype)
    return position, displacement, poles[:, list(patch.components)]
