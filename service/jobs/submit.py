"""Asking for a job: checked by the solver's own model and weighed before anything is queued."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from fastapi import Request
from fastapi.datastructures import State

from solver.contract import InvalidInput, Need, Params, Quality, Solver
from solver.rounding import from_zero, towards_zero
from store.keys import is_key
from store.ledger.asks import Asker, Spending
from store.ledger.jobs import Job, JobSpec
from store.ledger.queue import Queue, Quota
from store.starter import check_own, has
from store.store import Store
from store.tokens import Token

from ..errors import TooCostly
from ..limits.clients import address
from ..settings import Settings
from ..views.addresses import link
from .views import remember

__all__ = ["Submitted", "asker_of", "check_begun", "submit"]


def asker_of(request: Request, token: Token) -> Asker:
    """Return whom a request's jobs are noted for."""
    return Asker(token.id, token.name, address(request.client.host) if request.client else "")


class Submitted(NamedTuple):
    """A job in the queue, and whether it waits now and did not before."""

    job: Job
    new: bool

    @property
    def location(self) -> str:
        """Where the job is asked about."""
        return link(f"/v1/jobs/{self.job.key}")


def submit(
    state: State,
    solver: Solver,
    params: Mapping[str, Any],
    need: Need,
    owner: Asker,
    *,
    preset: str | None = None,
    again: bool = False,
    unlimited: bool = False,
) -> Submitted:
    """Ask for a run in the name of `owner` (checked by the caller); the same question is the same job.

    Args:
        state: the app's state: `settings` and `tables`.
        solver: who computes.
        params: its parameters, over those of `preset`.
        need: what is needed.
        owner: whose quota counts.
        preset: named parameters to start from.
        again: try once more what was given up.
        unlimited: for administrators: no quota, no limit of cost.

    Raises:
        InvalidInput: the solver refuses the parameters or the need, or starts from a result that is not there.
        TooCostly: more than the operator allows.
        QueueFull: too many jobs wait already.
        QuotaSpent: too much time was asked for lately.
        MissingStore, ReadOnlyStore: there is no store that could take it.

    """
    settings: Settings = state.settings
    check_own(settings.store)
    values = solver.parse(params, preset)
    settled = solver.settle(need, preset, (values,))
    if not unlimited:
        _weigh(solver, values, settled, settings)
    store: Store = state.tables.store
    # what the run would refuse at once is refused here, and not as a job that failed
    said = "" if solver.remarks is None else solver.remarks(values, settled)
    spec = JobSpec.of(solver, values, settled)
    spending = Spending(settings.max_seconds_per_token, settings.max_seconds_per_client, 3600 * settings.quota_hours)
    quota = None if unlimited else Quota(settings.max_jobs, settings.max_jobs_per_token, spending)
    cost = solver.cost(values, settled)
    remember(spec.key, cost, said)
    lost = not store.has(spec.key)
    if lost:
        check_begun(store, spec.params)
    # what was given up and is here all the same came from elsewhere: its run finds it
    again = again or not lost
    job, new = Queue(store.ledger).ask(spec, owner, quota, again=again, lost=lost, expected=cost.seconds)
    return Submitted(job, new)


def check_begun(store: Store, params: Mapping[str, Any]) -> None:
    """Refuse a run that starts from a stored result, as from the pattern of another run, which is not here.

    Raises:
        InvalidInput: naming it.

    """
    for name, value in params.items():
        key = value.get("key") if isinstance(value, Mapping) else None
        if isinstance(key, str) and is_key(key) and not (store.has(key) or has(key)):
            raise InvalidInput(
                f"{name}.key: no result is stored under {key}, which the run starts from.",
                advice="Run that one first: GET /v1/results lists what there is.",
            )


def _weigh(solver: Solver, params: Params, need: Need, settings: Settings) -> None:
    """Refuse what is too costly, with what would make it cheaper.

    Raises:
        TooCostly: it is.

    """
    seconds, memory = _cost(solver, params, need)
    if seconds > settings.max_job_seconds:
        what = f"take about {from_zero(seconds)} s, longer than the {settings.max_job_seconds:g} s"
    elif memory > settings.max_job_bytes:
        limit = towards_zero(settings.max_job_bytes / 1e9)
        what = f"need about {from_zero(memory / 1e9)} GB, more than the {limit} GB"
    else:
        return
    raise TooCostly(f"this run would {what} that one job may.", advice=_cheaper(solver, params, need))


def _cost(solver: Solver, params: Params, need: Need) -> tuple[float, float]:
    """Return expected seconds, and the bytes of the memory or of the result, whichever is more."""
    cost = solver.cost(params, need)
    # the contract promises nothing about a result's size: here every field counts as vectors on the surface
    samples = 2 * (need.resolution or 0) ** 2 * 3 * (4 if need.dtype == "float32" else 8)
    return cost.seconds, max(cost.bytes, samples * len(need.fields) * len(need.stages))


def _cheaper(solver: Solver, params: Params, need: Need) -> str:
    """Say which parts of a need cost what."""
    order: list[Quality] = ["preview", "default", "fine"]
    tries = {
        f"quality {quality!r}": need.model_copy(update={"quality": quality})
        for quality in order[: order.index(need.quality)]
    }
    if len(need.stages) > 1:
        first = need.stages[:1]
        tries[f"stage {first[0]:g} alone"] = need.model_copy(update={"stages": first})
    said = [
        f"{name} would take about {from_zero(seconds)} s and {from_zero(memory / 1e9, 2)} GB"
        for name, (seconds, memory) in ((name, _cost(solver, params, other)) for name, other in tries.items())
    ]
    known = f" ({'; '.join(said)})" if said else ""
    return f"Lower the quality, the resolution, or the number and reach of the stages{known}."
