"""Jobs as the outside sees them: what is sent to ask for one, and what is said of one."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, model_validator

from solver import registry
from solver.contract import Cost, Need, SolverError
from store.ledger.jobs import Job, State

from ..errors import InvalidQuery, Wrong
from ..problems import URN
from ..views.addresses import link

__all__ = ["ENDED", "Expected", "Failure", "JobList", "JobRequest", "JobView", "remember", "view"]

#: States that a job does not leave by itself.
ENDED: tuple[State, ...] = ("done", "failed", "cancelled")


#: Values of one parameter that lists and events still show.
_LONG = 2000
#: What is known of jobs before they run, by their keys, which say all that it hangs on; and of how many.
_KNOWN: dict[str, Beforehand] = {}
_MANY = 2000
#: What lists show of jobs with parameters that are too long for them, by their keys, those asked for last at the end;
#: and of how many: more than a page has, or the first of it would be forgotten before it is asked for again.
_SHORT: OrderedDict[str, Shortened] = OrderedDict()
_FEW = 500
_GUARD = threading.Lock()


class JobRequest(BaseModel):
    """What to compute: a solver, its parameters (over those of a preset), and what of the result is needed."""

    model_config = ConfigDict(extra="forbid")

    solver: str = Field(description="Name of a solver; GET /v1/solvers lists them")
    preset: str | None = Field(None, description="Named parameters to start from; GET /v1/solvers/{name} lists them")
    params: dict[str, Any] = Field(default_factory=dict, description="Parameters, and scalar axes as they are queried")
    need: Need = Field(default_factory=Need, description="What is needed; nothing else is computed")
    again: bool = Field(False, description="Try once more what was given up")

    @model_validator(mode="before")
    @classmethod
    def _in_place(cls, body: Any) -> Any:
        """Say of what belongs one level deeper where that is."""
        if not isinstance(body, dict):
            return body
        name = body.get("solver")
        known = registry.get(name) if isinstance(name, str) and name in registry.names() else None
        wrong = []
        for key in body.keys() - cls.model_fields.keys():
            if key in Need.model_fields:
                home = "need"
            elif known is not None and (key in known.params.model_fields or key in known.params.axes):
                home = "params"
            else:
                continue
            wrong.append(Wrong(key, f"belongs into {home}", f'Write {{"{home}": {{"{key}": ...}}}}.'))
        if wrong:
            raise InvalidQuery.of(sorted(wrong))
        return body


class Progress(BaseModel):
    """How far a job is."""

    fraction: float = Field(ge=0, le=1, description="0 to 1")
    message: str = Field("", description="What the solver says it does, where it says anything")


class Expected(BaseModel):
    """What a run is expected to take on this machine."""

    seconds: float = Field(description="Wall time [s]")
    bytes: int = Field(description="Memory [bytes]")


class Failure(BaseModel):
    """Why a job was given up, in the words of a problem (RFC 9457)."""

    type: str = Field(description="What kind of problem this is", examples=[f"{URN}not-converged"])
    title: str = Field(description="The kind in words")
    detail: str = Field(description="What happened")
    advice: str = Field("", description="What to change")
    last_stage: float | None = Field(None, description="Last stage that converged, if any")


class JobView(BaseModel):
    """A job. Its id is the hash of what it computes: the same question is the same job, whoever asks."""

    id: str = Field(description="64 hexadecimal digits")
    solver: str = Field(description="Name of the solver")
    version: str = Field(description="The solver's version")
    state: State = Field(description="wanted: it waits; running; done; failed: given up; cancelled")
    progress: Progress
    seconds: float | None = Field(None, description="Wall time of the finished run [s]")
    expected: Expected | None = Field(None, description="What the run is expected to take, where it can be said")
    attempts: int = Field(description="How often it was begun")
    created: str = Field(description="When it was first asked for (UTC)")
    updated: str = Field(description="When it last changed (UTC)")
    params: dict[str, Any] = Field(description="All parameters but those of `omitted`")
    omitted: list[str] = Field(
        default_factory=list,
        description="Parameters too long for lists, events and what DELETE answers, as meshes: the job has them",
    )
    need: dict[str, Any] = Field(description="All that is needed")
    note: str = Field("", description="What is worth knowing of its run beforehand; lists leave it out")
    problem: Failure | None = Field(None, description="Why it failed, or why its last attempt did")
    links: dict[str, str] = Field(description="Addresses of the job, its events, and its result once it is done")


class JobList(BaseModel):
    """A page of jobs, newest first."""

    jobs: list[JobView]
    next: str | None = Field(None, description="Address of the next page, if there is one")


def view(job: Job, whole: bool = True, noted: bool = False) -> JobView:
    """Return what is said of a job, without its note and its longest parameters unless the whole is asked for.

    noted: with its note, where that is known already.
    """
    before, shown = _beforehand(job, whole), _shortened(job)
    own = link(f"/v1/jobs/{job.key}")
    links = {"self": own, "events": f"{own}/events"}
    if job.state == "done":
        links["result"] = f"{own}/result"
    return JobView(
        id=job.key,
        solver=job.solver,
        version=job.version,
        state=job.state,
        progress=Progress(fraction=job.progress, message=job.message if job.state == "running" else ""),
        seconds=job.seconds if job.state == "done" else None,
        expected=before.expected,
        attempts=job.attempts,
        created=_date(job.created),
        updated=_date(job.updated),
        params=dict(job.params) if whole else shown.params,
        omitted=[] if whole else shown.omitted,
        need=dict(job.need),
        note=(before.note or "") if whole or noted else "",
        problem=_failure(job.error),
        links=links,
    )


class Shortened(NamedTuple):
    """A job's parameters but those that are too long for lists, and the names of these."""

    params: dict[str, Any]
    omitted: list[str]


