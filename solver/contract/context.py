"""A run's surroundings: progress, cancellation, randomness, and results of others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from .errors import Cancelled, InvalidInput
from .words import SHORT

if TYPE_CHECKING:
    import xarray as xr

    from .need import Start
    from .params import Params

__all__ = ["Context"]


class Context:
    """Progress, cancellation and randomness of one run. Bars, logs and event streams are observers of it."""

    def __init__(
        self,
        observe: Callable[[float, str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
        library: Callable[[str], xr.Dataset | None] | None = None,
        shapes: Callable[[str, Mapping[str, float], float, int], np.ndarray] | None = None,
        starts: Callable[[Start, Params, float], np.ndarray] | None = None,
    ) -> None:
        self._observe = observe
        self._cancelled = cancelled
        self._library = library
        self._shapes = shapes
        self._starts = starts
        self._fraction = 0.0

    def report(self, fraction: float, message: str = "") -> None:
        """Tell the observer how far the run is, 0 to 1; never goes backwards."""
        self._fraction = max(self._fraction, min(1.0, float(fraction)))
        if self._observe is not None:
            self._observe(self._fraction, message)

    def check_cancelled(self) -> None:
        """Raise `Cancelled` if the observer asked to stop. Solvers call this at least twice a second.

        Raises:
            Cancelled: always with no partial result; the solver attaches what it has.

        """
        if self._cancelled is not None and self._cancelled():
            raise Cancelled("the run was cancelled.")

    def shape(self, solver: str, point: Mapping[str, float], stage: float, resolution: int) -> np.ndarray:
        """Return the displacement (n, 2 n, 3) of another solver's shape, for runs that want that and no more.

        point: by the names of that solver's axes. stage: on its stage axis. Lengths are in its unit.

        Raises:
            InvalidInput: nobody here knows shapes of that solver, or none at this point.

        """
        if self._shapes is None:
            raise InvalidInput(
                f"the shape comes from a table of {solver}, and there is none here.",
                advice="Run it by `wizen solve`, by a sweep or as a job, or give Context(shapes=sweeps.tabled.shape).",
            )
        return self._shapes(solver, point, stage, resolution)

    def start(self, start: Start, params: Params, stage: float) -> np.ndarray:
        """Return the position (n, 2 n, 3) of the looked-up shape that a run of `params` is to relax.

        Raises:
            InvalidInput: there are no tables here, no such one, or it does not hold that shape.

        """
        if self._starts is None:
            raise InvalidInput(
                f"the run starts from a shape of the table {start.table!r}, and there is none here.",
                advice="Run it as a job, or relax the shape by `wizen query --relax`.",
            )
        return self._starts(start, params, stage)

    def result(self, key: str) -> xr.Dataset:
        """Return an earlier result by its key, for runs that start from one.

        Raises:
            InvalidInput: there is none, or this run is not tied to a store.

        """
        if self._library is None:
            raise InvalidInput(
                f"the run starts from the stored result {SHORT.repr(key)}, and there is no store here.",
                advice="Run it by a sweep or as a job, beside that result.",
            )
        found = self._library(key)
        if found is None:
            raise InvalidInput(
                f"the run starts from the stored result {SHORT.repr(key)}, which is not in the store.",
                advice="Run that one first.",
            )
        return found

    @staticmethod
    def generator(seed: int) -> np.random.Generator:
        """Return the only source of randomness a solver may use."""
        return np.random.default_rng(seed)
