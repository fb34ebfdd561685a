"""One run of the stress matrix, judged: what it ended in, and whether that is a promise broken.

The run is `SOLVER.solve` itself; only the mesh is made tiny, and the path is watched so that the elements of every
stored stage can be looked at. Floating-point errors and warnings raise, as in the tests.
"""

from __future__ import annotations

import dataclasses
import time
import traceback
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import xarray as xr

from solver.contract import Cancelled, Context, InvalidInput, Need, SolverError
from solver.dehydration import SOLVER
from solver.dehydration import run as run_module
from solver.dehydration.kernel import element_report
from solver.dehydration.params import DehydrationParams
from solver.dehydration.path import Path, State
from solver.dehydration.settings import Settings, choose

__all__ = ["GOOD", "Case", "Row", "judge"]

#: Outcomes that keep every promise; all others break one.
GOOD = ("converged", "unconverged, said", "refused", "unstable", "not converged", "cancelled as asked")


@dataclasses.dataclass(frozen=True)
class Case:
    """One question to the solver.

    values: raw parameters, as JSON would give them. n: elements per edge of the cubed sphere. pace: factor on the
    shrinkage per step. kappa_ratio, damping: replace the quality's. refuse: word that the refusal must contain, None
    if the run need not be refused. need: what else is asked for. limit: seconds after which the observer cancels; a
    run cancelled so is late, unless that is what `cancel` is there to see.
    """

    group: str
    what: str
    values: Any = dataclasses.field(default_factory=dict)
    preset: str | None = None
    stages: tuple[Any, ...] = (0.1, 0.3)
    n: int = 8
    pace: float = 1.0
    kappa_ratio: float | None = None
    damping: float | None = None
    refuse: str | None = None
    need: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    limit: float = 60.0
    cancel: bool = False
    quick: bool = False


@dataclasses.dataclass
class Row:
    """What a case ended in. residual, penetration [te]: the worst over stages; least: least J / Jd of all elements."""

    group: str
    what: str
    n: int
    outcome: str
    detail: str = ""
    last: float | None = None
    residual: float | None = None
    penetration: float | None = None
    least: float | None = None
    converged: list[int] = dataclasses.field(default_factory=list)
    ratios: list[float] = dataclasses.field(default_factory=list)
    seconds: float = 0.0

    @property
    def good(self) -> bool:
        """Whether every promise was kept."""
        return self.outcome in GOOD


class _Watched(Path):
    """A path that notes the least J / Jd of each stage that was asked for."""

    made: _Watched | None = None

    def __init__(self, *asked: Any, **named: Any) -> None:
        super().__init__(*asked, **named)
        self.settled: list[tuple[float, float]] = []
        self._ratio = 1.0
        _Watched.made = self

    def stage(self, shrinkage: float, last: float) -> State:
        found = super().stage(shrinkage, last)
        self.settled.append((shrinkage, self._ratio))
        return found

    def _settle(self, state: Any, *rest: Any, **named: Any) -> State:
        found = super()._settle(state, *rest, **named)
        layout = self.motion.drive.loaded(self.motion.layout, found.shrinkage)
        self._ratio = float(element_report(layout, state, 1 - found.shrinkage).least_ratio.min())
        return found


