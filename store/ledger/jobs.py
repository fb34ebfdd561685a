"""A job as a value: what is to be computed, and how far that is."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from sqlite3 import Row
from typing import Any, Literal, Self, get_args

from solver.contract import Need, Params, Solver

from .. import keys

__all__ = ["STATES", "Job", "JobSpec", "State", "Written", "read_row"]

State = Literal["wanted", "running", "done", "failed", "cancelled"]

STATES: tuple[State, ...] = get_args(State)


@dataclass(frozen=True)
class JobSpec:
    """What is to be computed: `key` is the hash of the rest (`store.keys.key`)."""

    key: str
    solver: str
    version: str
    params: Mapping[str, Any]
    need: Mapping[str, Any]

    @classmethod
    def of(cls, solver: Solver, params: Params, need: Need) -> Self:
        """Return the job that computes `need` (settled) of `params`; its key is the same whoever asks."""
        return cls(
            key=keys.key(solver.name, solver.version, params, need),
            solver=solver.name,
            version=solver.version,
            params=params.model_dump(mode="json"),
            need=need.model_dump(mode="json"),
        )


@dataclass(frozen=True)
class Job(JobSpec):
    """A job in the ledger. Times are seconds since the epoch; `seconds` is the wall time of a finished run.

    `message` is what its run said last, where it says anything. `lease_until` is a reading of `clock`, which counts
    seconds without a date. `claims` numbers the claims of a job and never goes back, as `attempts` does: with
    `worker`, it tells one claim from every other. `failures` are those attempts that failed, and were not just lost.
    """

    plan: str
    state: State
    attempts: int
    worker: str | None
    lease_until: float | None
    digest: str | None
    error: Mapping[str, Any] | None
    seconds: float | None
    created: float
    updated: float
    progress: float
    claims: int = 0
    clock: str | None = None
    lease: float | None = None
    failures: int = 0
    message: str = ""


class Written(Mapping[str, Any]):
    """The names and values that a JSON text holds, read when somebody wants them.

    A mesh of 100,000 vertices takes a third of a second to read, and whoever asks twice a second how jobs are does not
    look at what they are of.
    """

    __slots__ = ("_text", "_values")

    def __init__(self, text: str) -> None:
        self._text = text
        self._values: dict[str, Any] | None = None

    def _read(self) -> dict[str, Any]:
        if self._values is None:
            self._values = json.loads(self._text)
        return self._values

    def __getitem__(self, name: str) -> Any:
        return self._read()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._read())

    def __len__(self) -> int:
        return len(self._read())

    def __repr__(self) -> str:
        return repr(self._read())

    def __reduce__(self) -> tuple[type[Written], tuple[str]]:
        return Written, (self._text,)


def read_row(row: Row | Mapping[str, Any]) -> Job:
    """Return the job in a row of the ledger's table `jobs`."""
    values = dict(row)
    values["message"] = values.get("message") or ""
    values.update(params=Written(values["params"]), need=json.loads(values["need"]))
    values["error"] = None if values["error"] is None else json.loads(values["error"])
    return Job(**values)