def _shortened(job: Job) -> Shortened:
    """Return what lists show of a job's parameters; a mesh is read once for it, and not at every look at the job."""
    with _GUARD:
        known = _SHORT.get(job.key)
        if known is not None:
            _SHORT.move_to_end(job.key)
            return known
    omitted = [name for name, value in job.params.items() if _size(value, _LONG) > _LONG]
    found = Shortened({name: value for name, value in job.params.items() if name not in omitted}, omitted)
    if omitted:
        with _GUARD:
            _SHORT[job.key] = found
            while len(_SHORT) > _FEW:
                _SHORT.popitem(last=False)
    return found


def _size(value: object, enough: int) -> int:
    """Return how many values a value has, or any number above `enough`."""
    if not isinstance(value, list | tuple | Mapping):
        return 1
    count = 0
    for each in value.values() if isinstance(value, Mapping) else value:
        count += _size(each, enough)
        if count > enough:
            break
    return count


def _failure(error: Mapping[str, Any] | None) -> Failure | None:
    """Return a ledger's error; what the log should know alone (a traceback) stays inside."""
    if error is None:
        return None
    code = str(error.get("code", "internal-error"))
    return Failure(
        type=URN + code,
        title=code.replace("-", " ").capitalize(),
        detail=str(error.get("message", "")),
        advice=str(error.get("advice", "")),
        last_stage=error.get("last_stage"),
    )


class Beforehand(NamedTuple):
    """What can be said of a run before it begins: what it is expected to take, and what its solver remarks.

    note: None where nobody has asked; to tell takes a tenth of a second.
    """

    expected: Expected | None
    note: str | None


def remember(key: str, cost: Cost, note: str | None) -> Beforehand:
    """Keep what was found out of a job, and return it."""
    if len(_KNOWN) >= _MANY:
        _KNOWN.clear()
    found = _KNOWN[key] = Beforehand(Expected(seconds=cost.seconds, bytes=cost.bytes), note)
    return found


def _beforehand(job: Job, whole: bool) -> Beforehand:
    """Return what can be said of a job; nothing of one whose solver is gone or has changed since.

    Of one that was cancelled, which will take nothing, only the whole has what nobody knows yet: to find it out can
    take longer than to stop it, and whoever cancelled it waits.
    """
    known = _KNOWN.get(job.key)
    if known is not None and (known.note is not None or not whole):
        return known
    if job.state == "cancelled" and not whole:
        return Beforehand(None, None)
    try:
        found = registry.get(job.solver)
        if found.version != job.version:
            return Beforehand(None, "")
        params, need = found.params.model_validate(dict(job.params)), Need.model_validate(dict(job.need))
        cost = found.cost(params, need)
    except (SolverError, ValueError):
        return Beforehand(None, "")
    note: str | None = None
    if whole:
        try:
            note = "" if found.remarks is None else found.remarks(params, need)
        except SolverError:  # the run says so itself
            note = ""
    return remember(job.key, cost, note)


def _date(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
