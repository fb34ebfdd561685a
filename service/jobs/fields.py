"""Fields of a result as JSON: for whoever wants a few numbers and no library for netCDF."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from store.store import Store

from .. import problems, vocabulary
from ..errors import InvalidQuery, Wrong
from ..settings import Settings
from ..views.shape import FieldsPage
from .routes import JobId, check_done, stored_job

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["encode", "router"]

router = APIRouter(tags=["jobs"])


@router.get(
    "/v1/jobs/{id}/fields",
    summary="Numbers of a job's result",
    response_model=FieldsPage,
    responses=problems.responses(404, 409, 422, 503),
)
def fields(
    request: Request,
    id: JobId,
    names: Annotated[
        str | None,
        Query(
            min_length=1,
            max_length=1000,
            description="Fields by name, commas between them; left out, those of one number per stage",
        ),
    ] = None,
    stage: Annotated[float | None, Query(allow_inf_nan=False, description="Which stage; left out, all")] = None,
) -> Response:
    """Fetch named fields of what a job computed, as JSON with units."""
    job = stored_job(request, id)
    check_done(job)
    store: Store = request.app.state.tables.store
    settings: Settings = request.app.state.settings
    body = encode(store.get(job.key), names, stage, settings.max_export_samples, called="names")
    return Response(body, media_type="application/json")


def encode(run: xr.Dataset, names: str | None, stage: float | None, most: int, called: str = "fields") -> bytes:
    """Return fields by name (with commas between; None: those of one number per stage), at one stage or at all.

    Each has `dims`, `shape`, `units`, `long_name` and `values`, nested lists; coordinates are fields too. `called`
    is what the asker's parameter of the names is called.

    Raises:
        InvalidQuery: no such field or stage, or more than `most` numbers.

    """
    known = sorted(str(name) for name in run.variables)
    asked = [name for name in known if run[name].dims == ("stage",)] if names is None else names.split(",")
    unknown = [name for name in asked if name not in known]
    if unknown:
        wrong = [Wrong(called, f"the result has no {name[:40]!r}", f"Known: {', '.join(known)}.") for name in unknown]
        raise InvalidQuery.of(wrong)
    if stage is not None:
        near = vocabulary.row_of(run["stage"].values.tolist(), stage)
        # the vertices and faces of a mesh that changes its triangles lie end to end
        for dim in ("vertex", "face"):
            if f"{dim}_count" in run:
                ends = run[f"{dim}_count"].values.cumsum()
                run = run.isel({dim: slice(ends[near] - run[f"{dim}_count"].values[near], ends[near])})
        run = run.isel(stage=[near])
    count = sum(run[name].size for name in asked)
    if count > most:
        advice = "Ask for fewer fields or one stage, or take the netCDF."
        raise InvalidQuery.of([Wrong(called, f"{count} numbers are more than {most}", advice)])
    body = {
        "solver": run.attrs["solver"],
        "solver_version": run.attrs["solver_version"],
        "params": json.loads(run.attrs["params"]),
        "need": json.loads(run.attrs["need"]),
        "known": known,
        "fields": {name: _field(run[name]) for name in dict.fromkeys(asked)},
    }
    return json.dumps(body, separators=(",", ":"), allow_nan=False).encode()


def _field(found: xr.DataArray) -> dict[str, Any]:
    return {
        "dims": [str(dim) for dim in found.dims],
        "shape": list(found.shape),
        "units": str(found.attrs.get("units", "1")),
        "long_name": str(found.attrs.get("long_name", "")),
        "values": found.values.tolist(),
    }
