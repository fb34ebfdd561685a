"""`GET /v1/jobs/{id}/result`: the whole run as netCDF, a scene, a cache or a map, or one stage as a shape."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote

import mimeparse
from fastapi import APIRouter, Depends, Query, Request
from starlette.responses import FileResponse, Response

from solver import __version__, registry
from store import seal
from store.errors import CorruptShard, UnknownJob
from store.ledger.jobs import Job
from store.store import Store
from sweeps.pictures import colours

from .. import problems
from ..errors import InvalidQuery, NotAcceptable, Wrong
from ..formats import FORMATS, Format
from ..sequences import EXPORTS, STILLS, Export, Options, prepared, write
from ..settings import Settings
from ..views.shape import FieldsPage, ShapePage
from ..views.tags import matches
from . import choices
from . import fields as jobs_fields
from .routes import JobId, check_done, stored_job
from .staged import NETCDF, begun_from, encode, is_surface

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["router"]

router = APIRouter(tags=["jobs"])

_NAMES = ("netcdf", *FORMATS, *EXPORTS)


#: Vertices that stand for a thread, its head among them.
_CORNERS = 14


def _said(name: str) -> str:
    return str(Options.model_fields[name].description)


_KNOWN: list[Format | Export] = [*FORMATS.values(), *EXPORTS.values()]
_CONTENT = problems.files([NETCDF, *(e.media_type.partition(";")[0] for e in _KNOWN if e.name != "json")])


def _ends(
    low: Annotated[float | None, Query(allow_inf_nan=False, description=_said("low"))] = None,
    high: Annotated[float | None, Query(allow_inf_nan=False, description=_said("high"))] = None,
) -> dict[str, float | None]:
    return {"low": low, "high": high}


def _options(
    colour: Annotated[str | None, Query(max_length=100, description=_said("colour"))] = None,
    scale: Annotated[float | None, Query(gt=0, le=1e6, allow_inf_nan=False, description=_said("scale"))] = None,
    fps: Annotated[float | None, Query(ge=1, le=240, allow_inf_nan=False, description=_said("fps"))] = None,
    step: Annotated[float | None, Query(gt=0, le=1000, allow_inf_nan=False, description=_said("step"))] = None,
    textures: Annotated[int | None, Query(ge=0, le=4096, description=_said("textures"))] = None,
    threads: Annotated[int | None, Query(ge=0, le=200_000, description=_said("threads"))] = None,
    cut: Annotated[str | None, Query(max_length=200, description=_said("cut"))] = None,
    map: Annotated[str | None, Query(max_length=100, description=_said("map"))] = None,
    size: Annotated[int | None, Query(ge=2, le=8192, description=_said("size"))] = None,
    *,
    ends: Annotated[dict[str, float | None], Depends(_ends)],
) -> Options:
    said = dict(locals())
    return Options.parse(said | said.pop("ends"))


@router.get(
    "/v1/jobs/{id}/result",
    summary="A job's result",
    response_class=Response,
    responses={
        200: {"model": FieldsPage | ShapePage, "description": "The result", "content": _CONTENT},
        304: {"description": "The result that the asker has is the one"},
        **problems.responses(404, 406, 409, 422, 501, 503),
    },
)
def result(
    request: Request,
    id: JobId,
    options: Annotated[Options, Depends(_options)],
    stage: Annotated[
        float | None,
        Query(allow_inf_nan=False, description="Which stage; left out, all where a format holds them, else the last"),
    ] = None,
    format: Annotated[
        str | None,
        Query(description="Representation; goes before the Accept header", json_schema_extra={"enum": list(_NAMES)}),
    ] = None,
    fields: Annotated[
        str | None,
        Query(
            min_length=1,
            max_length=1000,
            description="With format=json: fields by name, commas between them, with their numbers. Without it, "
            "results that are no surface on the lattice send those of one number per stage",
        ),
    ] = None,
) -> Response:
    """Fetch what a job computed: the whole run as netCDF-4/HDF5, as a scene, a vertex cache or maps, or one stage.

    netCDF opens with `xarray.open_dataset(path, engine="h5netcdf")` and answers who accepts anything. docs/formats.md
    says which program reads which format, and what each one needs.
    """
    job = stored_job(request, id)
    chosen = _negotiate(request.headers.get("accept"), format)
    name = chosen.name if chosen else "netcdf"
    choices.check(name, options.model_fields_set, stage=stage, fields=fields)
    check_done(job)
    store: Store = request.app.state.tables.store
    settings: Settings = request.app.state.settings
    asked = options.model_dump(exclude_defaults=True)
    table = None if chosen is None else begun_from(job, request.app.state.tables.get)
    tag = _tag(job, name, {"stage": stage, "fields": fields, "from": table and table.info.name, **asked})
    headers = {
        "ETag": tag,
        "Vary": "Accept",
        "Wizen-Tier": "run" if job.need.get("start") is None else "relaxed",
        "Cache-Control": settings.kept(settings.cache_age),
    }
    held = request.headers.get("if-none-match", "")
    if matches(held, tag, there=chosen is None):
        return Response(status_code=304, headers=headers)
    if chosen is None:
        return _shard(store, job, headers)
    run = store.get(job.key)
    if chosen.name == "json" and (fields is not None or not is_surface(run, job)):
        body = jobs_fields.encode(run, fields, stage, settings.max_export_samples)
    elif isinstance(chosen, Export) or (chosen.name in STILLS and _is_scene(run, asked)):
        body = _scene(run, stage, chosen, options, settings)
    else:
        body = encode(run, job, stage, chosen, table)
    if matches(held, tag):  # whether there is such a file of it is known when it is made
        return Response(status_code=304, headers=headers)
    if chosen.name != "json":
        headers["Content-Disposition"] = f'attachment; filename="{_filename(run, job, stage, chosen)}"'
    return Response(body, headers=headers, media_type=chosen.media_type.partition(";")[0])


def _tag(job: Job, name: str, said: dict[str, Any]) -> str:
    """Return the entity tag of a result in a format, with what was said about it."""
    word = "".join(f"-{key}={value!r}" for key, value in sorted(said.items()) if value is not None)
    # what a file says besides, and how, may be another in the next version; the netCDF is the stored one
    version = "" if name == "netcdf" else f"-{__version__}"
    return f'"{job.digest}-{name}{version}{quote(word, safe="=-")}"'


def _filename(run: xr.Dataset, job: Job, stage: float | None, chosen: Format | Export) -> str:
    """Return what a file is called: with its stage where it holds one."""
    if stage is None and isinstance(chosen, Export) and not chosen.single:
        return f"{job.solver}-{job.key[:12]}{chosen.suffix}"
    symbol = registry.get(job.solver).stages.symbol if job.solver in registry.names() else "stage"
    at = float(run["stage"].values[-1]) if stage is None else stage
    return f"{job.solver}-{job.key[:12]}-{symbol}{at:g}{chosen.suffix}"


def _is_scene(run: xr.Dataset, asked: dict[str, Any]) -> bool:
    """Return whether a stage as glb or obj is more than the bare lattice: a mesh, colours, another scale."""
    return bool(asked) or "mesh_position" in run or bool(set(colours.looks(run).layers) & set(run.data_vars))


def _scene(
    run: xr.Dataset, stage: float | None, chosen: Format | Export, options: Options, settings: Settings
) -> bytes:
    """Return a result, or one stage of it, in a format of whole results.

    Raises:
        UnfitFormat: the format cannot hold this result.
        InvalidQuery: no such stage or field, or more than the service sends.

    """
    single = not isinstance(chosen, Export) or chosen.single
    # a cut is made only of what would be sent whole
    sequence = prepared(run, options.model_copy(update={"cut": None}), stage, single)
    pixels = max(options.size if chosen.name in ("png", "png-zip", "exr") else 0, options.pixels)
    if pixels > settings.max_map:
        raise InvalidQuery.of([Wrong("size", f"{pixels} pixels are more than {settings.max_map}", "Ask for fewer.")])
    if sequence.samples + len(sequence) * (options.pixels**2 + _CORNERS * options.grown) > settings.max_export_samples:
        raise InvalidQuery.of(
            [
                Wrong(
                    "format",
                    f"the file would hold {sequence.samples} vertices, more than {settings.max_export_samples}",
                    "Ask for one stage, or take the netCDF and write the file with `wizen export`.",
                )
            ]
        )
    if options.cut is not None:
        sequence = prepared(run, options, stage, single)
    if isinstance(chosen, Export):
        return write(sequence, chosen, options)
    return STILLS[chosen.name](sequence, options)


def _negotiate(accept: str | None, explicit: str | None) -> Format | Export | None:
    """Return the format asked for; None is netCDF.

    Raises:
        InvalidQuery: `explicit` names no format.
        NotAcceptable: nothing in `accept` can be had.

    """
    if explicit is not None:
        if explicit == "netcdf":
            return None
        if explicit not in _NAMES:
            advice = f"Formats: {', '.join(_NAMES)}."
            raise InvalidQuery.of([Wrong("format", f"there is no format {explicit[:40]!r}", advice)])
        return EXPORTS.get(explicit) or FORMATS[explicit]
    known: dict[str, Format | Export] = {e.media_type: e for e in EXPORTS.values()}
    known |= {f.media_type: f for f in FORMATS.values()}
    try:
        best = mimeparse.best_match([*known, NETCDF], (accept or "").strip().lower() or "*/*")
    except mimeparse.MimeTypeParseException:
        best = ""
    if best == NETCDF:
        return None
    if not best:
        listed = f"{NETCDF} (format=netcdf), " + ", ".join(f"{t} (format={f.name})" for t, f in known.items())
        raise NotAcceptable(f"no representation fits Accept: {accept}.", advice=f"Ask for one of {listed}.")
    return known[best]


def _shard(store: Store, job: Job, headers: dict[str, str]) -> Response:
    path = store.shard_path(job.key)
    try:
        whole = seal.is_whole(path)
    except FileNotFoundError:
        raise UnknownJob("the result is no longer stored.", "Ask for it again with POST /v1/jobs.") from None
    if not whole:
        raise CorruptShard("the stored result is damaged.", "Delete its file; then ask for it again.")
    return FileResponse(path, headers=headers, media_type=NETCDF, filename=f"{job.solver}-{job.key[:12]}.h5")
