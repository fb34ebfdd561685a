"""From weights to a surface: the weighted mean of spectra, corrected, and its way back to the lattice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from solver.arrays import Array
from solver.contract import Fresh

from ..surfaces import alone, harmonics, surface, window
from ..surfaces.packed import Stored
from ..surfaces.window import Patch
from . import methods
from .methods import Method, bands, envelope, poles
from .methods.cells import Cells
from .methods.products import Products
from .methods.thin import Mixture, Thin, outer
from .methods.weights import Samples
from .neighbours import Weighted
from .stacks import Stacks

__all__ = ["Blend", "Blender", "complex_view", "powers"]


#: What the harmonics of order 0, which alone reach the poles, are there: sqrt(2 l + 1), and (-1)^l times that.
_AT_POLES = np.array([[np.sqrt(2 * d + 1), (-1) ** d * np.sqrt(2 * d + 1)] for d in range(harmonics.LOWEST)])


class Blend(NamedTuple):
    """Waves (3, m, k) of the displacement; with a `ratio` (`methods.envelope`), of its wrinkles alone, which are to be
    multiplied by it on the lattice before the shape `low` of the fruit is added.
    """

    waves: Array
    ratio: Array | None = None
    low: Array | None = None

    @contextmanager
    def fields(self, patch: Patch) -> Iterator[Array]:
        """Lend the displacement (components, height, width) on a patch of the lattice; good until left."""
        with window.planes(self.waves, patch) as planes:
            if self.ratio is not None and self.low is not None:
                envelope.apply(planes, self.ratio, self.low, patch)
            yield planes

    def over(self, fresh: Fresh, patch: Patch) -> Array:
        """Return the fresh surface with the displacement, (height, width, components), on a patch."""
        with window.planes(self.waves, patch) as planes:
            if self.ratio is not None and self.low is not None:
                if patch.is_whole and patch.components == (0, 1, 2):
                    return surface.lift(fresh, planes, *envelope.on(self.ratio, self.low, patch, planes.dtype))
                envelope.apply(planes, self.ratio, self.low, patch)
            return surface.add_fresh(fresh, planes, patch)

    def poles(self) -> Array:
        """Return the displacement (2, 3) of the two poles."""
        # only waves m = 0 reach them
        ends = (self.waves[:, 0].real @ _signs(self.waves.shape[-1], self.waves.real.dtype.str)).T
        if self.ratio is None or self.low is None:
            return ends
        shape = self.low[:, 0].real @ _AT_POLES
        found: Array = ends * envelope.at_poles(self.ratio)[:, None] + shape.T
        return found


class Blender:
    """Blends the spectra (sample, stage, component, m, k, part) of a table.

    `power` (sample, stage, l) by degree and `products` (`methods.products.all_of`) are read from the spectra where a
    table does not say.
    """

    def __init__(
        self, stored: Stored, samples: Samples | None, power: Array | None = None, products: Array | None = None
    ) -> None:
        self._stored = stored
        self._samples = samples
        self._given = power
        self._products = Products(stored, bands.Bands(stored.shape[-2] - 1), products)
        self._stacks = Stacks(stored)

    def mix(
        self, query: Array | None, near: Weighted, stages: Sequence[int], method: Method, without: int | None = None
    ) -> Mixture:
        """Return what each sample near a point counts at stored stages; `without` one, as if it were not there."""
        if method.weighting not in methods.SPLINED or query is None or self._samples is None:
            return outer(near, len(stages))
        lean = method.weighting == "lean"
        return self._thin.mix(near, self._samples.scale(query), stages, without, lean)

    def __call__(
        self, query: Array | None, mixed: Mixture, stages: Mapping[int, float], method: Method, band: int | None = None
    ) -> Blend:
        """Blend samples at stored stages (place -> weight; what is missing to 1 is the fresh shape's).

        `query` is the point that the corrections aim at. Waves beyond `band` are left out.
        """
        chosen, places, shares = tuple(mixed.samples.tolist()), tuple(stages), np.array(list(stages.values()))
        parts = (mixed.weights * shares).ravel()
        most = self._stored.shape[-2] - 1
        waves = complex_view(self._stacks.mean(chosen, places, parts, most if band is None else min(band, most)))
        if len(parts) <= 1 or not method.corrections or query is None:
            # one sample at one stage, or on its way there from the fresh shape: nothing was lost
            return Blend(waves)
        targets, cells, known = self._tools
        cell = cells.of(chosen, places)
        total = None
        if "LL" in method.corrections:
            mean = _form(parts, cell.power)
            lossy = float(mixed.lossy @ shares) / float(shares.sum())
            whole = targets.gains(known.scale(query), mixed.samples, mixed.weights, dict(stages), mean)
            gains = whole if lossy == 1 else whole**lossy * bands.regained(parts, cell.power, mean) ** (1 - lossy)
            if (gains != 1).any():  # else a sixth of the time is for nothing
                factor = bands.multiplier(gains, targets.bands, waves.shape[-1] - 1)
                poles.multiply(waves, factor, targets.highest)
            found, wanted = float(gains**2 @ mean), float(whole**2 @ mean)
            total = envelope.Total(found, wanted)
        if "env" not in method.corrections:
            return Blend(waves)
        ratio = envelope.factor(_form(parts, cell.local), alone.total(parts, cell.amplitude), total)
        flat = cell.low.view(float).reshape(len(parts), -1)
        low = alone.total(parts, flat).view(complex).reshape(cell.low.shape[1:])
        envelope.take_low(waves, low)
        return Blend(waves, ratio, low)

    @property
    def power(self) -> Array:
        """Power by degree (sample, stage, l) of the displacement's three components together."""
        return self._given if self._given is not None else powers(self._stored)

    @cached_property
    def _thin(self) -> Thin:
        assert self._samples is not None
        return Thin(self._products, self._samples)

    @cached_property
    def _tools(self) -> tuple[bands.Targets, Cells, Samples]:
        assert self._samples is not None
        targets = bands.Targets(self.power, self._samples)
        return targets, Cells(self._stored, self._products), self._samples


@lru_cache(maxsize=16)
def _signs(waves: int, dtype: str) -> Array:
    """Return what cosines k < `waves` are at the two poles, (k, 2)."""
    k = np.arange(waves)
    return np.stack([np.ones(waves), (-1.0) ** k], axis=1).astype(dtype)


def complex_view(parts: Array) -> Array:
    """Return contiguous (..., part) as complex (...)."""
    return parts.view(np.result_type(parts.dtype, np.complex64))[..., 0]


def powers(stored: Stored) -> Array:
    """Return the power by degree (sample, stage, l) of spectra (sample, stage, component, m, k, part)."""
    return np.array(
        [[harmonics.power(harmonics.degrees(complex_view(stage))).sum(axis=0) for stage in sample] for sample in stored]
    )


def _form(parts: Array, products: Array) -> Array:
    """Return the quadratic form (...) of terms (T,) and their products (T, T, ...)."""
    count, parts = len(parts), parts.astype(products.dtype)
    return alone.total(parts, alone.total(parts, products.reshape(count, -1)).reshape(count, -1)).reshape(
        products.shape[2:]
    )