@contextmanager
def _tiny(case: Case) -> Iterator[None]:
    """Let runs take the case's mesh and be watched."""

    def chosen(params: DehydrationParams, quality: str, last: float) -> Settings:
        usual = choose(params, quality, last)
        # coarser elements have a longer critical step: what is kept is shrinkage and decay per unit of time
        finer = usual.n / case.n
        changed: dict[str, Any] = {name: getattr(usual, name) * finer for name in ("pace", "damping", "swing_damping")}
        changed |= {name: max(1, round(getattr(usual, name) / finer)) for name in ("swing_steps", "settle_steps")}
        changed["pace"] *= case.pace
        if case.damping is not None:
            changed["damping"] = case.damping
        return dataclasses.replace(usual, n=case.n, kappa_ratio=case.kappa_ratio or usual.kappa_ratio, **changed)

    places: dict[str, Any] = {"choose": chosen, "Path": _Watched}
    before = {name: getattr(run_module, name) for name in places}
    _Watched.made = None
    try:
        for name, value in places.items():
            setattr(run_module, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(run_module, name, value)


def judge(case: Case) -> Row:
    """Return what the case ended in; raises nothing."""
    row = Row(case.group, case.what, case.n, "")
    begun = time.monotonic()
    cpu = time.process_time()
    # of wall and processor time the lesser: other work on the machine makes no run late, nor does a second thread
    context = Context(cancelled=lambda: min(time.monotonic() - begun, time.process_time() - cpu) > case.limit)
    asked = {"quality": "preview", "stages": case.stages, "resolution": 12, **case.need}
    with warnings.catch_warnings(), np.errstate(divide="raise", over="raise", invalid="raise"), _tiny(case):
        warnings.simplefilter("error")
        try:
            params = SOLVER.parse(case.values, case.preset)
            result = SOLVER.solve(params, Need.parse(asked), context)
            row.outcome, row.detail = _of_result(case, row, result)
        except SolverError as error:
            row.outcome, row.detail = _of_error(case, row, error)
        except Exception as error:
            row.outcome, row.detail = "untyped", "".join(traceback.format_exception(error)[-3:])
    row.seconds = time.monotonic() - begun
    return row


def _of_result(case: Case, row: Row, result: xr.Dataset) -> tuple[str, str]:
    if case.refuse is not None:
        return "not refused", "it ran"
    complaint = _complaint(row, result, tuple(sorted({float(s) for s in case.stages})))
    if complaint:
        return complaint
    return ("converged" if all(row.converged) else "unconverged, said"), ""


def _of_error(case: Case, row: Row, error: SolverError) -> tuple[str, str]:
    said = f"{type(error).__name__}: {error}"
    settled = _Watched.made.settled if _Watched.made is not None else []
    if isinstance(error, InvalidInput):
        if case.refuse is not None and case.refuse not in str(error):
            return "refused without advice", said
        if len(said) > 2000:
            return "endless message", said[:200]
        return "refused", said
    if case.refuse is not None:
        return "not refused", said
    if "not finite" in error.message:
        return "not finite", said
    stages = tuple(stage for stage, _ in settled)
    if stages:
        if error.partial is None or error.last_stage != stages[-1]:
            return "lost stages", f"{stages} settled, last_stage = {error.last_stage}: {said}"
        complaint = _complaint(row, error.partial, stages)
        if complaint:
            return complaint
    if isinstance(error, Cancelled):
        return ("cancelled as asked" if case.cancel else "late"), said
    if not error.advice:
        return "no advice", said
    return ("unstable" if error.code == "unstable" else "not converged"), said


def _complaint(row: Row, data: xr.Dataset, stages: tuple[float, ...]) -> tuple[str, str] | None:
    """Fill in the row from the stages that were handed over, and return what is wrong with them."""
    assert _Watched.made is not None
    found = tuple(data["stage"].values.tolist())
    row.ratios = [ratio for _, ratio in _Watched.made.settled]
    row.converged = data["converged"].values.tolist()
    row.last, row.least = found[-1], min(row.ratios)
    row.residual = float(data["residual"].max())
    if "penetration" in data:
        row.penetration = float(data["penetration"].max()) / _Watched.made.motion.params.exocarp_thickness
    for name, variable in data.variables.items():
        if variable.dtype.kind == "f" and not np.isfinite(variable.values).all():
            return "not finite", str(name)
    if found != stages:
        return "lost stages", f"{found} instead of {stages}"
    limits = data.attrs["residual_limit"], data.attrs["drift_limit"]
    still = (data["residual"] <= limits[0]) & (data["drift"] <= limits[1])
    if not np.array_equal(still.values, data["converged"].values.astype(bool)):
        return "unsaid", f"converged = {row.converged}, residual {data['residual'].values.tolist()}"
    bad = [(s, c) for s, c, ratio in zip(found, row.converged, row.ratios, strict=True) if not ratio > 0]
    if any(converged for _, converged in bad):
        return "inverted", f"at stages {[s for s, _ in bad]}, J/Jd {row.ratios}, converged = {row.converged}"
    if bad:
        return "inverted, unconverged", f"at stages {[s for s, _ in bad]}, J/Jd {row.ratios}"
    return None
